"""Exact intervals, the smallest detectable magnitude, and a paired comparison, on plain numbers.

Sources: Clopper and Pearson, Biometrika 26 (1934); Garwood, Biometrika 28 (1936), for Poisson counts; McNemar,
Psychometrika 12 (1947), in its exact conditional form; Thompson, Annals of Mathematical Statistics 7 (1936), for a
median.  tests/test_campaign_statistics.py holds them to published figures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import exp, log
from typing import Any, Final, NamedTuple

import numpy as np
import scipy  # its parts are imported when first used: most of a campaign's run needs none
from numpy.typing import NDArray

CONFIDENCE: Final = 0.95
_TAIL: Final = 0.025  # of an interval of that
_STEEPEST: Final = log(1e3)  # slopes of the logistic fit, natural logarithm, per unit of ln magnitude
_FLATTEST: Final = log(0.1)
_FARTHEST: Final = log(1e3)  # an interval's end is looked for within this factor of the magnitudes tried


@dataclass(frozen=True, slots=True)
class Rate:
    """A share ``count`` of ``of`` with its interval: a probability for trials, a rate an hour for hours."""

    count: int
    of: float
    value: float | None  # None: nothing was tried
    low: float | None
    high: float | None


def proportion(count: int, trials: int, confidence: float = CONFIDENCE) -> Rate:
    """Return a probability with its Clopper-Pearson interval."""
    if trials == 0:
        return Rate(0, 0, None, None, None)
    interval = scipy.stats.binomtest(count, trials).proportion_ci(confidence_level=confidence, method="exact")
    return Rate(count, trials, count / trials, float(interval.low), float(interval.high))


def at_most(count: int, trials: int, confidence: float = CONFIDENCE) -> float:
    """Return the exact one-sided upper bound of a probability (Clopper and Pearson, Biometrika 26, 1934)."""
    return 1.0 if count == trials else float(scipy.stats.beta.ppf(confidence, count + 1, trials - count))


def jeffreys(count: int, trials: int) -> tuple[float, float]:
    """Return Jeffreys' 95 % interval of a probability, with 0 and 1 included at the ends."""
    of, others = count + 0.5, trials - count + 0.5
    low = 0.0 if count == 0 else float(scipy.stats.beta.ppf(_TAIL, of, others))
    return low, 1.0 if count == trials else float(scipy.stats.beta.ppf(1.0 - _TAIL, of, others))


def poisson(count: int, hours: float, confidence: float = CONFIDENCE) -> Rate:
    """Return a rate an hour with its exact Poisson interval."""
    if hours <= 0:
        return Rate(count, 0.0, None, None, None)
    tail = (1.0 - confidence) / 2.0
    low = scipy.stats.chi2.ppf(tail, 2 * count) / 2.0 if count else 0.0
    high = scipy.stats.chi2.ppf(1.0 - tail, 2 * count + 2) / 2.0
    return Rate(count, hours, count / hours, float(low / hours), float(high / hours))


@dataclass(frozen=True, slots=True)
class Magnitude:
    """The magnitude that is detected with a given probability; an end is None if the data do not bound it."""

    probability: float
    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class Detectable:
    """A logistic fit of detection over the logarithm of the magnitude."""

    trials: int
    detected: int
    slope: float | None  # per unit of ln magnitude; None when the trials are separated
    separated: bool  # all magnitudes above some value were detected, and none below: only the gap is known
    magnitudes: list[Magnitude]


def detectable(
    magnitudes: NDArray[np.float64],
    detected: NDArray[np.bool_],
    probabilities: tuple[float, ...] = (0.5, 0.99),
    confidence: float = CONFIDENCE,
) -> Detectable | None:
    """Fit the smallest detectable magnitude to trials (n,): magnitudes above 0, and whether each was detected.

        logit P(detected) = slope (ln magnitude - ln m50)

    The fit has maximum likelihood, rising slopes only; intervals are by profile likelihood.  If the trials are
    separated, the likelihood has no maximum, and the value is the middle of the gap (in the logarithm).  None if all
    trials were detected, or none.
    """
    x, n, k = _grouped(magnitudes, detected)
    if k.sum() in (0, n.sum()) or len(x) < 2:
        return None
    fit = _Logistic(x, n, k)
    separated = float(x[k > 0].min()) >= float(x[k < n].max())
    estimates = [_magnitude(fit, p, separated, confidence) for p in probabilities]
    slope = None if separated else exp(fit.best[1])
    return Detectable(int(n.sum()), int(k.sum()), slope, separated, estimates)


