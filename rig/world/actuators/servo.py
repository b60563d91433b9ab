"""The servo of one surface: four coils on one spool, one ram, two hydraulic systems.

    current  c_i = limit(gain (asked_i - sensed_i), 1),  gain = 1 / (lag_s rate_limit);  none behind an open valve
    spool    x'' = w^2 (u - x) - 2 z w x',  u = limit(sum of c_i / 4, 1)
    ram      rate_limit x (pressure 1 + pressure 2) / 2, from stop to stop

A small step is followed as by the lag of the same ``lag_s``, a large one with the same rate.  Without a channel or
without pressure the ram is bypassed: it goes to ``bypass_rad`` with the time constant ``bypass_s``.

Spool and its integral are moved by the exact transition of a sub-step, the currents held within it; sub-steps are at
most LONGEST_SUBSTEP_S, whole ones to a step of the plant.  (A semi-implicit step is unstable from w h = 1.25 on.)
"""

from __future__ import annotations

import cmath
from math import ceil, exp
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.kernels import clamp, kernel

LONGEST_SUBSTEP_S: Final = 1e-3

# One surface, as built or as its designers hold it to be.
SERVO: Final = np.dtype(
    [
        ("gain", "f8"),  # full current a rad
        ("rate_limit", "f8"),  # rad/s with both pressures
        ("substep_s", "f8"),
        ("low", "f8"),  # stops, rad
        ("high", "f8"),
        ("bypass_rad", "f8"),
        ("bypass_share", "f8"),  # of the way there, in a sub-step
        # Spool, its speed, and the spool's integral after a sub-step: rows; of spool, speed and input before it.
        ("transition", "f8", (9,)),
    ],
    align=True,
)
SPOOL, SPEED, RAM = range(3)  # what moves of a servo or of a model of one: 1, 1/s, rad


def substeps(step_s: float) -> int:
    """Return how many sub-steps a step of the plant has."""
    return max(1, ceil(step_s / LONGEST_SUBSTEP_S - 1e-9))


def transition(spool_rad_s: float, damping: float, substep_s: float) -> NDArray[np.float64]:
    """Return (3, 3): spool, speed and integral of the spool after a sub-step, of spool, speed and input before it.

    In closed form: a matrix exponential wakes the threads of the linear algebra, which then spin for 50 ms.
    """
    w, z, t = spool_rad_s, damping, substep_s
    q = cmath.sqrt(z * z - 1.0) * w
    fade, wave = exp(-z * w * t), cmath.cosh(q * t).real
    slope = (cmath.sinh(q * t) / q).real if q else t
    x = np.array([fade * (wave + z * w * slope), fade * slope, 0.0])
    v = np.array([-fade * slope * w * w, fade * (wave - z * w * slope), 0.0])
    x[2], v[2] = 1.0 - x[0], -v[0]
    # The spool's equation, integrated once.
    integral = np.array([0.0, 0.0, t]) - (v - [0.0, 1.0, 0.0]) / (w * w) - 2.0 * z / w * (x - [1.0, 0.0, 0.0])
    return np.array([x, v, integral])


@kernel
def asked_current(asked, sensed, servo):
    """Return the current for a position asked for and the one sensed, rad; 1 is the full current."""
    return clamp(servo["gain"] * (asked - sensed), -1.0, 1.0)


@kernel
def move_spool(moves, transition, u):
    """Move the spool of ``moves`` (3,) by a sub-step under the input ``u``; return its integral over it, s."""
    x, v, u = moves[SPOOL], moves[SPEED], clamp(u, -1.0, 1.0)
    moves[SPOOL] = transition[0] * x + transition[1] * v + transition[2] * u
    moves[SPEED] = transition[3] * x + transition[4] * v + transition[5] * u
    return transition[6] * x + transition[7] * v + transition[8] * u


@kernel
def move_ram(moves, servo, opened, flow):
    """Move the ram by a sub-step: by the flow, or where there is none towards its bypassed place.

    opened : the spool's integral, s;  flow : share of that of both pressures
    """
    if flow > 0.0:
        moves[RAM] = clamp(moves[RAM] + servo["rate_limit"] * flow * opened, servo["low"], servo["high"])
    else:
        moves[RAM] += servo["bypass_share"] * (servo["bypass_rad"] - moves[RAM])
