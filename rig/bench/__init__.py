"""Run the computer over rows that are not being flown: recordings, logs, trials; the flight's own kernels, no plant.

vote.py, discrete_vote.py  the manager over a recording
inject.py                  faults on recorded channels, by the flight's own kernel
vote_run.py                one ``rig vote``: read, inject, align, vote, write
"""
