"""The pitch angle without its sensor, shared by the control law and by the references of the redundancy manager.

path      two laws of kinematics: the rates of the Euler angles, and the direction of the path through the air
estimate  the Kalman filter that weighs one by the other
"""
