"""What a flight leaves beside its log.

event.py           one event
events.py          what happened in which frame
flight_summary.py  how the flight went: digest, end, failed channels, peaks
recorder.py        records a block in the loop, or on a thread while the next one is flown
pace.py            when the next frame is due, in real time
"""
