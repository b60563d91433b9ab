"""Misalignment and gains of triads: a 3 x 3 matrix for each recorder, by least squares against the median.

Channel c of the three signals of a triad is one recorder.  After delays and offsets are taken off, A of a recorder with
samples v(k) is what makes the sum over the stretch of |A v(k) - m(k)|^2 least, m(k) the medians of all recorders, axis
by axis.  Both are means of SMOOTHED rows: motion is slow, and vibration that recorders do not share would shrink A.
An axis without a sample takes part in the others with the median, and stays without one itself.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from rig.core.errors import BadInput
from rig.log.recordings.mirrored import SMOOTHED
from rig.log.recordings.offset_moves import median_of
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import RecordedSignal

GAINS: Final = (0.9, 1.1)  # smallest and largest stretch of a vector that is taken for misalignment
_MIN_ROWS: Final = 256


@dataclass(frozen=True, slots=True)
class Matrix:
    """Matrix of one recorder; ``applied`` is False if it was refused."""

    triad: str
    channel: int
    applied: bool
    matrix: list[list[float]]
    rotation_deg: float  # angle of the rotation in it
    gains: list[float]  # singular values, largest first
    rms_before: float  # of |v - m| in the stretch, unit of the signals
    rms_after: float
    mirrored: bool = False  # left-handed axes, which no mounting has: told, and never taken off


def take_off_matrices(
    recording: Recording,
    settings: Mapping[str, RecordedSignal],
    triads: Mapping[str, Sequence[str]],
    stretch: tuple[float, float],
    mirrored: Mapping[str, Collection[int]] | None = None,
) -> tuple[Recording, list[Matrix]]:
    """Return the recording with every recorder turned and scaled, and the matrices found within ``stretch``.

    mirrored : channels of each triad that are known to be mirrored (mirrored.py)

    BadInput: no triads, or axes with different numbers of channels.
    """
    if not triads:
        raise BadInput("--align-matrix needs [triads] in CONFIG: three signals that are the axes of one vector")
    start, end = np.searchsorted(recording.time_s, stretch[0]), np.searchsorted(recording.time_s, stretch[1], "right")
    signals, fits = dict(recording.signals), []
    for triad, axes in triads.items():
        counts = [len(recording.signals[axis].channels) for axis in axes]
        if len(set(counts)) > 1:
            raise BadInput(f"--align-matrix: triad {triad}: its signals have {counts} channels, which must be alike")
        x = np.array([recording.signals[axis].channels for axis in axes])  # (3, C, n)
        low, high = np.array([settings[axis].limits for axis in axes]).T[..., None, None]
        x[~((x >= low) & (x <= high))] = np.nan
        center = np.nan_to_num([median_of(columns) for columns in x])  # (3, n) over the recorders
        for c in range(counts[0]):
            known = c + 1 in (mirrored or {}).get(triad, ())
            fit = _fit(triad, c + 1, x[:, c, start:end], center[:, start:end], known)
            shown = settings[axes[0]].shown
            fits.append(replace(fit, rms_before=shown(fit.rms_before), rms_after=shown(fit.rms_after)))
            if fit.applied:
                there = np.isfinite(x[:, c])
                x[:, c] = np.where(there, np.array(fit.matrix) @ np.where(there, x[:, c], center), np.nan)
        for i, axis in enumerate(axes):
            turned = [fit.applied for fit in fits if fit.triad == triad]
            signals[axis] = _samples(recording.signals[axis], x[i], settings[axis], turned)
    return replace(recording, signals=signals), fits


def _fit(triad: str, channel: int, v: Floats, m: Floats, mirrored: bool = False) -> Matrix:
    """v, m : (3, rows) of the stretch."""
    rows = np.isfinite(v).all(axis=0)
    v, m = v[:, rows], m[:, rows]
    before = _rms(v - m)
    if v.shape[1] < _MIN_ROWS or np.linalg.matrix_rank(v) < 3:
        return Matrix(triad, channel, False, np.eye(3).tolist(), 0.0, [1.0, 1.0, 1.0], before, before, mirrored)
    a = np.linalg.lstsq(_smooth(v).T, _smooth(m).T, rcond=None)[0].T
    left, gains, right = np.linalg.svd(a)
    rotation = left @ right
    plausible = GAINS[0] <= gains[-1] and gains[0] <= GAINS[1]
    mirrored |= bool(np.linalg.det(rotation) < 0 and plausible)
    if mirrored:
        return Matrix(triad, channel, False, a.tolist(), 0.0, gains.tolist(), before, before, True)
    angle = float(np.degrees(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0))))
    return Matrix(triad, channel, bool(plausible), a.tolist(), angle, gains.tolist(), before, _rms(a @ v - m))


def _smooth(x: Floats) -> Floats:
    """Means of SMOOTHED rows that follow each other; x : (3, rows)."""
    sums = np.cumsum(np.concatenate([np.zeros((len(x), 1)), x], axis=1), axis=1)
    return (sums[:, SMOOTHED:] - sums[:, :-SMOOTHED]) / SMOOTHED


def _rms(off: Floats) -> float:
    return float(np.sqrt((off**2).sum(axis=0).mean())) if off.size else 0.0


def _samples(before: Samples, columns: Floats, settings: RecordedSignal, turned: Sequence[bool]) -> Samples:
    low, high = settings.limits
    pairs = zip(before.channels, columns, turned, strict=True)
    return replace(before, channels=[np.clip(new, low, high) if is_turned else old for old, new, is_turned in pairs])
