"""Views of a flight for people: viewer, terminal, reports and notebook.

viewer/    Rerun and Foxglove, live or from a log
terminal/  the redundancy page: ``rig watch``
pages/     HTML reports
notebook/  a flight and a log in Python: ``rig.fly``, ``rig.read_log``
"""
