"""The scenario of a flight, as its author wrote it.

scenario.py        the scenario, from its file to the settings of each stage; scenario_notes.py: notes on it
aircraft.py        the folder of an aircraft: its tables and its design files
overrides.py       ``key=value`` laid over a scenario
make_fault.py      one fault made in Python: ``rig.fault``
pressed_keys.py    effects of keys in a flight, as part of its scenario
"""
