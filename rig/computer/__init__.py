"""The flight computer: what reads the bus and writes votes and commands; it knows no truth.

analytic/    substitute signals: references for the monitor, sources for the control law
redundancy/  the monitor and voter of four channels
control/     the control law, its degraded modes and its back-up
lanes/       several computers: exchange, vote of commands, health
servo_monitors.py  what watches the servos' channels
fdi/         the fault-tolerant law's test of the pitch-angle sensor
gain_schedule.py  coefficients by dynamic pressure
"""
