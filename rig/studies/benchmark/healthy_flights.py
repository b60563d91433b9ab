"""Isolations in healthy flights: false isolations, levels that some flights exceed, and transients."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import BASELINES
from rig.core.column import Column
from rig.core.runs import cluster_starts
from rig.core.threads import heed
from rig.core.units.angles import into_range
from rig.studies.benchmark.calibration_data import Flight
from rig.studies.benchmark.entrants import Entrant, OfSignal, Values, isolates_no_channel, levels, manager
from rig.studies.benchmark.own_class import voted
from rig.studies.campaign.statistics import poisson
from rig.studies.thresholds.pieces import failures, four
from rig.studies.thresholds.tail import GAP_S
from rig.studies.thresholds.tradeoff import circle_of

Frames = NDArray[np.int64]
POOLED: Final = "all"  # signals together
FLIGHTS: Final = 3  # that exceed the level at which a second campaign is counted
_OURS: Final = ("threshold", "slow_allowance", "slow_means", "slow_squares", "slow_halves")  # of the built-in manager
_STEPS: Final = 64  # of a factor of 2^(1/16), down to a sixteenth
_STRIDE: Final = 8
BURSTS: Final = (1, 3, 7)  # frames
SIZES: Final = (10.0, 100.0)  # thresholds
_EVERY, _AFTER, _MOST = 500, 200, 24  # frames from burst to burst, frames in which one counts, flights


def failing(
    entrant: Entrant,
    signal: OfSignal,
    values: Values,
    flights: Sequence[Flight],
    channels: int | None = None,
    guesses: bool = False,
) -> list[Frames]:
    """Return the frames of each flight in which a manager isolates a channel.

    A built-in or baseline manager starts again after each isolation, with what it has learned.  A manager of the user
    continues, and isolated channels stay isolated.
    channels : of the flights, if fewer than the signal has; guesses : an even split counts as an isolation
    """
    heed()
    if entrant.is_own:
        return _own(entrant, signal, values, flights, channels)
    made = manager(entrant, signal, values, channels)
    if guesses and entrant.manager in BASELINES:
        made.params["holds_ties"] = 0
    return [failures(flight.samples, flight.references, made) for flight in flights]


def _own(
    entrant: Entrant, signal: OfSignal, values: Values, flights: Sequence[Flight], channels: int | None
) -> list[Frames]:
    longest = max(len(flight.samples) for flight in flights)
    params = signal.params.copy()
    params["fitted"] = channels or signal.fitted
    pads = [[(0, longest - len(flight.samples)), (0, 0)] for flight in flights]
    samples = [np.pad(four(f.samples), pad, "edge") for f, pad in zip(flights, pads, strict=True)]
    both = np.array([np.pad(f.references, pad, "edge") for f, pad in zip(flights, pads, strict=True)])
    read = {"channels": np.array(samples), "reference": both[:, :, 0], "second_reference": both[:, :, 1]}
    failed, _ = voted(entrant.manager, values, params, read)
    began = failed & ~np.pad(failed, [(0, 0), (1, 0), (0, 0)])[:, :-1]
    return [
        np.flatnonzero(each[: len(flight.samples)].any(axis=1)) for each, flight in zip(began, flights, strict=True)
    ]


def isolations(entrant: Entrant, signal: OfSignal, values: Values, flights: Sequence[Flight]) -> int:
    """Return the number of false isolations, in clusters, of a manager in whole flights."""
    gap = round(GAP_S * signal.rate_hz)
    return sum(len(cluster_starts(at, gap)) for at in failing(entrant, signal, values, flights))


def flights_failing(entrant: Entrant, signal: OfSignal, values: Values, flights: Sequence[Flight]) -> int:
    """Return the number of flights with a false isolation."""
    return sum(len(at) > 0 for at in failing(entrant, signal, values, flights))


def exceeded(
    entrant: Entrant, signal: OfSignal, values: Values, flights: Sequence[Flight]
) -> tuple[dict[str, Any], int] | None:
    """Return the largest level, ``values`` times a factor, that FLIGHTS flights or more exceed, and their number.

    None if a sixteenth of ``values`` is still too large.
    """
    counts: dict[int, int] = {}

    def enough(step: int) -> bool:
        counts[step] = flights_failing(entrant, signal, scaled(entrant, signal, values, step), flights)
        return counts[step] >= FLIGHTS

    at = first_enough(enough, _STEPS)
    return None if at is None else (scaled(entrant, signal, values, at), counts[at])


def first_enough(enough: Callable[[int], bool], last: int) -> int | None:
    """Return the first of the steps 0 to ``last`` that is ``enough``; None if there is none.

    The search takes strides first: far below its level a monitor may isolate no channel, because no two channels agree.
    """
    low, high = -1, next((step for step in range(0, last + 1, _STRIDE) if enough(step)), None)
    if high is None:
        return None
    low = high - _STRIDE if high else low
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return high


def scaled(entrant: Entrant, signal: OfSignal, values: Values, step: int) -> dict[str, Any]:
    """Return the levels times 2^(-step / 16): for the built-in manager thresholds, factors, allowance."""
    factor = 2.0 ** (-step / 16.0)
    names = {level.name for level in levels(entrant, signal)}
    return {
        name: value * factor if name in names or (not names and name.startswith(_OURS)) else value
        for name, value in values.items()
    }


def transients(
    entrant: Entrant, signal: OfSignal, values: Values, flights: Sequence[Flight]
) -> Iterator[dict[str, Any]]:
    """Yield for each duration and size of burst how many bursts make a manager isolate a channel.

    A burst comes every 5 s, on the channels in turn and to either side.  Isolations without bursts do not count.
    """
    some = flights[:_MOST]
    without = [set(at.tolist()) for at in failing(entrant, signal, values, some)]
    for frames in BURSTS:
        for size in SIZES:
            found = _burst(entrant, signal, values, some, without, (frames, size))
            yield {"signal": signal.name, "manager": entrant.name, "frames": frames, "thresholds": size, **found}


def _burst(
    entrant: Entrant,
    signal: OfSignal,
    values: Values,
    flights: Sequence[Flight],
    without: Sequence[set[int]],
    burst: tuple[int, float],
) -> dict[str, int]:
    frames, size = burst
    begins = [range(_EVERY, len(flight.samples) - _AFTER, _EVERY) for flight in flights]
    hit: list[Flight] = []
    for flight, at in zip(flights, begins, strict=True):
        samples = flight.samples.copy()
        for i, begin in enumerate(at):
            sign = 1.0 if i // signal.fitted % 2 == 0 else -1.0
            samples[begin : begin + frames, i % signal.fitted] += sign * size * signal.threshold
        if (circle := circle_of(signal.given)) is not None:
            samples = into_range(samples, circle, circle, True)
        hit.append(flight._replace(samples=samples))
    failed = 0
    for at, before, found in zip(begins, without, failing(entrant, signal, values, hit), strict=True):
        new = np.array(sorted(set(found.tolist()) - before), np.int64)
        failed += sum(bool(((new >= begin) & (new < begin + _AFTER)).any()) for begin in at)
    return {"bursts": sum(len(at) for at in begins), "failed": failed}


SECOND: Final = (
    *(Column("signal"), Column("manager"), Column("false isolations", "counted")),
    Column("budget", "expected", ".2g"),
    Column("an hour, 95 %", lambda row: f"{row['low_per_h']:.2g} to {row['high_per_h']:.2g}"),
    *(
        Column(title, lambda row, n=n, of=of: None if row[n] is None else f"{row[n]} of {row[of]}", worth=worth)
        for title, n, of, worth in (
            ("flights above the calibrating level of three", "three", "flights", 7),
            ("calibrating flights above it", "three_before", "of", 6),
        )
    ),
)


def counted(rows: Sequence[dict[str, Any]], budget_per_h: float) -> list[dict[str, Any]]:
    """Return the counts in a second campaign, ``counted`` in ``hours`` for each row, also pooled over all signals."""
    found: list[dict[str, Any]] = []
    for name in dict.fromkeys(row["manager"] for row in rows):
        mine = [row for row in rows if row["manager"] == name]
        together = {"manager": name, "signal": POOLED}
        for key in ("counted", "hours", "flights", "of", "three", "three_before"):
            known = [row[key] for row in mine if row[key] is not None]
            together[key] = sum(known) if len(known) == len(mine) else None
        found += [*mine, together] if len(mine) > 1 else mine
    rates = [poisson(row["counted"], row["hours"]) for row in found]
    return [
        {**row, "expected": budget_per_h * row["hours"], "low_per_h": rate.low, "high_per_h": rate.high}
        for row, rate in zip(found, rates, strict=True)
    ]


def second_counts(
    entrant: Entrant,
    signal: OfSignal,
    values: dict[str, float],
    three: tuple[dict[str, float], int] | None,
    second: tuple[Sequence[Flight], float, int],
) -> dict[str, Any]:
    """Return the false isolations in a second campaign, and its flights above the level of FLIGHTS calibrating flights.

    second : its flights and hours, and the number of calibrating flights
    """
    flights, hours, before = second
    assert not isolates_no_channel(entrant, signal)
    return {
        "manager": entrant.name,
        "signal": signal.name,
        "counted": isolations(entrant, signal, values, flights),
        "hours": hours,
        "flights": len(flights),
        "of": before,
        "three": None if three is None else flights_failing(entrant, signal, three[0], flights),
        "three_before": None if three is None else three[1],
    }
