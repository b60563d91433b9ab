"""Foundations of all packages: the fields of a frame, units, settings, kernels, files.

frame/       the one table of a frame's fields, and the rows made of it
units/       angles, the atmosphere, quantities in the units of a reader
settings.py  a table of a user's file as settings, checked; scenario/ has the overrides
files.py     bundled files, and output files, which are complete or absent
kernels.py   compiled or plain kernels; kernel_cache.py, kernel_locks.py: kept on disk
event.py     one event of a flight
ending.py    the end of a flight in words
renamed.py   the table of old and present names
column.py    a column of a table, which Parquet, JSON, terminal and page read
errors.py, text.py, interrupt.py, progress.py, trust.py, versions.py  other needs of a command
"""
