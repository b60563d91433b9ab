"""Constant delays between channels.

Delay of a pair of channels a, b: the lag d (frames, not whole) at which

    cost(d) = mean square of (h * a)(k + d) - (h * b)(k), its mean removed

is least.  The filter h weighs each frequency by how coherent the two channels are in it (the generalised
cross-correlation of Knapp and Carter, 1976), so noise and vibration that they do not share have no weight.
The pairs that correlate best then tie the channels to each other; a bad channel correlates with none.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import oaconvolve

from rig.log.recordings.stamps import Floats

MAX_DELAY: Final = 32  # frames
CORRELATED: Final = 0.5  # least correlation with another channel, once aligned, of a channel that is trusted
_MARGIN: Final = 8  # lags beyond MAX_DELAY, for the interpolation of the cost
_FINE: Final = np.linspace(-1.0, 1.0, 201)  # frames
_FLOOR: Final = 0.1  # of the mean cross spectrum: whitens no further than this
_SEGMENT: Final = 1024  # rows of the longest segment of a spectrum


def delays(columns: list[Floats]) -> tuple[Floats, NDArray[np.bool_], Floats]:
    """Delay (C,) in frames of each channel against the one in the middle, which are tied, best correlation of each."""
    pairs, correlations = _pairs(_without_spikes(columns))
    delay, tied = _tied(pairs, correlations)
    return delay, tied, correlations.max(axis=1)


def bridged(column: Floats) -> Floats:
    """Return a channel with straight lines across the samples it lacks; all NaN when it has none."""
    good = np.isfinite(column)
    if good.all() or not good.any():
        return column
    at = np.arange(len(column))
    return np.interp(at, at[good], column[good])


def _without_spikes(columns: list[Floats]) -> list[Floats]:
    """Centred channels without what is beyond the range that most of them have (and a quarter more)."""
    centred = np.array([column - np.median(column) for column in columns])
    whole = centred[np.isfinite(centred).all(axis=1)]
    if len(whole) == 0:
        return list(centred)
    low, high = np.median(whole.min(axis=1)), np.median(whole.max(axis=1))
    margin = 0.25 * (high - low)
    inside = (centred >= low - margin) & (centred <= high + margin)
    return [bridged(column) for column in np.where(inside, centred, np.nan)]


def _pairs(columns: list[Floats]) -> tuple[Floats, Floats]:
    """Delay of channel i against channel j, and how the two correlate without it; (C, C) each."""
    count = len(columns)
    delays, correlations = np.zeros((count, count)), np.zeros((count, count))
    for i in range(count):
        for j in range(i):
            delay, correlation = pair(columns[i], columns[j])
            delays[i, j], delays[j, i] = delay, -delay
            correlations[i, j] = correlations[j, i] = correlation
    return delays, correlations


def pair(a: Floats, b: Floats) -> tuple[float, float]:
    """Return the delay of ``a`` against ``b`` in frames, up to MAX_DELAY, and their correlation without it.

    No delay and no correlation when one of them is constant or has no samples.
    """
    if not all(np.isfinite(x).all() and np.ptp(x) > 0 for x in (a, b)):
        return 0.0, 0.0
    delay = 0.0
    for _ in range(2):  # the second time the coherence is that of channels which are nearly aligned
        delay = min(max(_least(_costs(a, b, round(delay))), -MAX_DELAY), MAX_DELAY)
    at = np.arange(MAX_DELAY, len(a) - MAX_DELAY - 1)
    return delay, _correlation(interpolated(a, at + delay), b[at]) if abs(delay) < MAX_DELAY else 0.0


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    power = float(a @ a) * float(b @ b)
    return float(a @ b) / power**0.5 if power > 0 else 0.0


def _filter(a: Floats, b: Floats, lag: int, segment: int) -> Floats:
    """Return a symmetric filter (segment - 1,) whose squared gain is the weight of each frequency."""
    window = np.hanning(segment + 1)[:-1]
    starts = np.arange(MAX_DELAY, len(a) - segment - MAX_DELAY + 1, segment // 2)

    def spectra(x: Floats, shift: int) -> NDArray[np.complex128]:
        rows = np.lib.stride_tricks.sliding_window_view(x, segment)[starts + shift]
        return np.fft.rfft((rows - rows.mean(axis=1, keepdims=True)) * window, axis=1)

    of_a, of_b = spectra(a, lag), spectra(b, 0)
    cross = np.abs((of_a * of_b.conj()).sum(axis=0))
    power = (np.abs(of_a) ** 2).sum(axis=0) * (np.abs(of_b) ** 2).sum(axis=0)
    independent = 0.75 * len(starts) + 0.25  # segments overlap by half
    chance = 1.0 / independent  # coherence that noise has by chance
    coherence = np.divide(cross**2, power, out=np.zeros_like(cross), where=power > 0)
    coherence = np.clip((coherence - chance) / (1.0 - chance + 1e-9), 0.0, 0.99)
    weight = coherence / (1.0 - coherence) / (cross + _FLOOR * cross.mean())
    weight[0] = weight[1]
    if not weight.any():
        weight[:] = 1.0
    return np.fft.fftshift(np.fft.irfft(np.sqrt(weight), segment))[1:] * window[1:]


def _costs(a: Floats, b: Floats, near: int) -> Floats:
    """cost(d) at whole lags from -(MAX_DELAY + _MARGIN), every lag over the same rows of ``b``.

    near : the delay about which the coherence is measured
    """
    segment = min(_SEGMENT, 1 << int(np.log2(len(a) // 8)))
    h = _filter(a, b, near, segment)
    a, b = (oaconvolve(x, h, mode="same")[segment // 4 : -segment // 4] for x in (a, b))
    most = MAX_DELAY + _MARGIN
    rows = len(a) - 2 * most
    fixed = b[most:-most] - b[most:-most].mean()
    sums = np.cumsum(np.concatenate([[0.0], a]))
    squares = np.cumsum(np.concatenate([[0.0], a * a]))
    lag = np.arange(2 * most + 1)
    cross = np.array([a[start : start + rows] @ fixed for start in lag])
    mean = (sums[lag + rows] - sums[lag]) / rows
    moving = squares[lag + rows] - squares[lag] - rows * mean * mean
    return (moving + fixed @ fixed - 2.0 * cross) / rows


def _least(costs: Floats) -> float:
    """Return the lag of the least cost; a spline of fifth degree between whole lags."""
    lags = np.arange(-(MAX_DELAY + _MARGIN), MAX_DELAY + _MARGIN + 1)
    inner = slice(_MARGIN, -_MARGIN)
    coarse = lags[inner][int(np.argmin(costs[inner]))]
    spline = make_interp_spline(lags, costs, k=5)
    fine = coarse + _FINE
    return float(fine[int(np.argmin(spline(fine)))])


def _tied(delays: Floats, correlations: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Delays (C,) against the channel in the middle, and which channels (C,) are tied to each other.

    Channels are tied one by one, from the pair that correlates best, each by its best pair with one that is tied
    already; no further when the best is below CORRELATED.
    """
    delay, tied = np.zeros(len(delays)), np.zeros(len(delays), bool)
    first, second = np.unravel_index(int(np.argmax(correlations)), correlations.shape)
    if correlations[first, second] < CORRELATED:
        return delay, tied
    tied[first] = True
    while not tied.all():
        ties = np.where(np.outer(tied, ~tied), correlations, -1.0)
        old, new = np.unravel_index(int(np.argmax(ties)), ties.shape)
        if ties[old, new] < CORRELATED:
            break
        delay[new] = delay[old] + delays[new, old]
        tied[new] = True
    delay[tied] -= np.sort(delay[tied])[(int(tied.sum()) - 1) // 2]
    return delay, tied


def interpolated(column: Floats, at: NDArray[np.floating[Any]]) -> Floats:
    """Return ``column`` at fractional rows, interpolated linearly; NaN next to a NaN."""
    row = np.floor(at).astype(np.int64)
    share = at - row
    after = np.minimum(row + 1, len(column) - 1)
    return np.where(share > 0, column[row] * (1.0 - share) + column[after] * share, column[row])
