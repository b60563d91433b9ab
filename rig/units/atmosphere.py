"""Standard gravity and standard air.

Source: ISO 2533 / U.S. Standard Atmosphere 1976, up to 20 km (the isothermal layer above the tropopause).
"""

from __future__ import annotations

import math
from typing import Final

from rig.kernels import kernel

GRAVITY: Final = 9.80665  # m/s2
GAS_CONSTANT: Final = 287.05287  # J/(kg K), dry air
SEA_LEVEL_PRESSURE: Final = 101_325.0  # Pa
SEA_LEVEL_TEMPERATURE: Final = 288.15  # K
SEA_LEVEL_DENSITY: Final = SEA_LEVEL_PRESSURE / (GAS_CONSTANT * SEA_LEVEL_TEMPERATURE)  # kg/m3
LAPSE_RATE: Final = 0.0065  # K/m
TROPOPAUSE_ALTITUDE: Final = 11_000.0  # m, geopotential
_EXPONENT: Final = GRAVITY / (GAS_CONSTANT * LAPSE_RATE)
_HIGHEST: Final = 20_000.0  # m; above it the air is taken as here


@kernel
def temperature(altitude: float) -> float:
    """Air temperature [K] at ``altitude`` [m, geopotential]."""
    return SEA_LEVEL_TEMPERATURE - LAPSE_RATE * min(altitude, TROPOPAUSE_ALTITUDE)


@kernel
def pressure(altitude: float) -> float:
    """Static pressure [Pa] at ``altitude`` [m, geopotential]."""
    air = temperature(altitude)
    p = SEA_LEVEL_PRESSURE * math.pow(air / SEA_LEVEL_TEMPERATURE, _EXPONENT)
    above = min(altitude, _HIGHEST) - TROPOPAUSE_ALTITUDE
    return p * math.exp(-GRAVITY * above / (GAS_CONSTANT * air)) if above > 0.0 else p


@kernel
def speed_of_sound(altitude: float) -> float:
    """Speed of sound [m/s] at ``altitude`` [m, geopotential]: sqrt(1.4 R T)."""
    return math.sqrt(1.4 * GAS_CONSTANT * temperature(altitude))
