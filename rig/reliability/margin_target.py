"""The threshold at which false isolations are as rare as a target asks."""

from __future__ import annotations

from collections.abc import Callable
from math import exp, log
from typing import Final

from rig.errors import BadInput
from rig.reliability.margin import Effort, Margin, estimate
from rig.reliability.margin_bench import Bench

CLOSE: Final = 0.01  # of the threshold: the search ends
NEAR: Final = 0.5  # of the target: it ends too
AIM: Final = 0.8  # of the target
STEP: Final = 0.8  # from a threshold to the next lower one, until one does not meet the target
MOST_STEPS: Final = 40
MOST_TRIES: Final = 12
_LEAST: Final = 1e-30  # whose logarithm is taken in place of a smaller one's

Benches = Callable[[float], Bench]  # by threshold


def shown(found: Margin) -> float:
    """What is shown of a flight hour of a channel: the upper end of the rate, and failures in the first frames."""
    return found.high + found.at_start


def threshold_for(benches: Benches, begin: float, target: float, seed: int, effort: Effort) -> Margin:
    """The margin at the lowest threshold that was found to meet ``target``, per hour of one channel.

    begin : threshold with which to begin
    BadInput: none meets it, or all do.
    """
    met, missed = _bracket(benches, begin, target, seed, effort)
    for _ in range(MOST_TRIES):
        close = met.threshold - missed.threshold <= CLOSE * met.threshold
        if close or (met.per_hour is not None and shown(met) >= NEAR * target):
            break
        found = estimate(benches(_between(missed, met, target)), seed, effort)
        if _meets(found, target):
            met = found
        else:
            missed = found
    return met


def _bracket(benches: Benches, begin: float, target: float, seed: int, effort: Effort) -> tuple[Margin, Margin]:
    """A threshold that meets the target, and the next lower one that does not."""
    found = estimate(benches(begin), seed, effort)
    up = not _meets(found, target)
    for _ in range(MOST_STEPS):
        other = estimate(benches(found.threshold / STEP if up else found.threshold * STEP), seed, effort)
        if _meets(other, target) == up:
            return (other, found) if up else (found, other)
        found = other
    said = "does not meet" if up else "still meets"
    raise BadInput(f"--target {target:g}: a threshold of {found.threshold:g} {said} it")


def _meets(found: Margin, target: float) -> bool:
    """Whether a threshold is shown to meet the target; a degenerate estimate shows nothing."""
    return found.few is None and shown(found) <= target


def _between(missed: Margin, met: Margin, target: float) -> float:
    """A threshold between, by the logarithms of what they show, not too close to either."""
    high, low = (log(max(shown(one), _LEAST)) for one in (missed, met))
    share = (high - log(AIM * target)) / (high - low) if high > low else 0.5
    share = min(max(share, 0.1), 0.9)
    return exp((1.0 - share) * log(missed.threshold) + share * log(met.threshold))
