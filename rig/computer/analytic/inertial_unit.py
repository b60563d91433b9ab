"""The inertial unit in a signal's place: body rates, load factors, static pressure, attitude.

It is one box, no channel of any signal, and needs no vote but what is kept of the agreed past (strapdown.py).
Source: Zhang 2023, section 7, for the rates; Etkin, Dynamics of Atmospheric Flight, for the load factors.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.computer.analytic import strapdown
from rig.computer.analytic.strapdown import ASTRAY_S, LONG_S, frames_of, level_gain, slope_gain
from rig.core.frame import INERTIAL, sig
from rig.core.kernels import kernel
from rig.core.units.atmosphere import air_density
from rig.core.units.constants import GRAVITY

# Of the static pressure: the value of this frame, and how the unit's vertical velocity is off.
PRESSURE: Final = np.dtype(
    [
        ("pressure", "f8"),  # Pa
        ("drift", "f8"),  # m/s, downwards
        ("frames", "i8"),  # of memory; 0: not begun
        ("astray", "i8"),  # frames in a row off an agreed vote
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("last", "f8", (len(INERTIAL),)),  # of the last frame
        ("smooth", "f8", (3,)),  # its rates behind the filter, and their change a second
        ("slope", "f8", (3,)),
        ("angles", "f8", (3,)),  # roll, pitch, heading of this frame
        ("flow", "f8", (2,)),  # angle of attack and sideslip of its velocity
        ("strapdown", strapdown.STATE),
        ("pressure", PRESSURE),
        ("started", "u1"),
    ],
    align=True,
)
_FIRST_S: Final = 0.2  # the memory begins as if so much had been seen: the vote's noise is small against a drift
_FAR: Final = 300.0  # Pa; a vote that far off is not learned from
_NORTH: Final = INERTIAL.index("velocity_north_m_s")
_DOWN: Final = INERTIAL.index("velocity_down_m_s")
_F: Final = INERTIAL.index("specific_force_forward_m_s2")


@kernel
def rate(i, unit, lead_frames, u):
    """Return rate i of INERTIAL [rad/s], led by ``lead_frames`` to make up for the unit's lag."""
    return unit[i] + lead_frames * (unit[i] - u["last"][i])


@kernel
def follow(unit, share, rate_hz, u):
    """Filter the unit's rates to first order, and find their slopes; begin again after what was no number."""
    smooth, slope = u["smooth"], u["slope"]
    for i in range(3):
        move = share * (unit[i] - smooth[i])
        if u["started"] == 0 or not math.isfinite(move):
            smooth[i], slope[i] = unit[i], 0.0
        else:
            smooth[i], slope[i] = smooth[i] + move, move * rate_hz


@kernel
def load_factor(axis, unit, lead_frames, place, u):
    """Return the load factor at the accelerometers, g: axis 0 forward, 1 right, 2 down (minus the normal one).

    f + w_dot x r + w x (w x r), f of the unit at the centre of gravity, led as its rates; place : r (3,), m
    """
    x, y, z, slope = place[0], place[1], place[2], u["slope"]
    p, q, r = unit[0], unit[1], unit[2]
    along, square = p * x + q * y + r * z, p * p + q * q + r * r
    force = rate(_F + axis, unit, lead_frames, u)
    if axis == 0:
        force += slope[1] * z - slope[2] * y + p * along - x * square
    elif axis == 1:
        force += slope[2] * x - slope[0] * z + q * along - y * square
    else:
        force += slope[0] * y - slope[1] * x + r * along - z * square
    return force / GRAVITY


@kernel
def flow_angles(unit, angles, out):
    """Write the direction of the unit's velocity in body axes [rad] into ``out`` (2,): angle of attack and sideslip.

    Wind is its error.  angles : roll, pitch, heading of the unit
    """
    north, east, down = unit[_NORTH], unit[_NORTH + 1], unit[_DOWN]
    sin_phi, cos_phi = math.sin(angles[0]), math.cos(angles[0])
    sin_theta, cos_theta = math.sin(angles[1]), math.cos(angles[1])
    sin_psi, cos_psi = math.sin(angles[2]), math.cos(angles[2])
    level, aside = north * cos_psi + east * sin_psi, east * cos_psi - north * sin_psi
    forward = level * cos_theta - down * sin_theta
    below = level * sin_theta + down * cos_theta
    right, under = aside * cos_phi + below * sin_phi, below * cos_phi - aside * sin_phi
    out[0] = math.atan2(under, forward)
    out[1] = math.atan2(right, math.sqrt(forward * forward + under * under))


@kernel
def static_pressure(unit, votes, agreed, rate_hz, u):
    """Return the static pressure [Pa]: p' = rho g (v_down - drift), from the last agreed vote on.

    While the vote is agreed, value and drift follow it with the memory of strapdown.py; otherwise they run free.
    rho is that of the standard atmosphere at p.  votes : (S,) of the last frame; NaN while nothing is known
    """
    e, down, last, vote = u["pressure"], unit[_DOWN], u["last"][_DOWN], votes[sig.P_S]
    known = (agreed >> sig.P_S) & 1 != 0
    if not math.isfinite(down) or (e["frames"] == 0 and not known):
        e["frames"] = 0
        return math.nan
    if e["frames"] == 0:
        e["pressure"], e["drift"] = vote, 0.0
        e["frames"], e["astray"] = frames_of(_FIRST_S, rate_hz), 0
        return e["pressure"]
    off = vote - e["pressure"]
    weight = air_density(e["pressure"]) * GRAVITY
    far = known and abs(off) > _FAR
    if known and not far:
        n = min(e["frames"], frames_of(LONG_S, rate_hz))
        e["pressure"] += level_gain(n) * off
        e["drift"] -= slope_gain(n) * rate_hz * off / weight
        e["frames"] += 1
    e["astray"] = e["astray"] + 1 if far else 0
    if e["astray"] >= frames_of(ASTRAY_S, rate_hz):
        e["frames"] = 0
    e["pressure"] += weight / rate_hz * (0.5 * (down + last) - e["drift"])
    return e["pressure"]


@kernel
def keep(unit, u):
    """Remember this frame's sample for the next."""
    for i in range(len(unit)):
        u["last"][i] = unit[i]
    u["started"] = 1
