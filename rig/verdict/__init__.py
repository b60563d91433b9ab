"""What became of each fault, of the vote and of the flight, measured by the truth.

signal_kernels.py  kernels over one signal's fields: who is healthy, who was failed and when, how far the vote is off
row_kernel.py      the one kernel over rows: with fault_kernels.py it fills the records of tally_records.py
servo_kernels.py      the same over the rows of servo actuators; servo_tally.py, servo_sentence.py
flight_tally.py    adds blocks of a flight, while it is flown or afterwards; its clean channels: unfaulted.py
words.py           the vocabulary, and the public names of each word
scoring.py         the score (score_records.py): tables over the records; patterns.py; transients.py (baseline)
of_log.py          the score of a log, and the conclusion of a flight; its sentences: conclusion.py, fault_sentence.py

docs/reference/scores-and-tables.md defines every number.
"""
