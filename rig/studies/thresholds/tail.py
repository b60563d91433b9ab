"""Fit the tail of a series, and compute the level that it exceeds at a given rate.

Peaks over a threshold u form clusters that are at least GAP_S apart.  The excesses of the cluster peaks follow a
generalised Pareto law (Pickands 1975), fitted by probability-weighted moments (Hosking and Wallis 1987, with plotting
position (j - 0.35) / n).  The shape is kept within [0, 0.5]: no tail is bounded, and each has a mean and a variance.
The level that b clusters an hour exceed is then, with rate = clusters an hour over u,

    u + scale / shape * ((rate / b) ** shape - 1)        shape 0: u + scale * ln(rate / b)

Coles, An Introduction to Statistical Modeling of Extreme Values (2001), sections 4.2 and 5.3.

The bootstrap estimates how far the level would move with other flights.  It draws blocks, not clusters, with
replacement: the clusters of one flight share its manoeuvres, temperature and mounting.
Efron and Tibshirani, An Introduction to the Bootstrap (1993), percentile interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.runs import cluster_starts

Floats = NDArray[np.float64]
GAP_S: Final = 0.5  # between clusters
CLUSTERS: Final = 40  # that u leaves at least
LEAST: Final = 10  # clusters from which anything can be said
MARGIN: Final = 2.0  # u is exceeded at least so many times as often as the budget
SHAPES: Final = (0.0, 0.5)
DRAWS: Final = 1000  # of the bootstrap
CONFIDENCE: Final = 0.95
_PLACE: Final = 0.35  # of the plotting position
_SAMPLE: Final = 50_000  # values that the quantiles are taken from
_SHARES: Final = 2.0 ** (np.arange(-48.0, -1.0) / 4.0)  # of frames above u, 2.4e-4 to 0.6


@dataclass(frozen=True, slots=True)
class Peaks:
    """The cluster peaks over ``u``: ``excess`` (m,) in ascending order, and the ``block`` (m,) of each."""

    u: float
    excess: Floats
    block: NDArray[np.int64]
    hours: Floats  # (B,) of each block

    @property
    def clusters(self) -> int:
        """Return the number of clusters."""
        return len(self.excess)


class Tail(NamedTuple):
    """A fitted tail as a page draws it: the clusters' peaks, the hours of the data, and the law above ``u``."""

    peaks: tuple[float, ...]  # in ascending order
    hours: float
    u: float
    scale: float
    shape: float

    def level(self, budget_per_h: float) -> float:
        """Return the level of the fit that ``budget_per_h`` clusters an hour exceed."""
        rate = np.array([len(self.peaks) / self.hours])
        return float(level(self.u, np.array([self.scale]), np.array([self.shape]), rate, budget_per_h)[0])

    def in_unit(self, shown: Callable[[float], float]) -> Tail:
        """Return the tail with amounts in another unit."""
        amounts: dict[str, Any] = {
            "u": shown(self.u),
            "scale": shown(self.scale),
            "peaks": tuple(map(shown, self.peaks)),
        }
        return self._replace(**amounts)


def fitted(over: Peaks) -> Tail:
    """Return the tail of ``over`` with its fitted law."""
    scale, shape = pareto(over.excess)
    tops = tuple((over.u + over.excess).tolist())
    return Tail(tops, float(over.hours.sum()), over.u, float(scale[0]), float(shape[0]))


def peaks(series: list[Floats], rates_hz: list[float], budget_per_h: float) -> Peaks:
    """Return the peaks of one series a block, over the largest u that leaves enough clusters.

    If no u does, return the peaks over the u that leaves most.
    """
    hours = np.array([len(block) / rate / 3600.0 for block, rate in zip(series, rates_hz, strict=True)])
    needed = max(CLUSTERS, MARGIN * budget_per_h * float(hours.sum()))
    gap = max(round(GAP_S * max(rates_hz)), 1)
    values = np.concatenate(series)
    ends = np.cumsum([len(block) for block in series])
    best: Peaks | None = None
    for u in _levels(values):
        above = np.flatnonzero(values > u)
        block = np.searchsorted(ends, above, side="right")
        over = _clusters(values[above], above + block * (gap + 1), block, gap, u, hours)
        if over.clusters >= needed:
            return over
        if best is None or over.clusters > best.clusters:
            best = over
    return best or Peaks(0.0, np.zeros(0), np.zeros(0, np.int64), hours)


