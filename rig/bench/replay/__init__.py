"""Ask a log again: replay its decisions, ask what if, compare two flights.

again.py         computers and monitors of a flight over its recorded frames
vote_again.py    the recorded channels through the redundancy stage of a scenario, or flown from the first frame
verify.py        are the decisions, or the flight, the same to the bit?
what_if.py       another redundancy over the same channels, as a log of its own
compare_flights.py  two flights, number by number; before_after.py reads what is compared
decisions.py     which decisions differ, where, old and new
"""
