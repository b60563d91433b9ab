"""The scalar series whose exceedances are false isolations, for all thresholds at once.

D_c(k) is the distance of channel c to the nearest other channel in frame k.  The manager "cross-channel" counts
channel c in frame k at threshold T exactly when D_c(k) > T (compare.py: agreement is ``<=``, one partner is enough).
It isolates the channel after ``persistence`` such frames in a row.  With

    M(k) = the largest over c of the least D_c over the last ``persistence`` frames
    G(k) = the least middle gap of the four ranked samples over the last ``split_persistence`` frames

a recording whose middle gap never exceeds T has its first isolation at T in the first frame with M > T, and none if M
never exceeds T.  If the middle gap exceeds T, there are splits (2:2 and 1:1:1:1 need it).  The counts freeze during a
split and for as long after it (persistence.py), which moves single isolations in time.  A split of
``split_persistence`` frames may be settled against healthy channels, for which G must exceed T.
A sample that is not comparable always counts: its distance is infinite.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from rig.core.frame import CHANNELS
from rig.core.units.angles import near

Floats = NDArray[np.float64]
DUPLEX: Final = 2
CHUNK: Final = 16_384  # frames, so that what is made of them stays in the cache


class Monitored(NamedTuple):
    """The quantity compared with one threshold: ``channels`` in use, ``persistence`` and ``splits`` in frames."""

    channels: tuple[int, ...]  # counted from 0
    persistence: int
    in_split: int


def in_use(fitted: int, level: int) -> list[tuple[int, ...]]:
    """Return each choice of channels, out of the ``fitted``, that may be in use at ``level``."""
    return list(combinations(range(fitted), level))


def exceeded(samples: Floats, monitored: Monitored, wraps: bool = False) -> Floats:
    """Return (n,) the threshold that frame k exceeds: every smaller threshold isolates a channel.

    samples : (C, n), unit of the signal, NaN if a sample is not comparable; angles that ``wraps`` in rad
    """
    channels, *frames = monitored
    return exceeded_each(samples[list(channels)], [(frames[0], frames[1])], wraps)[0]


def exceeded_each(samples: Floats, frames: Sequence[tuple[int, int]], wraps: bool = False) -> list[Floats]:
    """Return the same for all channels (C, n) and several persistences, (persistence, in_split) each."""
    n, lead = samples.shape[1], max(max(pair) for pair in frames) - 1
    series = [np.empty(n) for _ in frames]
    for start in range(0, n, CHUNK):
        first, end = max(start - lead, 0), min(start + CHUNK, n)
        for out, part in zip(series, _exceeded(samples[:, first:end], frames, wraps), strict=True):
            out[start:end] = part[start - first :]
    return series


def _exceeded(samples: Floats, frames: Sequence[tuple[int, int]], wraps: bool) -> Iterator[Floats]:
    chosen = near_first(samples) if wraps else samples
    if len(chosen) == DUPLEX:
        # 0 if one of them is not comparable, as it is isolated without a split
        apart = np.nan_to_num(np.abs(chosen[0] - chosen[1]), nan=0.0, posinf=np.inf)
        yield from (sliding_minimum(apart, in_split) for _, in_split in frames)
        return
    of_each = nearest(chosen)
    gap = middle_gap(chosen) if len(chosen) == CHANNELS else np.min(of_each, axis=0)
    for persistence, in_split in frames:
        largest = sliding_minimum(of_each[0], persistence)
        for distance in of_each[1:]:
            np.maximum(largest, sliding_minimum(distance, persistence), out=largest)
        if len(chosen) == CHANNELS or in_split < persistence:
            np.maximum(largest, sliding_minimum(gap, in_split), out=largest)
        yield largest


def near_first(samples: Floats) -> Floats:
    """Unwrap angles (C, n), rad, to within half a turn of the first channel with a sample in their frame."""
    base = samples[0].copy()
    for column in samples[1:]:
        np.copyto(base, column, where=np.isnan(base))
    return near(samples, base)


def nearest(samples: Floats) -> list[Floats]:
    """Return D_c of each channel, (n,) each: infinite if a sample is not comparable, 0 without a partner."""
    count, present = len(samples), ~np.isnan(samples)
    apart = {pair: np.abs(samples[pair[0]] - samples[pair[1]]) for pair in combinations(range(count), 2)}
    distances: list[Floats] = []
    for c in range(count):
        distance = apart[min(c, c - 1), max(c, c - 1)] if c else apart[0, 1]
        for other in range(count):
            if other != c:
                distance = np.fmin(distance, apart[min(c, other), max(c, other)])
        if not present.all():
            distance = np.where(present[c], np.nan_to_num(distance, nan=0.0, posinf=np.inf), np.inf)
        distances.append(distance)
    return distances


def middle_two(samples: Floats) -> tuple[Floats, Floats]:
    """Return the second and the third of four ranked samples (4, n)."""
    a, b, c, d = samples
    return np.maximum(np.minimum(a, b), np.minimum(c, d)), np.minimum(np.maximum(a, b), np.maximum(c, d))


def middle_gap(samples: Floats) -> Floats:
    """Return the third minus the second of four ranked samples (4, n); 0 if one is not comparable."""
    second, third = middle_two(samples)
    return np.nan_to_num(np.abs(third - second), nan=0.0, posinf=np.inf)


def sliding_minimum(series: Floats, frames: int) -> Floats:
    """Return (n,) the smallest of the last ``frames`` values, all at least 0; 0 while there are fewer."""
    return minimum_filter1d(series, frames, mode="constant", cval=0.0, origin=(frames - 1) // 2)


def invalid_runs(samples: Floats, frames: int) -> Sequence[int]:
    """Return the channels, from 0, with ``frames`` incomparable samples in a row: no threshold keeps them."""
    lost = np.isnan(samples).astype(np.float64)
    return [c for c, flags in enumerate(lost) if sliding_minimum(flags, frames).any()]
