"""What everything is made of: the fields of a frame, units, settings, kernels, files.

frame/       the one table of a frame's fields, and the rows made of it
units/       angles, the atmosphere, quantities with the units that people read
settings.py  a table of a user's file as settings, checked; overrides lie in scenario/
files.py     bundled files, and output files: whole or not there
kernels.py   compiled or plain, and kept: kernel_cache.py, kernel_locks.py
event.py     one event of a flight
renamed.py   the names of before 1.0, and those of now
column.py    a column of a table, which Parquet, JSON, terminal and page read
errors.py, text.py, interrupt.py, progress.py, trust.py, versions.py  what a command needs besides
"""
