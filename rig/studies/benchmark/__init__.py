"""Benchmark of managers at one false-isolation rate: the same healthy flights calibrate, the same faults test them.

entrants.py     the managers that are compared, and the setting of each that is calibrated
calibration_data.py  the healthy flights, signal by signal
calibration.py  the level of each manager at the false-isolation rate; its false isolations in other flights
benchmark_trials.py  the same open-loop fault draws for all managers (reliability/cell_trials.py), and the outcomes
outcome_table.py  the table, and paired differences to the built-in manager
ranking.py      the verdict in sentences
run_benchmark.py  one benchmark in a folder; an interrupted one resumes there

docs/how-to/compare-managers.md
"""
