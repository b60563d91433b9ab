"""Sensors: the truth of one frame becomes four channels, each with its own errors.

    settings.py   a sensor's data sheet: the ``[sensors.<signal>]`` tables
    classes.py    named data-sheet classes laid under those tables
    params.py     settings and seed as the arrays of the kernel
    drift.py     what is drawn a block at a time: noise, bias instability, random walk, structural mode
    recorded.py   a recorded noise file instead of the drawn noise
    alarms.py     false alarms of in-line monitors
    kernel.py     one frame: truth to channels

Equations and order of the effects: docs/sensors.md.
"""

from rig.sensors.kernel import SensorData, measure
from rig.sensors.settings import Sensor, Suite, channels, discrete_channels, ranges
from rig.sensors.stage import Sensors
