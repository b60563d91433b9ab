"""Recorded channels through the flight's own redundancy manager: no aircraft, no simulation.

    read.read  ->  align.align (on request)  ->  vote.vote  ->  write.write

The kernels are those of rig/redundancy, on rows of rig/frame.py: a recorded flight votes as it was voted in flight.
"""
