"""Servo actuators: four coils, two hydraulic systems, and the monitors that watch them.

    config.py     the ``[actuators]`` table
    servo.py      the physics of one surface: currents, spool, ram, bypass
    monitors.py   who fails a channel of it, and why
    stage.py      a flight's servos: drawn parts, state, one frame

Equations, tolerances, thresholds: docs/actuators.md.
"""
