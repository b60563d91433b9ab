"""Angles on the circle and the ends of a sensor's range: what sensors, faults and voter share."""

from __future__ import annotations

from math import pi
from typing import Final

from rig.frame import TWO_PI
from rig.kernels import kernel

TURN: Final = TWO_PI


@kernel
def wrap(angle):
    """``angle`` (rad) the short way round, in [-pi, pi); NaN stays NaN."""
    return (angle + pi) % TURN - pi


@kernel
def difference(a, b, wraps):
    """``a - b``; the short way round when the signal ``wraps`` (rad)."""
    return wrap(a - b) if wraps != 0 else a - b


@kernel
def limit(x, low, high, wraps):
    """``x`` within [low, high]: an angle goes round the circle, anything else saturates; NaN stays NaN."""
    if wraps != 0:
        return (x - low) % TURN + low
    if x < low:
        return low
    if x > high:
        return high
    return x
