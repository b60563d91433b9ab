"""Physical constants, each once.  JSBSim's feet, pounds and slugs are in ``rig.world.plant`` alone.

Standard atmosphere: ISO 2533 / U.S. Standard Atmosphere 1976, up to 20 km (the isothermal layer above the tropopause).
"""

from __future__ import annotations

from math import pi
from typing import Final

TWO_PI: Final = 2.0 * pi  # a whole turn
GRAVITY: Final = 9.80665  # m/s2
GAS_CONSTANT: Final = 287.05287  # J/(kg K), dry air
HEAT_RATIO: Final = 1.4  # of air
SEA_LEVEL_PRESSURE: Final = 101_325.0  # Pa
SEA_LEVEL_TEMPERATURE: Final = 288.15  # K
SEA_LEVEL_DENSITY: Final = SEA_LEVEL_PRESSURE / (GAS_CONSTANT * SEA_LEVEL_TEMPERATURE)  # kg/m3
LAPSE_RATE: Final = 0.0065  # K/m
TROPOPAUSE_ALTITUDE: Final = 11_000.0  # m, geopotential
# Rounded as the standard prints them: the redundancy manager and the references compute with these, and the exact
# ones would change the last bit of what they write.
DENSITY_PRINTED: Final = 1.225  # kg/m3, at sea level
STRATOSPHERE_TEMPERATURE_PRINTED: Final = 216.65  # K
TEMPERATURE_EXPONENT_PRINTED: Final = 0.190263  # of pressure to temperature
