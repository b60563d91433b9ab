"""Logs of autopilots, ROS 2 and test benches as named columns: time, value, unit, instance.

contents.py    the topics of a log, one for each instance of a message
known.py       the format of a file, by its first bytes; its reader
px4.py         PX4 ULog (.ulg); ulog.py: the structure of the file
ardupilot.py   ArduPilot dataflash (.BIN); dataflash.py: the structure of the file
ros2.py        ROS 2 bags; bags.py: their files; cdr.py: their messages
mdf.py         ASAM MDF 4 (.mf4), by asammdf
presets.py     which topics of a format are redundant sensors, as a CONFIG of ``rig vote``
log_info.py    the answer of ``rig info``
"""
