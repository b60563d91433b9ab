"""The steps before the trials: levels from the healthy flights, transients, a second campaign, costs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final, TypeVar

import numpy as np

from rig.core.progress import tell
from rig.core.threads import on_threads
from rig.core.units.angles import differences
from rig.studies.benchmark.benchmark_trials import Told
from rig.studies.benchmark.calibration import Calibrated, calibrate
from rig.studies.benchmark.calibration_data import Healthy
from rig.studies.benchmark.entrants import Entrant, OfSignal, isolates_no_channel
from rig.studies.benchmark.healthy_flights import counted, failing, second_counts, transients

CURVE: Final = (10.0, 100.0)  # other budgets, in budgets, for delay and share over them
_TIMES: Final = 3  # that a cost is measured, of which the least counts
Pair = tuple[Entrant, OfSignal]
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Asked:
    """The options of a benchmark."""

    entrants: list[Entrant]
    budget_per_h: float
    healthy: Path
    second: Path | None = None
    trials: int = 500  # of each combination
    seed: int = 0
    flights: int = 0  # in closed loop, of all combinations; 0: none


def prepare(
    asked: Asked, signals: Sequence[OfSignal], healthy: Healthy, second: Healthy | None, workers: int
) -> dict[str, Any]:
    """Return the content of ``levels.json``, the same for any number of ``workers``.  BadInput as ``calibrate``."""
    pairs = [(entrant, signal) for signal in signals for entrant in asked.entrants]
    others = [factor * asked.budget_per_h for factor in CURVE]
    levels = list(
        _each(pairs, lambda pair: calibrate(*pair, healthy, asked.budget_per_h, others), "calibrated", workers)
    )
    made = {(each.manager, each.signal): each for each in levels}
    able = [pair for pair in pairs if not isolates_no_channel(*pair)]

    def hit(pair: Pair) -> list[dict[str, Any]]:
        entrant, signal = pair
        return list(transients(*pair, made[entrant.name, signal.name].values, healthy.flights[signal.name]))

    def again(pair: Pair) -> dict[str, Any]:
        entrant, signal = pair
        assert second is not None
        mine, before = made[entrant.name, signal.name], len(healthy.flights[signal.name])
        three = None if mine.three is None or mine.three_flights is None else (mine.three, mine.three_flights)
        return second_counts(*pair, mine.values, three, (second.flights[signal.name], second.hours, before))

    bursts = [row for rows in _each(able, hit, "transients of", workers) for row in rows]
    counts = [] if second is None else list(_each(able, again, "second campaign,", workers))
    return {
        "hours": healthy.hours,
        "levels": [asdict(each) for each in levels],
        "worst_reference": {signal.name: worst_reference(signal, healthy) for signal in signals},
        "transients": bursts,
        "second": counted(counts, asked.budget_per_h),
    }


def _each(pairs: Sequence[Pair], work: Callable[[Pair], Result], what: str, workers: int) -> Iterator[Result]:
    """Yield what ``work`` returns for each pair, in order."""
    with closing(on_threads(pairs, work, workers)) as results:
        for i, ((entrant, signal), result) in enumerate(zip(pairs, results, strict=True)):
            yield result
            tell(f"{what} {entrant.name}, {signal.name}", i, len(pairs))


def worst_reference(signal: OfSignal, healthy: Healthy) -> float:
    """Return the largest difference of a reference from the channels' median in healthy flights; 0 without one."""
    largest = 0.0
    for flight in healthy.flights[signal.name]:
        here = np.isfinite(flight.references[:, 0]) & np.isfinite(flight.samples).all(axis=1)
        if here.any():
            first = flight.samples[here, :1]
            middle = first[:, 0] + np.median(differences(flight.samples[here], first, signal.given.wraps), axis=1)
            off = differences(flight.references[here, 0], middle, signal.given.wraps)
            largest = max(largest, float(np.abs(off).max()))
    return largest


def told(asked: Asked, prepared: dict[str, Any]) -> Told:
    """Return the part of ``levels.json`` that workers need."""
    names = Calibrated.__dataclass_fields__
    made = [Calibrated(**{key: value for key, value in row.items() if key in names}) for row in prepared["levels"]]
    by_pair = {(each.manager, each.signal): each for each in made}
    return Told(asked.entrants, by_pair, asked.budget_per_h, prepared["worst_reference"])


def costs(asked: Asked, signals: Sequence[OfSignal], calibrated: Told, healthy: Healthy) -> dict[str, float]:
    """Return the microseconds a signal and frame of each manager on this computer; the folder does not keep them."""
    signal = signals[0]
    flight = healthy.flights[signal.name][0]
    found: dict[str, float] = {}
    for entrant in asked.entrants:
        values, seconds = calibrated.calibrated[entrant.name, signal.name].values, list[float]()
        for _ in range(_TIMES + 1):  # the first warms up
            began = perf_counter()
            failing(entrant, signal, values, [flight])
            seconds.append(perf_counter() - began)
        found[entrant.name] = 1e6 * min(seconds[1:]) / len(flight.samples)
    return found
