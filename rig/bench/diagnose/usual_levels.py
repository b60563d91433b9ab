"""The constant differences of instances from the first row on, and the difference from where on a fault can be told.

Threshold: max(floor, 8 sigma), sigma of the healthy difference of half-second means, from the 80 % quantile of its
changes, so that a fault in a fifth of the log does not raise it.  Motion raises the difference that counts,
because gains, alignment and delays differ between healthy instances; most where it exceeds what is usual in the log.
"""

from __future__ import annotations

from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from rig.bench.diagnose.findings import Convention, Findings
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.diagnose.smoothing import smoothed
from rig.log.recordings.stamps import Floats

SIGMAS: Final = 8.0
_QUANTILE: Final = 0.8
_OF_CHANGES: Final = 1.81  # that quantile of the change between two normal values, in their sigmas
_TOLD: Final = 2.0  # floors
_STAYS: Final = 0.3  # of the rows
_GAIN: Final = (0.02, 0.1)  # gain or misalignment (rad) of usual motion, and more of what exceeds it
_LATE_S: Final = (0.01, 0.03)  # delay that may be left, as well; twice that if delays could not be measured
_USUAL: Final = 0.8  # quantile of usual motion, which the threshold covers


class Levels(NamedTuple):
    """Thresholds (axes,) and what motion adds to them (n,); the smallest difference that could be told (axes,)."""

    thresholds: Floats
    allowed: Floats
    smallest: Floats


def center(x: Floats) -> Floats:
    """Return the middle (..., n) of the channels of x (..., C, n); of two the first."""
    return np.median(x, axis=-2) if x.shape[-2] > 2 else x[..., 0, :]


def take_off_offsets(group: Group, x: Floats, rows: int, left_deg: float, timed: bool, found: Findings) -> Levels:
    """Take constant differences off ``x`` (axes, C, n), without NaN, and return the levels; ``rows`` of half a second.

    left_deg : misalignment that was not taken off; timed : delays were measured
    """
    means = smoothed(x, rows)
    thresholds = np.array(
        [_threshold(axis, rows, own.threshold) for axis, own in zip(means, group.settings.values(), strict=True)]
    )
    for a, signal in enumerate(group.signals):
        off = means[a] - center(means[a])
        for c, instance in enumerate(group.instances):
            offset = _offset(off[c], float(thresholds[a]))
            x[a, c] -= offset
            if abs(offset) > _TOLD * group.settings[signal].threshold:
                text = f"{signal} differs by {group.shown(offset)} from the first row on: bias, calibration or fault"
                value = float(group.first.shown(offset))
                found.conventions.append(
                    Convention(group.name, instance, "offset", value, text, len(group.instances) > 2, True, signal)
                )
    allowed = _allowed(group, smoothed(x, rows), rows, left_deg, timed)
    usual = float(np.median(allowed))
    return Levels(thresholds, allowed, thresholds + usual)


def _threshold(means: Floats, rows: int, floor: float) -> float:
    """Return the threshold of one axis by the means (C, n)."""
    apart = [np.abs(np.diff((means[i] - means[j])[::rows])) for i, j in combinations(range(len(means)), 2)]
    sigma = float(np.median([np.quantile(changed, _QUANTILE) / _OF_CHANGES for changed in apart]))
    return max(floor, float(f"{SIGMAS * sigma:.3g}"))


def _offset(off: Floats, threshold: float) -> float:
    """Return the constant part of a difference (n,): that of the first fifth if most of the log agrees, or if it stays.

    A fault in the first fifth alone, or from there on, leaves the smaller of both ends.
    """
    fifth = max(1, len(off) // 5)
    early, whole, late = (float(np.median(part)) for part in (off[:fifth], off, off[-fifth:]))
    if abs(early - whole) <= threshold / 2:
        return whole
    stays = float((np.abs(off - early) <= threshold / 2).mean())
    return early if stays > _STAYS else min((early, late), key=abs)


def _allowed(group: Group, means: Floats, rows: int, left_deg: float, timed: bool) -> Floats:
    """Return (n,) what healthy instances may differ by in motion: by gain, misalignment and delay."""
    moved = np.sqrt(((means - np.median(means, axis=-1, keepdims=True)) ** 2).sum(axis=0))
    size = np.median(moved, axis=0) if len(moved) > 2 else moved.min(axis=0)
    middle = np.median(means, axis=1) if len(moved) > 2 else means[:, 0]
    rate = np.zeros(len(size))
    lag = min(max(rows, 1), len(size) - 1)
    change = np.sqrt(((middle[:, lag:] - middle[:, :-lag]) ** 2).sum(axis=0)) * group.rate_hz / lag
    rate[lag // 2 : lag // 2 + len(change)] = change
    late = 1.0 if timed else 2.0
    misaligned = float(np.sin(np.radians(left_deg))) * size
    return _more(size, _GAIN) + late * _more(rate, _LATE_S) + misaligned


def _more(motion: Floats, shares: tuple[float, float]) -> Floats:
    """Return (n,) a share of motion (n,), and another of what exceeds usual motion."""
    usual = float(np.quantile(motion, _USUAL))
    return shares[0] * motion + shares[1] * np.maximum(motion - usual, 0.0)