def _levels(values: Floats) -> Floats:
    """Return candidates for u, the largest first: quantiles of a sample of the values."""
    some = values[:: max(len(values) // _SAMPLE, 1)]
    some = np.sort(some[np.isfinite(some)])
    ranks = np.unique(((len(some) - 1) * (1.0 - _SHARES)).astype(np.int64))
    return np.unique(some[ranks])[::-1] if len(some) else some


def _clusters(
    values: Floats, at: NDArray[np.int64], block: NDArray[np.int64], gap: int, u: float, hours: Floats
) -> Peaks:
    """Return the peaks of values above ``u`` in frames ``at``; a new cluster begins after more than ``gap`` frames."""
    if len(values) == 0:
        return Peaks(float(u), values, block, hours)
    starts = cluster_starts(at, gap)
    excess = np.maximum.reduceat(values, starts) - u
    order = np.argsort(excess, kind="stable")
    return Peaks(float(u), excess[order], block[starts][order], hours)


def pareto(excess: Floats, weights: Floats | None = None) -> tuple[Floats, Floats]:
    """Fit scale and shape of the generalised Pareto law to ascending ``excess`` (m,), by row of ``weights`` (R, m).

    weights : how often each excess occurs, whole numbers; once each if not given
    """
    w = np.ones((1, len(excess))) if weights is None else weights
    m = np.maximum(w.sum(axis=1, keepdims=True), 1.0)
    before = np.cumsum(w, axis=1) - w
    not_above = w * (1.0 + _PLACE / m) - (w * before + w * (w + 1.0) / 2.0) / m  # sum of 1 - (j - 0.35) / m
    mean = (w @ excess) / m[:, 0]
    first = (not_above @ excess) / m[:, 0]
    apart = mean - 2.0 * first
    shape = np.divide(-mean, apart, out=np.full_like(mean, -np.inf), where=apart != 0) + 2.0
    shape = np.clip(np.where(apart > 0, shape, SHAPES[1]), *SHAPES)
    return mean * (1.0 - shape), shape


def level(u: float, scale: Floats, shape: Floats, rate_per_h: Floats, budget_per_h: float) -> Floats:
    """Return the level that ``budget_per_h`` clusters an hour exceed; ``u`` if it is exceeded less often."""
    ratio = np.maximum(rate_per_h / budget_per_h, 1.0)
    small = shape < 1e-6
    power = (ratio**shape - 1.0) / np.where(small, 1.0, shape)
    return u + scale * np.where(small, np.log(ratio), power)


def point(over: Peaks, budget_per_h: float) -> tuple[float, float]:
    """Return the point estimate of the threshold for the rate, and the shape of the tail."""
    scale, shape = pareto(over.excess)
    rate = np.array([over.clusters / float(over.hours.sum())])
    return float(level(over.u, scale, shape, rate, budget_per_h)[0]), float(shape[0])


def draws(over: Peaks, budget_per_h: float, rng: np.random.Generator) -> Floats:
    """Return (DRAWS,) thresholds for the rate, one for each draw of blocks."""
    count = len(over.hours)
    times = rng.multinomial(count, np.full(count, 1.0 / count), DRAWS).astype(np.float64)
    weights = times[:, over.block]
    scale, shape = pareto(over.excess, weights)
    rate = weights.sum(axis=1) / (times @ over.hours)
    return level(over.u, scale, shape, rate, budget_per_h)


def upper(thresholds: Floats) -> float:
    """Return the value that a share CONFIDENCE of the draws does not exceed."""
    return float(np.quantile(thresholds, CONFIDENCE))
