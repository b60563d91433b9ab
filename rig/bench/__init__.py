"""Run the computer over given rows: recordings, logs, trials; with the kernels of the flight, without a plant.

drive.py                 the driver: the stages of a frame, each of them optional
rows_of_recording.py     from recorded channels to rows, and from rows to votes
vote_rows.py             the manager over a recording, or over the log of a flight by its own scenario
channels.py              usable samples, suspect rows and failures of each channel
inject.py                faults on recorded channels; injection_score.py: their outcomes
baseline_statistics.py   statistics of a baseline manager without isolations, for a calibration
one_signal_trials.py, splitting.py  one signal over a recorded truth, many times: for reliability
unit_check.py            a unit under test against the requirements and the built-in manager; unit_law_check.py
vote_run.py              one ``rig vote``: read, inject, align, vote, measure (write_votes.py, vote_summary.py)
"""
