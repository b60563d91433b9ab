"""Rates of turn and bank angle from the inertial unit: what moves the pitch angle, without any voted attitude or rate.

    phi' = p + (q sin phi + r cos phi) tan theta + k (a / g - n_z sin phi - n_y cos phi) / n_level
    a    = V chi'                                   sideways acceleration of the velocity over ground
    n_level = n_z cos phi - n_y sin phi             load factor along the local vertical

The unit's rates are integrated to the bank angle, which converges to the bank of a coordinated turn of its velocity.
The error by its biases and those of the accelerometers is learned in straight flight, as the difference from the voted
bank angle.  An error of the voted one that grows with the bank, or that comes later, is not learned.
The drift of its yaw rate is its mean difference from the rate of the heading.  It is learned while no fault is
declared, and slowly, so that a heading fault is found before it has moved the drift.  Source: the velocity matching of
strapdown alignment (Titterton and Weston, Strapdown Inertial Navigation Technology), reduced to one angle.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.computer.analytic.flight_path import SLOWEST
from rig.core.frame import INERTIAL, sig
from rig.core.kernels import kernel
from rig.core.units.angles import wrap
from rig.core.units.constants import GRAVITY

UNIT: Final = np.dtype(
    [
        ("pitch_rate", "f8"),  # rad/s, ahead by ``_LEAD_S``
        ("yaw_rate", "f8"),  # rad/s, less its drift
        ("roll_angle", "f8"),  # rad
        ("yaw_drift", "f8"),  # rad/s
        ("yaw_error", "f8"),  # rad/s, what the heading does not confirm of the yaw rate, smoothed
        ("yaw_seconds", "f8"),  # for which the drift has been learned
        ("settled", "f8"),  # share of its convergence that the bank angle has gone through
        ("usual_bank", "f8"),  # rad, by which the voted bank angle is larger in straight flight
        ("bank_seconds", "f8"),  # of straight flight in which that has been learned
        ("last", "f8", (4,)),  # of the last frame: pitch rate, velocity north and east, heading
        ("started", "i8"),
    ],
    align=True,
)
_P, _Q, _R = (INERTIAL.index(f"{axis}_rate_rad_s") for axis in ("roll", "pitch", "yaw"))
_NORTH, _EAST = INERTIAL.index("velocity_north_m_s"), INERTIAL.index("velocity_east_m_s")
_ERECTION_1_S: Final = 0.3  # k: of the convergence to the bank of the turn
STRAIGHT_RAD: Final = 0.1  # of bank; beyond it an error of the voted one is no longer small beside it
_FIRST_S: Final = 0.3  # of straight flight, before which little is learned of the usual difference
_BANK_STEP_RAD: Final = 0.001  # once it is known no more of it is learned in a minute
_MOST_USUAL_RAD: Final = 0.03  # 20 mg of lateral load factor, 1.7 mrad/s of roll rate over k, 1.8 mrad of roll angle
_LEAST_LEVEL: Final = 0.3  # g; below it load factors do not show the bank angle
_LEAD_S: Final = 0.015  # the unit's lag beyond that of the gyros
_MOST_TURN_RAD_S: Final = 0.3  # of a heading; a quicker one is a jump of its sensor
SMOOTH_S: Final = 1.0
_KNOWN_S: Final = 5.0  # after which a difference is known well enough to be held
_LEARN_S: Final = 60.0  # in which it is learned then
SAME_RAD_S: Final = 0.001  # as usual; a bias below this is as good as none


@kernel
def finite(inertial):
    """Return True if the unit's rates and velocity over ground are numbers."""
    rates = inertial[_P] + inertial[_Q] + inertial[_R]
    return math.isfinite(rates + inertial[_NORTH] + inertial[_EAST])


@kernel
def learned(error, seconds, dt):
    """Return the change of a mean in one frame after ``seconds`` by an ``error`` [rad/s], later clipped."""
    if seconds > _KNOWN_S:
        error = min(max(error, -SAME_RAD_S), SAME_RAD_S)
    return dt / (min(seconds, _LEARN_S) + SMOOTH_S) * error


@kernel
def follow_unit(inertial, x, theta, learn, dt, u):
    """Move the unit's rates and bank angle by a frame.

    inertial : quantities of frame.INERTIAL, finite; x : (S,) signals, of which load factors and heading are read
    theta : pitch angle [rad]; learn : whether heading and gyros are trusted; u : a UNIT record, in place
    """
    last, q, north, east = u["last"], inertial[_Q], inertial[_NORTH], inertial[_EAST]
    if u["started"] == 0:
        last[0], last[1], last[2], last[3], u["started"] = q, north, east, x[sig.PSI], 1
    speed, phi = max(math.sqrt(north * north + east * east), SLOWEST), u["roll_angle"]
    sideways = (north * (east - last[2]) - east * (north - last[1])) / (speed * dt)
    u["pitch_rate"] = q + _LEAD_S / dt * (q - last[0])
    u["yaw_rate"] = inertial[_R] - u["yaw_drift"]
    last[0], last[1], last[2] = q, north, east
    sine, cosine = math.sin(phi), math.cos(phi)
    if learn and cosine > _LEAST_LEVEL:
        turned = min(max(wrap(x[sig.PSI] - last[3]), -_MOST_TURN_RAD_S * dt), _MOST_TURN_RAD_S * dt)
        turn = (turned / dt * math.cos(theta) - q * sine) / cosine
        u["yaw_error"] += dt / (SMOOTH_S + dt) * (u["yaw_rate"] - turn - u["yaw_error"])
        u["yaw_seconds"] += dt
        u["yaw_drift"] += learned(u["yaw_error"], u["yaw_seconds"], dt)
    last[3] = x[sig.PSI]
    level = x[sig.N_Z] * cosine - x[sig.N_Y] * sine
    rate = inertial[_P] + (q * sine + u["yaw_rate"] * cosine) * math.tan(theta)
    if level > _LEAST_LEVEL:
        rate += _ERECTION_1_S * (sideways / GRAVITY - x[sig.N_Z] * sine - x[sig.N_Y] * cosine) / level
    u["roll_angle"] = wrap(phi + dt * rate)


@kernel
def learn_bank(u, apart, learn, dt):
    """Learn by how much the bank angles are usually ``apart`` [rad], voted less the unit's.

    Constant errors of rates and load factors appear in phi as it converges, by 1 - exp(-k t): least squares on that
    share.  u : a UNIT record, in place; learn : whether nothing is suspected
    """
    u["settled"] += dt * _ERECTION_1_S * (1.0 - u["settled"])
    if learn and abs(u["roll_angle"]) < STRAIGHT_RAD:
        share, error = u["settled"], apart - u["settled"] * u["usual_bank"]
        u["bank_seconds"] += dt * share * share
        if u["bank_seconds"] > _KNOWN_S:
            error = min(max(error, -_BANK_STEP_RAD), _BANK_STEP_RAD)
        usual = u["usual_bank"] + dt * share / (min(u["bank_seconds"], _LEARN_S) + _FIRST_S) * error
        u["usual_bank"] = min(max(usual, -_MOST_USUAL_RAD), _MOST_USUAL_RAD)


@kernel
def bank_by(u):
    """Return the bank angle [rad] by the unit, with its usual difference from the voted one; u : a UNIT record."""
    return u["roll_angle"] + u["settled"] * u["usual_bank"]
