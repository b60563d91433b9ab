"""Logs of autopilots, ROS 2 and test benches as named columns: time, value, unit, instance.

contents.py    what a log holds: its topics, one for each instance of a message
known.py       the format of a file, by its first bytes; its reader
px4.py         PX4 ULog (.ulg), by pyulog
ardupilot.py   ArduPilot dataflash (.BIN): messages found by pymavlink, decoded by numpy
ros2.py        ROS 2 bags (.db3, .mcap with CDR, folders), by rosbags
mdf.py         ASAM MDF 4 (.mf4), by asammdf
presets.py     which topics of a format are redundant sensors, as a CONFIG of ``rig vote``
"""
