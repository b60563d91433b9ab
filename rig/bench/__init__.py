"""Run the computer over rows that are not being flown: recordings, logs, trials; the flight's own kernels, no plant.

drive.py                 the one driver: the stages of a frame, each of which can be left out
rows_of_recording.py     recorded channels as rows, and the answers out of them
vote_rows.py             the manager over a recording, or over the log of a flight by its own scenario
channels.py              usable samples, suspect rows and failures of each channel
inject.py                faults on recorded channels; injection_score.py: what became of them
baseline_statistics.py      what a baseline manager computes of rows without failing anybody: for a calibration
one_signal_trials.py, splitting.py  one signal over a recorded truth, many times: for reliability
unit_check.py            a unit under test against the requirement and against our own manager
vote_run.py              one ``rig vote``: read, inject, align, vote, measure (write_votes.py, vote_summary.py)
"""
