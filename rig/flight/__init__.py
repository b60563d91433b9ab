"""One flight from its scenario to its records.

fly.py            fly: loop, unit, keys, recorders and result put together
flight_result.py  what a finished flight gives
recorder.py       events, summary and log of a flight, in the loop or on a thread
unit_loop.py      a unit under test in the place of the manager
operator_keys.py  faults and resets that an operator asks for while it flies
pace.py           real time: when the next frame is due, what the machine is asked for
cost.py           what a frame costs: ``rig bench``
"""
