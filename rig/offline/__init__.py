"""What is done with a log afterwards: replay it, ask what if, compare two.

replay.recorded       a log with the scenario that it was flown by
replay.vote_again     the recorded channels through the redundancy stage of a scenario
compare.compare       two flights, number by number
decisions.moved       which decisions differ, where, old and new
what_if.what_if       another redundancy over the same channels, as a log of its own
"""
