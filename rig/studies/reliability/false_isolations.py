"""Estimate the rate of false isolations of healthy channels by multilevel splitting.

    rate of a channel = crossings from level 0 a frame x product of P(i + 1 before 0 | i) x channels isolated / channels

A repetition draws the errors of a number of flights (channel_errors.py), runs the first frames of each and keeps the
states in which excursions begin.  From each level it runs the same number of excursions, from states drawn with
replacement; each carries the weight of its flight.  Repetitions are independent and give the interval.
If errors at the ends of their tolerances separate no channels, there is nothing to split.  The rate is then below a
bound (``bound``): an isolation takes ``persistence`` miscomparing frames in a row, and noise has no memory.
Source: docs/explanation/reliability.md, 'False isolations'; fixed-effort splitting, Garvels and Kroese (1998).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence
from numpy.typing import NDArray
from scipy.special import gammaincinv, stdtrit

from rig.bench.splitting import CUT, REACHED, Held, Particles, Windows, run_excursions, run_windows
from rig.core.errors import BadInput
from rig.core.frame import CHANNELS
from rig.studies.reliability.channel_errors import KAPPAS, corners, drawn_errors
from rig.studies.reliability.false_isolation_bench import COUNTED, Bench

Floats = NDArray[np.float64]
FLOOR: Final = 1e-12  # per channel hour; smaller rates are not resolved
FLIGHTS: Final = 4000  # of one repetition, with errors of their own
EXCURSIONS: Final = 20_000  # of one level
REPETITIONS: Final = 8
MOST_REPETITIONS: Final = 64
HALF_WIDTH: Final = 0.3  # of the estimate, until which repetitions are added
USEFUL: Final = 1.0  # a bound that is not above it, an hour, is an answer
LEAST_SETS: Final = 20  # of errors, at every level
CORNER_WINDOWS: Final = 16  # for every arrangement and stretch of the recording
_PLACES: Final = 32_768  # for states in which excursions begin
_ROWS: Final = 8192  # of noise, drawn at once
_CORNERS: Final = 2**31  # spawn key of the seed; below are the repetitions


class Effort(NamedTuple):
    """The size of one repetition, and the way in which errors are drawn."""

    flights: int = FLIGHTS
    excursions: int = EXCURSIONS
    kappas: tuple[float, ...] = KAPPAS
    most_repetitions: int = MOST_REPETITIONS


@dataclass(frozen=True, slots=True)
class FalseIsolationRate:
    """The false-isolation rate at one threshold."""

    threshold: float  # unit of the signal
    per_hour: float | None  # of one channel; None where only the bound is known
    low: float | None  # 95 %
    high: float
    at_start: float  # chance that a channel is isolated in the first frames of a flight
    sets: list[int]  # different sets of errors that reached each level, the fewest of all repetitions; [] if none
    carrying: float  # sets of errors that carry the estimate: their number if all had the same part in it (Kish)
    repetitions: int
    cut: int  # excursions that were left after splitting.LONGEST frames

    @property
    def few(self) -> str | None:
        """Return the reason why there is no estimate; None if there is one."""
        short = [(level, count) for level, count in enumerate(self.sets, 1) if count < LEAST_SETS]
        if short:
            level, count = short[0]
            return f"{count} different sets of errors reach level {level} of {len(self.sets)}, {LEAST_SETS} are needed"
        if self.sets and self.carrying < LEAST_SETS:
            return f"{self.carrying:.0f} different sets of errors carry the estimate, {LEAST_SETS} are needed"
        return None


class Repetition(NamedTuple):
    """The estimate of one repetition."""

    per_hour: float
    at_start: float
    sets: list[int]
    parts: Floats  # of the estimate, by flight that reached the end
    cut: int


def estimate_or_bound(bench: Bench, seed: int = 0, effort: Effort | None = None) -> FalseIsolationRate:
    """Estimate the false isolations of a channel an hour, or return the bound if too few sets of errors carry that.

    BadInput: too few sets of errors, and the bound is too high
    """
    estimated = estimate(bench, seed, effort)
    if estimated.few is None:
        return estimated
    highest = bound(bench, seed)
    if highest > USEFUL:
        raise BadInput(f"{bench.signal}: threshold {bench.threshold:g}: no estimate: {estimated.few}; raise --flights")
    return replace(estimated, per_hour=None, low=None, high=highest)


def estimate(bench: Bench, seed: int = 0, effort: Effort | None = None) -> FalseIsolationRate:
    """Estimate as ``estimate_or_bound`` does, also from too few sets of errors."""
    highest, spent = bound(bench, seed), effort or Effort()
    if highest < FLOOR:
        return FalseIsolationRate(bench.threshold, None, None, highest, 0.0, [], 0.0, 0, 0)
    repetitions: list[Repetition] = []
    wanted = min(REPETITIONS, spent.most_repetitions)
    while len(repetitions) < wanted:
        repetitions.append(repetition(bench, SeedSequence(seed, spawn_key=(len(repetitions),)), spent))
        wide = len(repetitions) == wanted and _half_width(repetitions) > HALF_WIDTH * _mean(repetitions)
        if wide and min(map(min, (each.sets for each in repetitions))) >= LEAST_SETS:
            wanted = min(wanted + REPETITIONS // 2, spent.most_repetitions)
    mean, half = _mean(repetitions), _half_width(repetitions)
    return FalseIsolationRate(
        threshold=bench.threshold,
        per_hour=mean,
        low=max(mean - half, 0.0),
        high=mean + half,
        at_start=float(np.mean([each.at_start for each in repetitions])),
        sets=[min(of) for of in zip(*(each.sets for each in repetitions), strict=True)],
        carrying=effective(np.concatenate([each.parts for each in repetitions])),
        repetitions=len(repetitions),
        cut=sum(each.cut for each in repetitions),
    )


def _mean(repetitions: Sequence[Repetition]) -> float:
    return float(np.mean([each.per_hour for each in repetitions]))


def _half_width(repetitions: Sequence[Repetition]) -> float:
    """Return half the width of the 95 % interval, by Student's t over independent repetitions."""
    spread = float(np.std([each.per_hour for each in repetitions], ddof=1))
    return float(stdtrit(len(repetitions) - 1, 0.975)) * spread / sqrt(len(repetitions))


