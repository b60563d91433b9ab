"""The aircraft, its servos and sensors, and their faults.

plant/      JSBSim, or the linear aircraft: the truth of a frame
sensors/    truth to four channels
faults/     what changes channels, parts and computers, and when
actuators/  commands to surfaces
"""
