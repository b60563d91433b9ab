"""Means, spreads, changes and runs of rows, which every step of a diagnosis uses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from rig.log.recordings.stamps import Floats

Flags = NDArray[np.bool_]
_SPREAD: float = 1.4826  # of the median deviation of a normal distribution, to its standard deviation
_CLIP: float = 4.0  # spreads: a step in one channel is no motion
_HUM: int = 4  # frequencies of the transform on each side of a strong one, which the window mixes


def smoothed(x: Floats, rows: int) -> Floats:
    """Return the mean of ``rows`` rows, or one more, about each row of x (..., n); the ends are repeated."""
    return x if rows < 2 else uniform_filter1d(x, rows | 1, axis=-1, mode="nearest")


def spread(x: Floats) -> float:
    """Return the median deviation of x from its median, as a standard deviation; above 0."""
    return float(_SPREAD * np.median(np.abs(x - np.median(x)))) + 1e-12


def changes(x: Floats, lag: int) -> Floats:
    """Return the changes (..., n - lag) of x (..., n) within ``lag`` rows, clipped: steps are small."""
    made = x[..., lag:] - x[..., :-lag]
    limit = _CLIP * _SPREAD * np.median(np.abs(made), axis=-1, keepdims=True) + 1e-12
    return np.clip(made, -limit, limit)


def without_hum(x: Floats) -> Floats:
    """Return x (..., C, n), weighted by a Hann window, without the two strongest frequencies of all channels together.

    The window keeps a strong frequency from leaking into others.
    """
    spectrum = np.fft.rfft(x * np.hanning(x.shape[-1]), axis=-1)
    for _ in range(2):
        power = (np.abs(spectrum.reshape(-1, *spectrum.shape[-2:])) ** 2).sum(axis=0)
        k = int(np.argmax((power / (power.sum(axis=-1, keepdims=True) + 1e-30)).sum(axis=0)))
        spectrum[..., max(k - _HUM, 0) : k + _HUM + 1] = 0.0
    return np.fft.irfft(spectrum, x.shape[-1], axis=-1)


def runs(flags: Flags) -> Iterator[tuple[int, int]]:
    """Yield the first row and the row after the last of each run of True in flags (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.view(np.int8), [0]])))
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def widened(flags: Flags, rows: int) -> Flags:
    """Return flags (..., n), True within ``rows`` rows of a True."""
    return smoothed(flags.astype(np.float64), 2 * rows + 1) > 1e-9


def held(x: Floats, rows: int) -> Floats:
    """Return (..., n) the least of x over the last ``rows`` rows; 0 while there are fewer."""
    return minimum_filter1d(x, rows, axis=-1, mode="constant", cval=0.0, origin=(rows - 1) // 2)
