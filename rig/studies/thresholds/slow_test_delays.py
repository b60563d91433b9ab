"""Compute the time until the slow-fault tests isolate one channel, by the size of its fault, from their limits.

Noise is left out.  A constant offset of z units of noise moves a leaky mean over T frames to z (1 - (1 - 1/T)^n) in n
frames.  It reaches the limit L in

    n = ln(1 - L / min(z, s)) / ln(1 - 1/T),    s = L / (1 - exp(-B / T))

frames, and never if z <= L.  s is the largest step that counts; B is BURST for the fast mean, REMEMBERED for the
others: no offset is isolated before BURST frames.
The mean of squares begins at 1: z^2 and its own limit take their places.  The earliest of the three counts.
The median follows the faulty channel by a share of the offset, up to a middle of healthy ones (FOLLOW).  The
allowance for motion (slow_tests.py) is taken off the residual.
A drift is learned as a bias while every share is small, so its means are moved frame by frame.
Added: docs/explanation/decisions.md, 'Slow-fault tests'.
"""

from __future__ import annotations

from math import ceil, inf, log, sqrt
from typing import Final, NamedTuple

from rig.computer.redundancy.slow_halves import BURST, LEARNING, SLOW, reached
from rig.computer.redundancy.slow_tests import CALM, FAST, FOLLOWS, REMEMBERED, SIGMAS, SQUARE
from rig.computer.redundancy.slow_tests_config import BIAS, SlowTests
from rig.world.sensors.data_sheet import DataSheet

OFFSETS: Final = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)  # thresholds
DRIFT: Final = 0.1  # thresholds a second
MOST_S: Final = 60.0  # of a drift
KNOWN: Final = 2.0 * LEARNING  # frames learned: the limits are at their least
# By channels in use: what the median follows of a small offset of one channel, and, in units of the noise, of any: of
# 4 the mean of the middle and the largest of three normal samples, of 3 the larger of two.
FOLLOW: Final = {4: (0.25, 0.423), 3: (1.0 / 3.0, 0.564)}


class Delays(NamedTuple):
    """Delay to isolation, s, None: not isolated; of each of OFFSETS, and of a drift by DRIFT.

    smallest : offset that is isolated, thresholds; None: none is
    """

    offsets: tuple[float | None, ...]
    drift: float | None
    smallest: float | None


class Limits(NamedTuple):
    """Limits of the two means in units of the noise, and of the mean of squares in units of its variance, less 1."""

    fast: float
    slow: float
    square: float


def limits(tests: SlowTests, sheet: float = 1.0) -> Limits:
    """Return the limits once KNOWN frames are learned; sheet : noise of the data sheet, units of that of the data."""
    means, squares = SIGMAS * tests.factor, SIGMAS * (tests.squares_factor or tests.factor)
    fast, slow = (means * sqrt(0.5 / frames + 1.0 / KNOWN) for frames in (FAST, SLOW))
    healthy = max(1.0, sheet * sheet - FOLLOWS)
    return Limits(fast, slow, healthy * (1.0 + squares * sqrt(1.0 / SQUARE + 2.0 / KNOWN)) - 1.0)


def delays(
    tests: SlowTests,
    sheet: DataSheet,
    threshold: float,
    noise: float,
    fitted: tuple[int, float],
    allowance: float = 0.0,
) -> Delays:
    """Return the delays of a signal; of two channels there are none: halves of them need the reference.

    threshold; noise : standard deviation that the channels have in common; allowance : for motion; unit of the signal
    fitted : how many channels, and frames a second
    """
    channels, rate_hz = fitted
    if channels not in FOLLOW:
        return Delays((None,) * len(OFFSETS), None, None)
    at, unit, allowed = limits(tests, sheet.noise_std / noise), threshold / noise, allowance / noise
    offsets = [offset_frames(size * unit, at, channels, allowed) for size in OFFSETS]
    most = round(MOST_S * rate_hz)
    bound = BIAS * sheet.bias_tolerance / noise
    drift = drift_frames(DRIFT * unit / rate_hz, bound, at, channels, most, allowed)
    in_s = [None if frames is None else frames / rate_hz for frames in (*offsets, drift)]
    return Delays(tuple(in_s[:-1]), in_s[-1], smallest(at, channels, allowed) / unit)


def beside_median(z: float, channels: int) -> float:
    """Return what is left of an offset ``z`` of one channel beside the median, which follows it; units of noise."""
    share, most = FOLLOW[channels]
    return z - min(share * z, most)


def smallest(at: Limits, channels: int, allowed: float = 0.0) -> float:
    """Return the constant offset above which one is isolated; it and ``allowed`` in units of noise."""
    share, most = FOLLOW[channels]
    r = min(at.fast, at.slow, sqrt(at.square)) + allowed
    return min(r / (1.0 - share), r + most)


def offset_frames(z: float, at: Limits, channels: int, allowed: float = 0.0) -> int | None:
    """Return after how many frames a constant offset of ``z`` units of noise is isolated; None: it is not."""
    r, steps = max(beside_median(z, channels) - allowed, 0.0), _steps(at)
    fast, slow = _frames(r, at.fast, steps.fast, FAST), _frames(r, at.slow, steps.slow, SLOW)
    soonest = min(fast, slow, _frames(r * r, at.square, steps.square, SQUARE))
    return None if soonest == inf else int(soonest)


def _steps(at: Limits) -> Limits:
    """Return the largest step of each mean that counts."""
    return Limits(
        at.fast / reached(FAST, BURST), at.slow / reached(SLOW, REMEMBERED), at.square / reached(SQUARE, REMEMBERED)
    )


def _frames(constant: float, limit: float, step: float, frames: float) -> float:
    """Return when a leaky mean of a constant, of which at most ``step`` counts, exceeds its limit."""
    counted = min(constant, step)
    return ceil(log(1.0 - limit / counted) / log(1.0 - 1.0 / frames)) if counted > limit else inf


def drift_frames(rate: float, bound: float, at: Limits, channels: int, most: int, allowed: float = 0.0) -> int | None:
    """Return after how many frames a drift of ``rate`` units of noise a frame is isolated; None: not within ``most``.

    bound : of a bias, units of noise, as ``allowed``
    """
    fast = slow = square = bias = 0.0
    steps = _steps(at)
    for n in range(1, most + 1):
        whole = beside_median(rate * n - bias, channels)
        r = max(whole - allowed, 0.0)
        fast += (min(r, steps.fast) - fast) / FAST
        slow += (min(r, steps.slow) - slow) / SLOW
        square += (min(r * r, steps.square) - square) / SQUARE
        share = max(fast / at.fast, slow / at.slow, square / at.square)
        if share > 1.0:
            return n
        if share < CALM:
            bias = min(bias + min(whole, steps.fast + allowed) / LEARNING, bound)
    return None
