"""The International Standard Atmosphere: air at an altitude; altitude, density and airspeeds at two pressures.

Source: ISO 2533 / U.S. Standard Atmosphere 1976, up to 20 km (the isothermal layer above the tropopause); the dynamic
pressure is rho V^2 / 2 = 0.7 p M^2, not the impact pressure of a pitot tube.
"""

from __future__ import annotations

import math
from typing import Final

from rig.core.kernels import kernel
from rig.core.units.constants import (
    GAS_CONSTANT,
    GRAVITY,
    HEAT_RATIO,
    LAPSE_RATE,
    SEA_LEVEL_DENSITY,
    SEA_LEVEL_PRESSURE,
    SEA_LEVEL_TEMPERATURE,
    STRATOSPHERE_TEMPERATURE_PRINTED,
    TEMPERATURE_EXPONENT_PRINTED,
    TROPOPAUSE_ALTITUDE,
)

LOWEST_PRESSURE: Final = 1_000.0  # Pa; below it (31 km) the static pressure is taken as this
TROPOPAUSE_TEMPERATURE: Final = SEA_LEVEL_TEMPERATURE - LAPSE_RATE * TROPOPAUSE_ALTITUDE
EXPONENT: Final = GAS_CONSTANT * LAPSE_RATE / GRAVITY  # of pressure to temperature, 0.190263
TROPOPAUSE_PRESSURE: Final = SEA_LEVEL_PRESSURE * (TROPOPAUSE_TEMPERATURE / SEA_LEVEL_TEMPERATURE) ** (1.0 / EXPONENT)
SCALE_HEIGHT: Final = GAS_CONSTANT * TROPOPAUSE_TEMPERATURE / GRAVITY  # m, above the tropopause
_PRESSURE_EXPONENT: Final = GRAVITY / (GAS_CONSTANT * LAPSE_RATE)
_HIGHEST: Final = 20_000.0  # m; above it the air is taken as here


@kernel
def temperature(altitude: float) -> float:
    """Return the air temperature [K] at ``altitude`` [m, geopotential]."""
    return SEA_LEVEL_TEMPERATURE - LAPSE_RATE * min(altitude, TROPOPAUSE_ALTITUDE)


@kernel
def pressure(altitude: float) -> float:
    """Return the static pressure [Pa] at ``altitude`` [m, geopotential]."""
    air = temperature(altitude)
    p = SEA_LEVEL_PRESSURE * math.pow(air / SEA_LEVEL_TEMPERATURE, _PRESSURE_EXPONENT)
    above = min(altitude, _HIGHEST) - TROPOPAUSE_ALTITUDE
    return p * math.exp(-GRAVITY * above / (GAS_CONSTANT * air)) if above > 0.0 else p


@kernel
def density(altitude: float) -> float:
    """Return the air density [kg/m3] at ``altitude`` [m, geopotential]."""
    return pressure(altitude) / (GAS_CONSTANT * temperature(altitude))


@kernel
def speed_of_sound(altitude: float) -> float:
    """Return the speed of sound [m/s] at ``altitude`` [m, geopotential]: sqrt(1.4 R T)."""
    return math.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature(altitude))


@kernel
def pressure_altitude(static_pressure: float) -> float:
    """Return the altitude [m, geopotential] at which the standard atmosphere has ``static_pressure`` [Pa]."""
    p = max(static_pressure, LOWEST_PRESSURE)
    if p >= TROPOPAUSE_PRESSURE:
        ratio = math.pow(p / SEA_LEVEL_PRESSURE, EXPONENT)
        return SEA_LEVEL_TEMPERATURE / LAPSE_RATE * (1.0 - ratio)
    return TROPOPAUSE_ALTITUDE + SCALE_HEIGHT * math.log(TROPOPAUSE_PRESSURE / p)


@kernel
def air_density(static_pressure):
    """Return the density [kg/m3] where the standard atmosphere has ``static_pressure`` [Pa].

    T = 288.15 (p / 101325)^0.190263, not below 216.65 K;  rho = p / (287.05287 T)
    """
    p = max(static_pressure, LOWEST_PRESSURE)
    air = SEA_LEVEL_TEMPERATURE * math.pow(p / SEA_LEVEL_PRESSURE, TEMPERATURE_EXPONENT_PRINTED)
    return p / (GAS_CONSTANT * max(air, STRATOSPHERE_TEMPERATURE_PRINTED))


@kernel
def mach_number(static_pressure: float, dynamic_pressure: float) -> float:
    """Return the Mach number from q = 0.7 p M^2, both pressures in Pa; a negative dynamic pressure counts as zero."""
    return math.sqrt(max(dynamic_pressure, 0.0) / (0.7 * max(static_pressure, LOWEST_PRESSURE)))


@kernel
def true_airspeed(mach: float, air_temperature: float) -> float:
    """Return the true airspeed [m/s] at ``mach`` in air of ``air_temperature`` [K]: V = M sqrt(1.4 R T)."""
    return mach * math.sqrt(HEAT_RATIO * GAS_CONSTANT * air_temperature)


@kernel
def equivalent_airspeed(dynamic_pressure: float) -> float:
    """Return the equivalent airspeed [m/s]: V_e = sqrt(2 q / rho_0), ``dynamic_pressure`` in Pa."""
    return math.sqrt(2.0 * max(dynamic_pressure, 0.0) / SEA_LEVEL_DENSITY)
