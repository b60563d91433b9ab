"""Recordings of redundant channels that the rig did not fly: CSV, Parquet, npz, MCAP, or a log of the rig.

vote_config.py     how each recorded signal is monitored: CONFIG of ``rig vote``
read.py            a file to a Recording (recording.py); stamps.py checks its time, own_logs.py reads logs of the rig
align.py           channels that are late or off by a constant; align_matrix.py: or turned; delays.py, offset_moves.py
injection_file.py  faults to inject
columns_file.py    columns of CSV and Parquet files; csv_file.py finds separator, decimal sign and calendar time
doubts.py          samples out of range: told, or refused
"""
