"""Views of a flight for people: viewer, terminal, reports and notebook.

viewer/    Rerun and Foxglove, live or from a log
terminal/  the redundancy page: ``rig watch``
pages/     HTML reports
notebook/  a flight, a log and a vote in Python: ``rig.fly``, ``rig.read_log``, ``rig.vote``
votes/     a voted signal of any name, as viewer, pages and notebook draw it
"""
