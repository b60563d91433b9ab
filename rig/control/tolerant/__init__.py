"""The fault-tolerant law's part beyond the plain law: a pitch angle that does not hang on its sensor.

    witness   one frame: estimate, judge the sensor, answer for it when it lies
    (the Kalman filter itself: rig.inclination)
    judge     innovation tests, hand-back, arbitration by the path
    rates     whose rates of turn are in order: the gyros', the inertial unit's, or both
    lie       what the sensor says of the true angle: effectiveness and offset
    record    parameters and state
    settings  the ``[control.tolerant]`` table

The rest of the law flies on as it is, on the estimate in the sensor's place.
"""