def repetition(bench: Bench, seeds: SeedSequence, effort: Effort) -> Repetition:
    """Make the estimate of one repetition."""
    errors_from, flux_from, levels_from = (Generator(SFC64(child)) for child in seeds.spawn(3))
    given = bench.arrangements()
    errors, weights = drawn_errors(given, effort.flights, errors_from, effort.kappas)
    first, more = bench.starts(effort.flights, errors_from)
    held, windows, weights = bench.held(errors), bench.windows(first), weights * more
    begun, flown = excursions_begun(bench, held, windows, flux_from)
    carried = weights[begun.flight] / (flown * COUNTED)
    at_start = float(weights @ windows.at_start) / (flown * bench.channels)
    sets, cut = [_different(begun.flight, given.any)], 0
    for level in range(2, int(bench.params["persistence"]) + 1):
        begun, carried, left = next_level(held, begun, carried, level, effort.excursions, levels_from)
        cut += left
        sets.append(_different(begun.flight, given.any))
    parts: Floats = carried * begun.failed / bench.channels
    if given.any:
        parts = np.bincount(begun.flight, parts).astype(np.float64)
    return Repetition(float(parts.sum()) * bench.scenario.rate_hz * 3600.0, at_start, sets, parts, cut)


def _different(flights: NDArray[np.int64], errors: bool) -> int:
    """Count the flights that reach a level; without constant errors, count how often it is reached."""
    return len(np.unique(flights)) if errors else len(flights)


def effective(parts: Floats) -> float:
    """Return the number of equal parts with the same spread (Kish's effective size)."""
    return float(parts.sum() ** 2 / (parts**2).sum()) if parts.any() else 0.0


def excursions_begun(bench: Bench, held: Held, windows: Windows, rng: Generator) -> tuple[Particles, int]:
    """Return the states in which excursions begin, of as many windows as there are places, and their number."""
    work, out, n, j = bench.particles(1), bench.particles(_PLACES), 0, 0
    noise = np.empty((_ROWS, 1, CHANNELS), np.float32)
    while j < len(windows.first) and n + COUNTED <= _PLACES:
        rng.standard_normal(out=noise, dtype=np.float32)
        j, n = run_windows(held, work, j, windows, noise, out, n)
    return out.taken(slice(n)), j


def next_level(
    held: Held, begun: Particles, carried: Floats, goal: int, count: int, rng: Generator
) -> tuple[Particles, Floats, int]:
    """Return the states in which ``goal`` is reached, the weight of each, and the number of excursions cut off."""
    if len(carried) == 0:
        return begun, carried, 0
    drawn = rng.integers(0, len(carried), count)
    p, outcome, age, j = begun.taken(drawn), np.zeros(count, np.int64), np.zeros(count, np.int64), 0
    noise = np.empty((_ROWS, 1, CHANNELS), np.float32)
    while j < count:
        rng.standard_normal(out=noise, dtype=np.float32)
        j = run_excursions(held, p, j, goal, noise, outcome, age)
    reached = np.flatnonzero(outcome == REACHED)
    share = len(carried) / count
    return p.taken(reached), carried[drawn[reached]] * share, int((outcome == CUT).sum())


def bound(bench: Bench, seed: int) -> float:
    """Bound the false isolations of a channel an hour by flights whose errors are all at an end of their tolerances.

    Let p be the probability that a channel miscompares in a frame, at the worst ends and place of the recording.  An
    isolation takes ``persistence`` such frames in a row, or ``split_persistence`` in a split.  p is the upper end of
    its 95 % interval.  The bound is infinite if noise has a memory, that is, with a filter before the comparison.
    """
    if bench.params["filter_gain"] > 0.0:
        return np.inf
    rng, noise = (Generator(SFC64(SeedSequence(seed, spawn_key=(_CORNERS, k)))) for k in range(2))
    given, stretches = bench.arrangements(0.0), bench.stretches()
    held = bench.held(corners(given, CORNER_WINDOWS * len(stretches), rng))
    windows = bench.windows(np.tile(np.repeat(stretches, CORNER_WINDOWS), len(given.signs)))
    _, flown = excursions_begun(bench, held, windows, noise)
    if flown < len(windows.first):
        return np.inf
    apart = windows.apart.reshape(-1, CORNER_WINDOWS).sum(axis=1).max()
    p = float(gammaincinv(apart + 1.0, 0.95)) / (CORNER_WINDOWS * COUNTED)
    frames = int(min(bench.params["persistence"], bench.params["split_persistence"]))
    return (p / max(1.0 - p, FLOOR)) ** frames * bench.scenario.rate_hz * 3600.0