def _grouped(magnitudes: NDArray[np.float64], detected: NDArray[np.bool_]) -> tuple[NDArray[np.float64], ...]:
    """Return ln of each different magnitude, trials and detections there."""
    usable = np.isfinite(magnitudes) & (magnitudes > 0)
    x, index = np.unique(np.log(magnitudes[usable]), return_inverse=True)
    n, k = np.zeros(len(x)), np.zeros(len(x))
    np.add.at(n, index, 1.0)
    np.add.at(k, index, detected[usable].astype(float))
    return x, n, k


class _Logistic:
    """The likelihood of (x, ln slope), with x where a given probability is reached."""

    def __init__(self, x: NDArray[np.float64], n: NDArray[np.float64], k: NDArray[np.float64]) -> None:
        self.x, self.n, self.k = x, n, k
        self.middle = (float(x[k > 0].min()) + float(x[k < n].max())) / 2.0  # of the gap between separated trials
        best = _least(lambda m: self.profile(m, 0.0), np.linspace(x[0], x[-1], 41), xatol=1e-9)
        self.best = float(best.x), float(self._slope(float(best.x), 0.0).x)  # ln m50, ln slope: most likely

    def loss(self, at: float, steepness: float, shift: float) -> float:
        """Return minus the log likelihood; ``shift`` is the logit of the probability that is reached at ``at``."""
        z = exp(steepness) * (self.x - at) + shift
        return float(-(self.k * scipy.special.log_expit(z) + (self.n - self.k) * scipy.special.log_expit(-z)).sum())

    def profile(self, at: float, shift: float) -> float:
        """Return the least loss over all slopes."""
        return float(self._slope(at, shift).fun)

    def _slope(self, at: float, shift: float) -> Any:
        return _least(lambda s: self.loss(at, s, shift), np.linspace(_FLATTEST, _STEEPEST, 25))

    @property
    def least(self) -> float:
        """Return the loss of the best fit."""
        return self.loss(*self.best, 0.0)


def _least(function: Callable[[float], float], grid: NDArray[np.float64], **options: float) -> Any:
    """Return the minimum of a function that may have several, after a coarse search over ``grid``."""
    near = int(np.argmin([function(at) for at in grid]))
    bounds = (grid[max(near - 1, 0)], grid[min(near + 1, len(grid) - 1)])
    return scipy.optimize.minimize_scalar(function, bounds=bounds, method="bounded", options=options)


def _magnitude(fit: _Logistic, probability: float, separated: bool, confidence: float) -> Magnitude:
    shift = float(scipy.special.logit(probability))
    best = fit.middle if separated else fit.best[0] + shift / exp(fit.best[1])
    limit = fit.least + float(scipy.stats.chi2.ppf(confidence, 1)) / 2.0

    def above(at: float) -> float:
        return fit.profile(at, shift) - limit

    low = _crossing(above, best, best - _FARTHEST)
    high = _crossing(above, best, best + _FARTHEST)
    ends = [None if end is None else exp(end) for end in (low, high)]
    return Magnitude(probability, exp(best), ends[0], ends[1])


def _crossing(above: Callable[[float], float], inside: float, outside: float) -> float | None:
    """Return where the profile leaves the interval between ``inside`` and ``outside``; None when it does not."""
    step, last = (outside - inside) / 200.0, inside
    for i in range(1, 201):
        at = inside + i * step
        if above(at) > 0.0:
            root: Any = scipy.optimize.brentq(above, last, at, xtol=1e-9) if above(last) <= 0.0 else last
            return float(root)
        last = at
    return None


