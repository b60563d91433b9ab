"""Air data from static and dynamic pressure, in the International Standard Atmosphere.

Source: ISO 2533 / U.S. Standard Atmosphere 1976, up to 20 km (the isothermal layer above the
tropopause); dynamic pressure here is rho V^2 / 2 = 0.7 p M^2, not the impact pressure of a pitot tube.
"""

from __future__ import annotations

import math

from rig.core.kernels import kernel
from rig.core.units.atmosphere import LOWEST_PRESSURE
from rig.core.units.constants import GAS_CONSTANT, HEAT_RATIO, SEA_LEVEL_DENSITY


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


@kernel
def flight_path_angle(theta: float, phi: float, alpha: float, beta: float) -> float:
    """Return the angle [rad] of the path through the air above the horizon, from attitude and air-flow angles [rad].

    sin(gamma) = cos a cos b sin theta - sin b sin phi cos theta - sin a cos b cos phi cos theta
    """
    climb = math.cos(alpha) * math.cos(beta) * math.sin(theta)
    climb -= math.sin(beta) * math.sin(phi) * math.cos(theta)
    climb -= math.sin(alpha) * math.cos(beta) * math.cos(phi) * math.cos(theta)
    return math.asin(min(max(climb, -1.0), 1.0))
