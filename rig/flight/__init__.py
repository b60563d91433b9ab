"""One flight, from its scenario to its records.

loop.py           the order of a frame; stages.py: its stages, made from a scenario; put_out.py: commands to surfaces
fly.py            fly: loop, unit, keys, recorders and result put together
flight_result.py  the result of a flight; summary.py: digest, end, isolated channels, peaks; conclusion_rows.py
recorder.py       events, summary and log of a flight, in the loop or on a thread
events.py         events by frame: failures.py, suspects.py, servo_events.py, lane_events.py
unit_loop.py      a unit under test in the place of the manager; unit_law.py: of the law; unit_lane.py: one of several
operator_keys.py  faults and resets that an operator asks for while it flies
pace.py           real time: when the next frame is due, scheduling of the system
time_histogram.py times of the wall clock, counted
cost.py           the cost of a frame: ``rig cost``
aircraft_fmu/     the aircraft without its flight computer, as an FMU: ``rig fmu build``
"""
