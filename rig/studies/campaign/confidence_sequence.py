"""An interval of a proportion that holds at every moment, however often it is looked at, for a wanted half-width.

    L(q, p) = (q / p)^k ((1 - q) / (1 - p))^(n - k)      k of n trials are true

Under the proportion p, L is a nonnegative martingale of mean 1: it ever reaches 1 / a with a probability of at most a
(Ville, Etude critique de la notion de collectif, 1939; as a test: Wald, Annals of Mathematical Statistics 16, 1945).
The interval holds every p for which neither q = p + h nor q = p - h has reached 2 / (1 - confidence); h is the
half-width that is wanted, at which the interval is narrowest.  Both likelihood ratios are monotone in p, so that an
end is the root of one.  The trials may have different proportions p1, p2, ...: the interval then holds their mean at
every moment at which the mean is the same, because log(1 + p (e^x - 1)) is concave in p.
"""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, inf, log
from typing import Final

from rig.studies.campaign.statistics import CONFIDENCE, Rate, proportion

_HALVINGS: Final = 50  # of the range of an end
_MOST_TRIALS: Final = 1 << 40


def sequence_interval(count: int, trials: int, half_width: float, confidence: float = CONFIDENCE) -> Rate:
    """Return the share ``count`` of ``trials`` with its interval; half_width : above 0 and below 0.5."""
    if trials == 0:
        return Rate(0, 0, None, None, None)
    low, high = _ends(float(count), trials, half_width, confidence)
    return Rate(count, trials, count / trials, low, high)


def _ends(count: float, trials: float, half_width: float, confidence: float) -> tuple[float, float]:
    low = _least_kept(count, trials, half_width, log(2.0 / (1.0 - confidence)))
    return low, 1.0 - _least_kept(trials - count, trials, half_width, log(2.0 / (1.0 - confidence)))


def _least_kept(count: float, trials: float, step: float, bound: float) -> float:
    """Return the least proportion that its ratio with a proportion ``step`` above does not exclude."""
    below, above = 0.0, 1.0 - step
    for _ in range(_HALVINGS):
        middle = 0.5 * (below + above)
        if log_ratio(count, trials, middle + step, middle) < bound:
            above = middle
        else:
            below = middle
    return below if count else 0.0


def log_ratio(count: float, trials: float, q: float, p: float) -> float:
    """Return log L of ``count`` of ``trials``; q, p : within 0 and 1."""
    others = trials - count
    if (count and q <= 0.0) or (others and q >= 1.0):
        return -inf
    return (count * log(q / p) if count else 0.0) + (others * log((1.0 - q) / (1.0 - p)) if others else 0.0)


def is_known(rate: Rate, half_width: float) -> bool:
    """Return True if the interval of a rate is as narrow as wanted."""
    return rate.low is not None and rate.high is not None and (rate.high - rate.low) / 2.0 <= half_width


def sequence_trials(half_width: float, share: float = 0.5, confidence: float = CONFIDENCE) -> int:
    """Return how many trials the interval takes to be as narrow as wanted, at a ``share`` of true ones.

    The most, of all shares, are at 0.5; the fewest at 0 and 1.
    """

    def is_narrow(trials: int) -> bool:
        low, high = _ends(share * trials, trials, half_width, confidence)
        return (high - low) / 2.0 <= half_width

    return _first(is_narrow)


def fixed_trials(half_width: float, share: float = 0.5, confidence: float = CONFIDENCE) -> int:
    """Return how many trials, a number chosen before, an exact interval (Clopper-Pearson) takes for the half-width."""

    def is_narrow(trials: int) -> bool:
        return is_known(proportion(round(share * trials), trials, confidence), half_width)

    return _first(is_narrow)


def _first(is_narrow: Callable[[int], bool]) -> int:
    """Return the least number of trials that is narrow, by doubling and then halving."""
    above = 1
    while not is_narrow(above) and above < _MOST_TRIALS:
        above *= 2
    below = above // 2
    while above - below > 1:
        middle = ceil((above + below) / 2)
        below, above = (below, middle) if is_narrow(middle) else (middle, above)
    return above