@dataclass(frozen=True, slots=True)
class McNemar:
    """The pairs of runs with different outcomes under two managers, and the probability of this by chance."""

    both: int
    only_first: int
    only_second: int
    neither: int
    p_value: float  # two-sided, exact
    odds_ratio: float | None  # only first to only second; None when it is not finite


def mcnemar(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> McNemar:
    """Compare two outcomes (n,) of the same trials in exact pairs."""
    b, c = int((first & ~second).sum()), int((~first & second).sum())
    p = 1.0 if b + c == 0 else float(scipy.stats.binomtest(b, b + c, 0.5).pvalue)
    both, neither = int((first & second).sum()), int((~first & ~second).sum())
    return McNemar(both, b, c, neither, p, b / c if c else None)


class Difference(NamedTuple):
    """A difference of two shares, and its interval."""

    value: float
    low: float
    high: float


def paired_difference(
    first: NDArray[np.bool_], second: NDArray[np.bool_], confidence: float = CONFIDENCE
) -> Difference:
    """Return the share of the first outcome (n,) minus that of the second on the same trials.

    The interval is Wald's with half a trial more in each of the four cells; Agresti and Min, Statistics in Medicine
    24 (2005), section 2.
    """
    n, b, c = len(first), int((first & ~second).sum()), int((~first & second).sum())
    value, apart, whole = (b - c) / n, (b - c) / (n + 2.0), n + 2.0
    spread = float(np.sqrt(max((b + c + 1.0) - (b - c) ** 2 / whole, 0.0)) / whole)
    half = float(scipy.stats.norm.ppf((1.0 + confidence) / 2.0)) * spread
    return Difference(value, max(apart - half, -1.0), min(apart + half, 1.0))


def clustered_difference(
    first: NDArray[np.bool_], second: NDArray[np.bool_], cluster: NDArray[np.int64], confidence: float = CONFIDENCE
) -> tuple[Difference, float]:
    """Return the same difference of trials of which those of a ``cluster`` (n,) may be alike, and its p-value.

    The variance is that of the clusters' sums, and its t distribution has a degree of freedom less than there are
    clusters; Liang and Zeger, Biometrika 73 (1986), section 3.  One cluster bounds nothing.  The interval is no
    narrower, and the probability no lower, than of trials that are independent.
    """
    alone, chance = paired_difference(first, second, confidence), mcnemar(first, second).p_value
    _, place = np.unique(cluster, return_inverse=True)
    count = int(place.max()) + 1
    if count < 2:
        return Difference(alone.value, -1.0, 1.0), 1.0
    apart = np.bincount(place, weights=first.astype(float) - second - alone.value)
    spread = float(np.sqrt(count / (count - 1.0) * (apart @ apart))) / len(first)
    of = scipy.stats.t(count - 1)
    half = float(of.ppf((1.0 + confidence) / 2.0)) * spread
    low, high = max(min(alone.low, alone.value - half), -1.0), min(max(alone.high, alone.value + half), 1.0)
    p = 2.0 * float(of.sf(abs(alone.value) / spread)) if spread > 0.0 else 0.0
    return Difference(alone.value, low, high), max(p, chance)


class Median(NamedTuple):
    """A median and its interval; None if there are too few values for an interval."""

    value: float
    low: float | None
    high: float | None


def median_interval(values: NDArray[np.float64], confidence: float = CONFIDENCE) -> Median:
    """Return the median of values (n,), n above 0, with the interval between two of them; at 95 % from six values on.

    The interval does not depend on the distribution: the number of n values below the median is that of n coin tosses.
    """
    ordered = np.sort(values)
    first = int(scipy.stats.binom.ppf((1.0 - confidence) / 2.0, len(ordered), 0.5))
    ends = (float(ordered[first - 1]), float(ordered[-first])) if first > 0 else (None, None)
    return Median(float(np.median(ordered)), *ends)
