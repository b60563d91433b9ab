"""Score a flight against the truth: each fault, the voted values, the aircraft.

signal_kernels.py  kernels over one signal's fields: healthy channels, isolations, error of the vote
row_kernel.py      the one kernel over rows: with fault_kernels.py it fills the records of tally_records.py
servo_kernels.py      the same over the rows of servo actuators; servo_tally.py
flight_tally.py    adds blocks of a flight, while it is flown or afterwards; its clean channels: unfaulted.py
words.py           the vocabulary, and the public names of each word
scoring.py         the score (score_records.py): tables over the records; patterns.py; transients.py (baseline)
of_log.py          the score of a log, and the conclusion of a flight while it is flown
conclusion.py      the conclusion: rows from fault_rows.py, split_rows.py, isolation_rows.py, flight_rows.py;
                   fault_words.py, servo_words.py, lane_words.py, law_tally.py: words of a fault

docs/reference/scores-and-tables.md defines every number.
"""
