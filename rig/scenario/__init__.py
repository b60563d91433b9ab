"""What is flown, as a person wrote it.

scenario.py        the scenario, from its file to what each stage is set to; scenario_notes.py: what hardly anyone means
aircraft.py        the folder of an aircraft: its tables, and what its design wrote
overrides.py       ``key=value`` laid over a scenario
make_fault.py      one fault made in Python: ``rig.fault``
pressed_keys.py    what keys did in a flight, laid on its scenario
"""
