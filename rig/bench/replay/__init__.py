"""Replay of a log: its decisions again, what-if runs, comparison of two flights.

again.py         computers and monitors of a flight over its recorded frames
vote_again.py    the recorded channels through the redundancy stage of a scenario, or flown from the first frame
verify.py        comparison of the decisions, or the flight, to the bit
what_if.py       another redundancy over the same channels, as a separate log
compare_flights.py  two flights, number by number; before_after.py reads both
decisions.py     which decisions differ, where, old and new
"""
