"""Angles on the circle and the ends of a sensor's range: what sensors, faults and voter share.

``unwrap`` and ``into_range`` do the same for whole arrays, for a manager written in plain numpy.
"""

from __future__ import annotations

from math import pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

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


def unwrap(samples: NDArray[np.float64], vote: NDArray[np.float64], wraps: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return ``samples`` with those of angles moved by whole turns to within half a turn of the last vote.

    So they can be compared, sorted and averaged as plain numbers.
    samples : (S, 4), NaN where a sample is not to be used; wraps : (S,) flags
    vote : (S,) the last votes, NaN before the first: then the first sample of the signal that is a number
    """
    first = samples[np.arange(len(samples)), np.argmax(np.isfinite(samples), axis=1)]
    base = np.where(np.isfinite(vote), vote, first)[:, None]
    near = base + (samples - base + pi) % TURN - pi
    return np.where(wraps[:, None] != 0, near, samples)


def into_range(
    votes: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], wraps: NDArray[np.uint8]
) -> NDArray[np.float64]:
    """Return ``votes`` within the sensors' ranges: angles by whole turns, all others saturated.  All are (S,)."""
    return np.where(wraps != 0, (votes - low) % TURN + low, np.clip(votes, low, high))
