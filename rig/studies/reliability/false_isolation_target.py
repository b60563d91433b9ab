"""Estimate the false-isolation rate of a signal at given thresholds, and find the threshold that meets a target."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import exp, log
from typing import Final

from rig.core.errors import BadInput
from rig.core.frame import INDEX
from rig.core.text import choices, quoted
from rig.scenario.scenario import load
from rig.studies.reliability.false_isolation_bench import Bench
from rig.studies.reliability.false_isolations import Effort, FalseIsolationRate, estimate, estimate_or_bound
from rig.studies.reliability.one_signal import recording

CLOSE: Final = 0.01  # of the threshold: the search ends
NEAR: Final = 0.5  # of the target: the search also ends
AIM: Final = 0.8  # of the target
STEP: Final = 0.8  # from a threshold to the next lower one, until one does not meet the target
MOST_STEPS: Final = 40
MOST_TRIES: Final = 12
_LEAST: Final = 1e-30  # a smaller rate is replaced by this one before its logarithm is taken

Benches = Callable[[float], Bench]  # by threshold


def run(
    signal: str,
    scenario: str,
    sets: Sequence[str],
    thresholds: Sequence[float] | None,
    persistence: int | None,
    target: float | None,
    seed: int,
    effort: Effort,
) -> tuple[list[FalseIsolationRate], FalseIsolationRate | None]:
    """Return the rates at ``thresholds``, by default the scenario's, and the rate at the one that meets ``target``.

    The truth is that of the healthy flight of the scenario, with the overrides ``sets``.
    BadInput: an unknown signal, a wrong scenario or setting, too few sets of errors, a target that no threshold meets.
    """
    if signal not in INDEX:
        raise BadInput(f"unknown signal {quoted(signal)}, {choices(signal, INDEX, 'rig signals')}")
    flown = load(scenario, sets)
    recorded = recording(flown, flown.seed)
    key = f"redundancy.signals.{signal}"
    more = [] if persistence is None else [f"{key}.persistence={persistence}"]
    own = Bench(load(scenario, [*sets, *more]), signal, recorded)

    def at(threshold: float) -> Bench:
        return Bench(load(scenario, [*sets, *more, *own.sets(threshold)]), signal, recorded)

    benches = [own] if thresholds is None else [at(threshold) for threshold in thresholds]
    rates = (
        []
        if target is not None and thresholds is None
        else [estimate_or_bound(bench, seed, effort) for bench in benches]
    )
    chosen = None if target is None else threshold_for(at, own.threshold, target, seed, effort)
    return rates, chosen


def shown(rate: FalseIsolationRate) -> float:
    """Return the bound for a channel's flight hour: upper end of the rate, plus isolations in the first frames."""
    return rate.high + rate.at_start


def threshold_for(benches: Benches, begin: float, target: float, seed: int, effort: Effort) -> FalseIsolationRate:
    """Return the rate at the lowest threshold found that meets ``target``, per hour of one channel.

    An estimate from too few sets of errors guides the search, but does not meet a target.
    begin : threshold with which to begin
    BadInput: no threshold meets the target, or every threshold does.
    """
    met, missed, tried = _bracket(benches, begin, target, seed, effort)
    for _ in range(MOST_TRIES):
        near = met.few is None and met.per_hour is not None and shown(met) >= NEAR * target
        if near or met.threshold - missed.threshold <= CLOSE * met.threshold:
            break
        tried.append(estimate(benches(_between(missed, met, target)), seed, effort))
        met, missed = (tried[-1], missed) if shown(tried[-1]) <= target else (met, tried[-1])
    return min((each for each in tried if each.few is None and shown(each) <= target), key=lambda each: each.threshold)


def _bracket(
    benches: Benches, begin: float, target: float, seed: int, effort: Effort
) -> tuple[FalseIsolationRate, FalseIsolationRate, list[FalseIsolationRate]]:
    """Return a threshold that meets the target, the next lower one that does not, and all tried thresholds."""
    tried = [estimate(benches(begin), seed, effort)]
    up = shown(tried[0]) > target or tried[0].few is not None
    for _ in range(MOST_STEPS):
        last = tried[-1]
        tried.append(estimate(benches(last.threshold / STEP if up else last.threshold * STEP), seed, effort))
        meets = shown(tried[-1]) <= target
        if up and meets and tried[-1].few is None:
            return tried[-1], last, tried
        if not up and not meets:
            return last, tried[-1], tried
    verb = "does not meet" if up else "still meets"
    raise BadInput(f"--target {target:g}: a threshold of {tried[-1].threshold:g} {verb} it")


def _between(missed: FalseIsolationRate, met: FalseIsolationRate, target: float) -> float:
    """Return a threshold between two, by the logarithms of their bounds, not too close to either."""
    high, low = (log(max(shown(each), _LEAST)) for each in (missed, met))
    share = (high - log(AIM * target)) / (high - low) if high > low else 0.5
    share = min(max(share, 0.1), 0.9)
    return exp((1.0 - share) * log(missed.threshold) + share * log(met.threshold))
