"""Sensors: the truth of one frame becomes four channels, each with its own errors.

    data_sheet.py  a sensor's data sheet: the ``[sensors.<signal>]`` tables
    classes.py    named data-sheet classes laid under those tables
    params.py     settings and seed as the arrays of the kernel
    draws.py      what is drawn a block at a time: bias instability, random walk, structural mode, false alarms
    noise_file.py  a recorded noise file instead of the drawn noise
    kernel.py     one frame: truth to channels; the stage
    inertial.py   the inertial unit, one box that is no channel of any signal

Equations and order of the effects: docs/reference/sensors-and-redundancy.md.
"""

from rig.world.sensors.data_sheet import (
    Sensor,
    Suite,
    channels,
    data_sheets,
    discrete_channels,
    fitted,
    noise_std,
    ranges,
)
from rig.world.sensors.kernel import SensorData, Sensors, measure
