"""The pitch angle without its sensor: from the body rates, and from the path of the aircraft through the air.

Laws of kinematics, exact and free of aerodynamic derivatives, that the control law and the redundancy
manager share:

    theta' = q cos phi - r sin phi                                  good at once, drifts with the gyros' bias
    q = theta' cos phi + psi' cos theta sin phi
    p = phi' - psi' sin theta
    r = psi' cos theta cos phi - theta' sin phi
    sin gamma = a sin theta - b cos theta                           good on average: a gust's alpha is its error
    a = cos alpha cos beta,   b = sin beta sin phi + sin alpha cos beta cos phi,   sin gamma = climb rate / V

Source: Etkin, Dynamics of Atmospheric Flight, on the Euler rates and on the flight path's direction.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.core.frame import sig
from rig.core.kernels import kernel
from rig.core.units.atmosphere import air_density
from rig.core.units.constants import GRAVITY

SLOWEST: Final = 30.0  # m/s; divisions by airspeed take at least this
CROSSOVER_RAD_S: Final = 0.4  # of the climb rate: below it barometric, above it inertial
VERTICAL: Final = np.dtype(
    [
        ("pressure", "f8"),  # Pa, of the last frame
        ("barometric", "f8"),  # m, climbed since the start
        ("altitude", "f8"),  # m, the estimate of it
        ("climb", "f8"),  # m/s
        ("acceleration_error", "f8"),  # m/s2
        ("speed", "f8"),  # true airspeed, m/s
        ("started", "i8"),
    ],
    align=True,
)
# What a pitch angle from the path is made of.
PATH_SIGNALS: Final = (
    *("angle_of_attack", "angle_of_sideslip", "roll_angle", "static_pressure", "dynamic_pressure"),
    *("normal_load_factor", "lateral_load_factor", "longitudinal_load_factor"),
)


@kernel
def pitching(pitch_rate, yaw_rate, roll_angle):
    """Return the rate of the pitch angle [rad/s] from body rates and bank."""
    return pitch_rate * math.cos(roll_angle) - yaw_rate * math.sin(roll_angle)


@kernel
def pitch_rate_of(pitching, turning, theta, phi):
    """Return the pitch rate [rad/s] from the rates of pitch angle and heading."""
    return pitching * math.cos(phi) + turning * math.cos(theta) * math.sin(phi)


@kernel
def roll_rate_of(rolling, turning, theta):
    """Return the roll rate [rad/s] from the rates of roll angle and heading."""
    return rolling - turning * math.sin(theta)


@kernel
def yaw_rate_of(pitching, turning, theta, phi):
    """Return the yaw rate [rad/s] from the rates of pitch angle and heading."""
    return turning * math.cos(theta) * math.cos(phi) - pitching * math.sin(phi)


@kernel
def path_axes(alpha, beta, roll_angle):
    """Return a and b of the equation of the path."""
    a = math.cos(alpha) * math.cos(beta)
    return a, math.sin(beta) * math.sin(roll_angle) + math.sin(alpha) * math.cos(beta) * math.cos(roll_angle)


@kernel
def pitch_on_path(sine, alpha, beta, roll_angle):
    """Return the pitch angle [rad] at which the path climbs with ``sine``; the inverse of ``path_angle``."""
    a, b = path_axes(alpha, beta, roll_angle)
    size = max(math.sqrt(a * a + b * b), 0.1)
    return math.asin(min(max(sine / size, -1.0), 1.0)) + math.atan2(b, a)


@kernel
def path_angle(theta: float, phi: float, alpha: float, beta: float) -> float:
    """Return the angle [rad] of the path through the air above the horizon, from attitude and air-flow angles [rad].

    sin(gamma) = cos a cos b sin theta - sin b sin phi cos theta - sin a cos b cos phi cos theta
    """
    climb = math.cos(alpha) * math.cos(beta) * math.sin(theta)
    climb -= math.sin(beta) * math.sin(phi) * math.cos(theta)
    climb -= math.sin(alpha) * math.cos(beta) * math.cos(phi) * math.cos(theta)
    return math.asin(min(max(climb, -1.0), 1.0))


@kernel
def climb(x, theta, dt, v):
    """Move the climb rate by a frame: a complementary filter of third order, all poles at ``CROSSOVER_RAD_S``.

    Pressure altitude (p' = -rho g h') counts below it, the load factors above it; a constant accelerometer error
    is estimated and taken off.  x : (S,) signals; theta : pitch angle [rad], for the direction of the load factors;
    v : a VERTICAL record, in place
    """
    density = air_density(x[sig.P_S])
    v["speed"] = max(math.sqrt(2.0 * max(x[sig.Q_BAR], 0.0) / density), SLOWEST)
    if v["started"] == 0:
        a, b = path_axes(x[sig.ALPHA], x[sig.BETA], x[sig.PHI])
        v["climb"] = v["speed"] * (a * math.sin(theta) - b * math.cos(theta))
        v["pressure"], v["started"] = x[sig.P_S], 1
    v["barometric"] -= (x[sig.P_S] - v["pressure"]) / (density * GRAVITY)
    v["pressure"] = x[sig.P_S]
    level = x[sig.N_Z] * math.cos(x[sig.PHI]) - x[sig.N_Y] * math.sin(x[sig.PHI])
    acceleration = GRAVITY * (level * math.cos(theta) + x[sig.N_X] * math.sin(theta) - 1.0)
    off, rate, w = v["barometric"] - v["altitude"], v["climb"], CROSSOVER_RAD_S
    v["acceleration_error"] += w * w * w * off * dt
    v["climb"] += (acceleration + v["acceleration_error"] + 3.0 * w * w * off) * dt
    v["altitude"] += (rate + 3.0 * w * off) * dt


@kernel
def path_pitch_angle(x, v):
    """Return the pitch angle [rad] from climb rate, airspeed and the angles of the air flow; x, v as for ``climb``."""
    sine = min(max(v["climb"] / v["speed"], -1.0), 1.0)
    return pitch_on_path(sine, x[sig.ALPHA], x[sig.BETA], x[sig.PHI])
