"""Campaigns: many flights of one plan, whatever interrupts them, in one table.

campaign_file.py  the campaign file: what varies, and apart from it how it runs
plan.py        the runs: a seed and a scenario each (values from sampling.py), and the rig that flies them
flying.py      one flight in memory, and its log
worker.py      one run, flown and scored: the rows of the tables; a batch of them, or suspects alone
pool.py        who works: processes of this machine, or a Dask cluster; of every study
run_campaign.py  the parent: hands out what is missing, writes each batch as a part
study_folder.py  the folder of every study: what it was asked, its lock, files that are whole or not there
folder.py      that of a campaign: its parts, what is done, what could not be flown
table_parts.py  the parts read and checked: every run once, in all tables
tables.py      every column once: its type, its value, whether it is hashed; the hash of the tables
statistics.py, group_rates.py, campaign_summary.py  figures from the tables
estimate.py    what a campaign will take
"""
