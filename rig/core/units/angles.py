"""Angles on the circle and the ends of a sensor's range, for sensors, faults, voter and assessments.

The short way round has one formula, once for kernels (``wrap``) and once for arrays (``short_way``), to the same bits.
"""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.core.kernels import kernel
from rig.core.units.constants import TWO_PI

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_] | bool


@kernel
def wrap(angle):
    """Return ``angle`` (rad) the short way round, in [-pi, pi); NaN stays NaN."""
    return within_a_turn(angle + pi) - pi


@kernel
def within_a_turn(angle):
    """Return ``angle % TWO_PI``; an angle within a turn is returned without the slow division."""
    return angle if 0.0 <= angle < TWO_PI else angle % TWO_PI


@kernel
def difference(a, b, wraps):
    """Return ``a - b``; the short way round when the signal ``wraps`` (rad)."""
    return wrap(a - b) if wraps != 0 else a - b


@kernel
def limit(x, low, high, wraps):
    """Return ``x`` within [low, high]: an angle goes round the circle, anything else saturates; NaN stays NaN."""
    if wraps != 0:
        return within_a_turn(x - low) + low
    if x < low:
        return low
    if x > high:
        return high
    return x


def short_way(angles: Floats, half_turn: float = pi) -> Floats:
    """Return ``angles`` the short way round, in [-half_turn, half_turn); NaN where there is no number."""
    with np.errstate(invalid="ignore"):
        return (angles + half_turn) % (2.0 * half_turn) - half_turn


def differences(a: Floats, b: Floats, wraps: Flags) -> Floats:
    """Return ``a - b``, the short way round where the signal ``wraps``: one flag, or one for each of the last axis."""
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.asarray(a - b)
    if np.any(wraps):
        apart[..., wraps] = short_way(apart[..., wraps])
    return apart


def near(angles: Floats, base: Floats) -> Floats:
    """Return ``angles`` (rad) moved by whole turns to within half a turn of ``base``."""
    with np.errstate(invalid="ignore"):
        return base + (angles - base + pi) % TWO_PI - pi


def unwrapped(angles: Floats) -> Floats:
    """Return ``angles`` (n,), rad, without jumps of a turn; the first number and NaN stay."""
    out, finite = angles.copy(), np.isfinite(angles)
    out[finite] = np.unwrap(angles[finite])
    return out


def step_sizes(series: Floats, wraps: bool) -> Floats:
    """Return the distance of each of ``series`` (n,) from the one before, (n - 1,); the short way round for angles."""
    moved = np.abs(np.diff(series))
    return np.minimum(moved, TWO_PI - moved) if wraps else moved


def unwrap(samples: Floats, vote: Floats, wraps: NDArray[np.uint8]) -> Floats:
    """Return ``samples`` with those of angles moved by whole turns to within half a turn of the last vote.

    They can then be compared, sorted and averaged as plain numbers.
    samples : (S, 4), NaN for a sample that is not used; wraps : (S,) flags
    vote : (S,) the last votes, NaN before the first vote: then the first sample of the signal that is a number
    """
    first = samples[np.arange(len(samples)), np.argmax(np.isfinite(samples), axis=1)]
    base = np.where(np.isfinite(vote), vote, first)[:, None]
    return np.where(wraps[:, None] != 0, near(samples, base), samples)


def into_range(values: Floats, low: Floats | float, high: Floats | float, wraps: NDArray[Any] | bool) -> Floats:
    """Return ``values`` within the sensors' ranges: angles by whole turns, all others saturated."""
    with np.errstate(invalid="ignore"):
        return np.where(wraps, (values - low) % TWO_PI + low, np.clip(values, low, high))
