"""Fault detection and isolation of the pitch-angle sensor: what the fault-tolerant law has beyond the plain one.

    monitor       one frame: estimate, test the sensor, substitute a faulty one
    (the Kalman filter itself: rig.computer.analytic.pitch_filter)
    decision      innovation tests, reversion, arbitration by the path
    rate_bias     whose rates of turn are in order: the gyros', the inertial unit's, or both
    fault_estimate  effectiveness and offset of a faulty sensor
    pitch_test_state  the ``[control.tolerant]`` table, parameters and state

The rest of the law flies on as it is, on the estimate in the sensor's place.
"""
