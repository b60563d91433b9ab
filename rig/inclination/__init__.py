"""The pitch angle without its sensor, shared by the control law and by the references of the redundancy manager.

path      two laws of kinematics: the rates of the Euler angles, and the direction of the path through the air
unit      rates of turn and bank angle from the inertial unit
mean      the filter's mean, of which the control law carries a second one
estimate  the Kalman filter that weighs one by the other
"""
