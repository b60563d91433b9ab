"""Campaigns: many flights of one plan, whatever interrupts them, in one table.

config.py  the campaign file: what varies, and apart from it how it runs
plan.py    the runs: a seed and a scenario each (values from sampling.py)
flying.py  one run, flown in memory and scored: the rows of the table; a batch of them is a worker's task
alone.py   suspects, flown in a process of their own
pool.py    where batches are flown: processes of this machine, or a Dask cluster
run.py     the parent: hands out what is missing, writes each batch as a part
folder.py  the output folder: what belongs to it, parts, what is done
parts.py   the parts read and checked: every run once, in all tables
table.py   the tables' columns, their hash
statistics.py, summary.py, compare.py, report.py   what the tables say
"""
