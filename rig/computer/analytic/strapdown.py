"""Attitude of the inertial unit alone: its rates integrated, levelled by its accelerometers and its velocity.

    q' = q (w - drift) / 2                 q : quaternion from body axes to north-east-down
    s  = v' - (0, 0, g)                    the specific force that the change of velocity asks for
    e  = R f x s / max(f f, g g)           the small rotation that turns the measured one into it

In a coordinated turn s is the direction of the turn's bank, and elsewhere it is exact as well: no side force, no
acceleration disturbs it.  The level components of e correct attitude and gyro drift with the memory of
``LEVEL_S``.  Around the vertical the heading's agreed votes do it, with ``LONG_S``; while they are not agreed, nothing
does: what the gyros drift by has been learned to some 1e-5 rad/s within seconds, and the ground track differs from the
heading by another angle after every turn in wind.  The level never corrects the yaw gyro's drift: in a bank it would
find it faulty for errors of the accelerometers.  Roll and pitch angle read no vote of theirs but the first.

The memory is a straight line through the agreed past, of growing and then of fading memory:

    x += g off;   drift -= h off / dt     g = 2 (2 n + 1) / ((n + 1)(n + 2)),   h = 6 / ((n + 1)(n + 2))

``off`` is the agreed value less x.  With n the frames seen this is the least-squares line through all of them; n stops
at a bound, and what is older fades.

Source: Mahony et al. 2008, Nonlinear complementary filters on SO(3), with the acceleration taken from the velocity;
Brookner, Tracking and Kalman Filtering Made Easy, section 1.2.10, for the memory.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.core.frame import INERTIAL, sig
from rig.core.kernels import kernel
from rig.core.units.angles import wrap
from rig.core.units.constants import GRAVITY, TWO_PI

STATE: Final = np.dtype(
    [
        ("q", "f8", (4,)),
        ("drift", "f8", (3,)),  # of the unit's gyros, rad/s
        ("angles", "f8", (3,)),  # roll, pitch, heading of the last frame
        ("frames", "i8"),  # of memory; 0: not begun
        ("astray", "i8"),  # frames in a row off an agreed vote
        ("oriented", "u1"),  # whether the heading is known
    ],
    align=True,
)
LONG_S: Final = 300.0  # memory of what is learned of the signal itself: a fault is settled long before
ASTRAY_S: Final = 30.0  # off an agreed vote for so long, a memory begins again
LEVEL_S: Final = 60.0  # memory of what level is
# The memory begins as if so much had been seen: of level, where one frame's change of velocity is mostly noise, and of
# the heading, where a vote says more.
_FIRST_S: Final = 5.0
_FIRST_HEADING_S: Final = 0.2
_FAR: Final = 0.2  # rad; a vote that far off is not learned from
_WORST_DRIFT: Final = 0.005  # rad/s; a unit that was wrong for a while has not taught more
_ANGLES: Final = np.array([sig.PHI, sig.THETA, sig.PSI])
_V: Final = INERTIAL.index("velocity_north_m_s")
_F: Final = INERTIAL.index("specific_force_forward_m_s2")


@kernel
def level_gain(frames):
    """Return g, the share of ``off`` that the value takes."""
    return 2.0 * (2.0 * frames + 1.0) / ((frames + 1.0) * (frames + 2.0))


@kernel
def slope_gain(frames):
    """Return h, the share of ``off`` that the slope takes in a frame."""
    return 6.0 / ((frames + 1.0) * (frames + 2.0))


@kernel
def frames_of(seconds, rate_hz):
    """Return ``seconds`` in frames, at least one."""
    return max(1, int(seconds * rate_hz + 0.5))


@kernel
def attitude(unit, last, votes, agreed, rate_hz, lead_s, e, out):
    """Write roll, pitch and heading [rad] of this frame into ``out`` (3,); NaN while a value of the unit is not finite.

    The heading is NaN, too, until its vote has been agreed once since then.

    unit, last : (9,) ``inertial`` of this frame and of the last one; votes : (S,) of the last frame
    agreed : a bit for each signal whose channels agreed; e : a STATE record, in place
    """
    for i in range(len(unit)):
        if not math.isfinite(unit[i]):
            e["frames"] = 0
            out[0] = out[1] = out[2] = math.nan
            return
    if e["frames"] == 0:
        begin(unit, votes, agreed, rate_hz, e)
    else:
        around = heading_off(votes, agreed, e)
        turn(unit, last, rate_hz, e)
        correct(unit, last, around, rate_hz, e)
        e["frames"] += 1
        if lost_its_way(votes, agreed, rate_hz, e) or (e["oriented"] == 0 and (agreed >> sig.PSI) & 1 != 0):
            e["frames"] = 0
    angles(unit, lead_s, e, out)


@kernel
def begin(unit, votes, agreed, rate_hz, e):
    """Align: with the agreed attitude; without one, level by the accelerometers, the heading unknown."""
    f, phi, theta, psi = unit[_F : _F + 3], votes[sig.PHI], votes[sig.THETA], votes[sig.PSI]
    if (agreed >> sig.PHI) & (agreed >> sig.THETA) & 1 == 0:
        phi, theta = math.atan2(-f[1], -f[2]), math.atan2(f[0], math.sqrt(f[1] * f[1] + f[2] * f[2]))
    e["oriented"] = (agreed >> sig.PSI) & 1
    if e["oriented"] == 0:
        psi = 0.0
    q, c, s = e["q"], math.cos(0.5 * phi), math.sin(0.5 * phi)
    c_t, s_t, c_p, s_p = math.cos(0.5 * theta), math.sin(0.5 * theta), math.cos(0.5 * psi), math.sin(0.5 * psi)
    q[0], q[1] = c * c_t * c_p + s * s_t * s_p, s * c_t * c_p - c * s_t * s_p
    q[2], q[3] = c * s_t * c_p + s * c_t * s_p, c * c_t * s_p - s * s_t * c_p
    for i in range(3):
        e["drift"][i] = 0.0
    e["frames"], e["astray"] = frames_of(_FIRST_S, rate_hz), 0


@kernel
def heading_off(votes, agreed, e):
    """Return how far the heading of the last frame is off the agreed vote [rad]; 0 without one, or far from it."""
    if (agreed >> sig.PSI) & 1 == 0:
        return 0.0
    off = wrap(votes[sig.PSI] - e["angles"][2])
    return off if abs(off) < _FAR else 0.0


@kernel
def turn(unit, last, rate_hz, e):
    """Turn q by the mean rates of the two frames, and bring its length back to one."""
    q, drift, half = e["q"], e["drift"], 0.5 / rate_hz
    x = half * (0.5 * (unit[0] + last[0]) - drift[0])
    y = half * (0.5 * (unit[1] + last[1]) - drift[1])
    z = half * (0.5 * (unit[2] + last[2]) - drift[2])
    a, b, c, d = q[0], q[1], q[2], q[3]
    q[0], q[1] = a - b * x - c * y - d * z, b + a * x + c * z - d * y
    q[2], q[3] = c + a * y + d * x - b * z, d + a * z + b * y - c * x
    long = 1.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] *= long


@kernel
def correct(unit, last, around, rate_hz, e):
    """Correct attitude and drift by the direction of the specific force, and by ``around`` [rad] about the vertical."""
    q, drift = e["q"], e["drift"]
    a, b, c, d = q[0], q[1], q[2], q[3]
    r11, r12, r13 = 1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)
    r21, r22, r23 = 2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d - a * b)
    r31, r32, r33 = 2.0 * (b * d - a * c), 2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c)
    x, y, z = unit[_F], unit[_F + 1], unit[_F + 2]
    north, east, down = r11 * x + r12 * y + r13 * z, r21 * x + r22 * y + r23 * z, r31 * x + r32 * y + r33 * z
    s_n, s_e = (unit[_V] - last[_V]) * rate_hz, (unit[_V + 1] - last[_V + 1]) * rate_hz
    s_d = (unit[_V + 2] - last[_V + 2]) * rate_hz - GRAVITY
    size = max(x * x + y * y + z * z, GRAVITY * GRAVITY)
    e_n, e_e = (east * s_d - down * s_e) / size, (down * s_n - north * s_d) / size
    level = min(e["frames"], frames_of(LEVEL_S, rate_hz))
    ahead = frames_of(_FIRST_S, rate_hz) - frames_of(_FIRST_HEADING_S, rate_hz)
    long = min(e["frames"] - ahead, frames_of(LONG_S, rate_hz))
    g = level_gain(level)
    n, m, o = 0.5 * g * e_n, 0.5 * g * e_e, 0.5 * level_gain(long) * around
    q[0], q[1] = a - n * b - m * c - o * d, b + n * a + m * d - o * c
    q[2], q[3] = c - n * d + m * a + o * b, d + n * c - m * b + o * a
    h, k = slope_gain(level) * rate_hz, slope_gain(long) * rate_hz * around
    drift[0] -= h * (r11 * e_n + r21 * e_e) + k * r31
    drift[1] -= h * (r12 * e_n + r22 * e_e) + k * r32
    drift[2] -= k * r33
    for i in range(3):
        drift[i] = min(max(drift[i], -_WORST_DRIFT), _WORST_DRIFT)


@kernel
def lost_its_way(votes, agreed, rate_hz, e):
    """Return True if an agreed vote has been far off for long enough to start the memory again."""
    off = False
    for i in range(3):
        s = _ANGLES[i]
        if (agreed >> s) & 1 != 0 and abs(wrap(votes[s] - e["angles"][i])) > _FAR:
            off = True
    e["astray"] = e["astray"] + 1 if off else 0
    return e["astray"] >= frames_of(ASTRAY_S, rate_hz)


@kernel
def angles(unit, lead_s, e, out):
    """Write the angles of q: kept, and led by ``lead_s`` at the present rates into ``out``."""
    q, kept, drift = e["q"], e["angles"], e["drift"]
    a, b, c, d = q[0], q[1], q[2], q[3]
    r31, r32, r33 = 2.0 * (b * d - a * c), 2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c)
    kept[0], kept[1] = math.atan2(r32, r33), math.asin(min(max(-r31, -1.0), 1.0))
    kept[2] = math.atan2(2.0 * (b * c + a * d), 1.0 - 2.0 * (c * c + d * d))
    p, q_, r = unit[0] - drift[0], unit[1] - drift[1], unit[2] - drift[2]
    square = max(r32 * r32 + r33 * r33, 0.01)  # of the cosine of the pitch angle
    turning = (q_ * r32 + r * r33) / square
    out[0] = wrap(kept[0] + lead_s * (p - r31 * turning))
    out[1] = kept[1] + lead_s * (q_ * r33 - r * r32) / math.sqrt(square)
    out[2] = (kept[2] + lead_s * turning) % TWO_PI if e["oriented"] != 0 else math.nan
