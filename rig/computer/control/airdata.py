"""Air data from static and dynamic pressure, in the International Standard Atmosphere.

Source: ISO 2533 / U.S. Standard Atmosphere 1976, up to 20 km (the isothermal layer above the
tropopause); dynamic pressure here is rho V^2 / 2 = 0.7 p M^2, not the impact pressure of a pitot tube.
"""

from __future__ import annotations

import math
from typing import Final

from rig.kernels import kernel
from rig.units.atmosphere import (
    GAS_CONSTANT,
    GRAVITY,
    LAPSE_RATE,
    SEA_LEVEL_DENSITY,
    SEA_LEVEL_PRESSURE,
    SEA_LEVEL_TEMPERATURE,
    TROPOPAUSE_ALTITUDE,
)

TROPOPAUSE_TEMPERATURE: Final = SEA_LEVEL_TEMPERATURE - LAPSE_RATE * TROPOPAUSE_ALTITUDE
EXPONENT: Final = GAS_CONSTANT * LAPSE_RATE / GRAVITY  # of pressure to temperature, 0.190263
TROPOPAUSE_PRESSURE: Final = SEA_LEVEL_PRESSURE * (TROPOPAUSE_TEMPERATURE / SEA_LEVEL_TEMPERATURE) ** (1.0 / EXPONENT)
SCALE_HEIGHT: Final = GAS_CONSTANT * TROPOPAUSE_TEMPERATURE / GRAVITY  # m, above the tropopause
LOWEST_PRESSURE: Final = 1_000.0  # Pa; below it (31 km) the static pressure is taken as this


@kernel
def pressure_altitude(static_pressure: float) -> float:
    """Return the altitude [m, geopotential] at which the standard atmosphere has ``static_pressure`` [Pa]."""
    p = max(static_pressure, LOWEST_PRESSURE)
    if p >= TROPOPAUSE_PRESSURE:
        ratio = math.pow(p / SEA_LEVEL_PRESSURE, EXPONENT)
        return SEA_LEVEL_TEMPERATURE / LAPSE_RATE * (1.0 - ratio)
    return TROPOPAUSE_ALTITUDE + SCALE_HEIGHT * math.log(TROPOPAUSE_PRESSURE / p)


@kernel
def mach_number(static_pressure: float, dynamic_pressure: float) -> float:
    """Return the Mach number from q = 0.7 p M^2, both pressures in Pa; a negative dynamic pressure counts as zero."""
    return math.sqrt(max(dynamic_pressure, 0.0) / (0.7 * max(static_pressure, LOWEST_PRESSURE)))


@kernel
def true_airspeed(mach: float, air_temperature: float) -> float:
    """Return the true airspeed [m/s] at ``mach`` in air of ``air_temperature`` [K]: V = M sqrt(1.4 R T)."""
    return mach * math.sqrt(1.4 * GAS_CONSTANT * air_temperature)


@kernel
def equivalent_airspeed(dynamic_pressure: float) -> float:
    """Return the equivalent airspeed [m/s]: V_e = sqrt(2 q / rho_0), ``dynamic_pressure`` in Pa."""
    return math.sqrt(2.0 * max(dynamic_pressure, 0.0) / SEA_LEVEL_DENSITY)


@kernel
def flight_path_angle(theta: float, phi: float, alpha: float, beta: float) -> float:
    """Return the angle [rad] of the path through the air above the horizon, from attitude and air-flow angles [rad].

    sin(gamma) = cos a cos b sin theta - sin b sin phi cos theta - sin a cos b cos phi cos theta
    """
    climb = math.cos(alpha) * math.cos(beta) * math.sin(theta)
    climb -= math.sin(beta) * math.sin(phi) * math.cos(theta)
    climb -= math.sin(alpha) * math.cos(beta) * math.cos(phi) * math.cos(theta)
    return math.asin(min(max(climb, -1.0), 1.0))
