"""Campaigns: many flights of one plan in one table; an interrupted campaign resumes.

campaign_file.py  the campaign file: the varied values, and separately how it runs
plan.py        the runs: a seed and a scenario each (values from sampling.py), and the version of rig that flies them
flying.py      one flight in memory, and its log
worker.py      one run, flown and scored: the rows of the tables; a batch of runs, or suspects alone
pool.py        the processes of this computer, or a Dask cluster, for every study
run_campaign.py  the parent: hands out missing runs, writes each batch as a part
study_folder.py  the folder of every study: its options, its lock, files that are complete or absent
folder.py      the folder of a campaign: its parts, the runs done, the runs that could not be flown
table_parts.py  the parts read and checked: every run once, in all tables
tables.py      every column once: its type, its value, whether it is hashed; the hash of the tables
statistics.py, group_rates.py, campaign_summary.py  figures from the tables
estimate.py    the time and the disk space that a campaign needs
"""
