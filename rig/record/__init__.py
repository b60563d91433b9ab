"""What a flight leaves beside its log.

event.py           one event
events.py          what happened in which frame
failures.py        which channel failed when, decided by whom; the seconds that show a decision
suspects.py        in how many rows a channel was suspect
flight_summary.py  how the flight went: digest, end, failed channels, peaks
histogram.py       times of the wall clock, counted
"""
