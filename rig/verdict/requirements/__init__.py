"""Requirements: formulas over a flight with windows in time, each with a verdict and a robustness.

requirement.py  one requirement of a file; bundled sets: faults/requirements/
formula.py      its tree, within bounds, by the grammar of triggers (rig/world/faults/grammar.py)
subject.py      what there is to measure: signals, thresholds, faults, limits; quantity_columns.py: taken out of rows
robustness.py      verdict and robustness of a tree over frames, by sliding minima; as they are shown
along.py        beside the conclusion of a flight while it is flown; verdicts as plain data
settled_comparisons.py  comparisons that are decided before the flight
requirement_recorder.py  blocks of rows in, verdicts out; measure.py: of flights, logs and rows

docs/how-to/requirements-and-ci.md defines every quantity.
"""
