"""Servo actuators: four coils, two hydraulic systems, and the monitors that watch them.

    actuators_table.py  the ``[actuators]`` table
    servo.py      the physics of one surface: currents, spool, ram, bypass
    computer/servo_monitors.py  the monitors that shut a channel off
    servo_stage.py  a flight's servos: drawn parts, state, one frame

Equations, tolerances, thresholds: docs/reference/computers-and-actuators.md.
"""
