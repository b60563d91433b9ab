"""Managers at one price: all calibrated to one budget on the same healthy flights, then given the same faulty trials.

entrants.py     who takes part, and which of its settings is calibrated
healthy.py      the healthy flights, signal by signal
calibration.py  each entrant's level for the budget; its false isolations in other flights
trials.py       the same draws of faults for all, open loop (reliability/trials.py), and what became of them
outcomes.py     the table, and paired differences to ours
verdict.py      the same in words
run.py          one league in a folder, which goes on where it was interrupted

docs/league.md
"""
