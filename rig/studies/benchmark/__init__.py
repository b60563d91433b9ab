"""Managers at one false-isolation rate: calibrated on the same healthy flights, then given the same faulty trials.

entrants.py     who takes part, and which of its settings is calibrated
calibration_data.py  the healthy flights, signal by signal
calibration.py  each entrant's level for the budget; its false isolations in other flights
benchmark_trials.py  the same draws of faults for all, open loop (reliability/cell_trials.py), and what became of them
outcome_table.py  the table, and paired differences to ours
ranking.py      the same in words
run_benchmark.py  one benchmark in a folder, which goes on where it was interrupted

docs/benchmark.md
"""
