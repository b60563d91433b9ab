"""Thresholds of one signal for a budget of false isolations: for each filter, persistence and level.

At a level each choice of channels that may be in use gets a threshold for the whole budget, and the largest counts:
it is not known which channels will be left.  Written is the upper value of the bootstrap (tail.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.recordings.settings import RecordedSignal
from rig.thresholds.distances import exceeded_each, in_use
from rig.thresholds.monitored import low_passed
from rig.thresholds.tail import LEAST, Peaks, draws, peaks, point, upper

Floats = NDArray[np.float64]
FIELDS: Final = {4: "threshold", 3: "threshold_triplex", 2: "threshold_duplex"}  # by channels in use


@dataclass(frozen=True, slots=True)
class Threshold:
    """For one level: the upper value and the point estimate, unit of the signal, and what they rest on."""

    level: int
    upper: float
    point: float
    clusters: int
    shape: float


@dataclass(frozen=True, slots=True)
class Design:
    """One row of the table of a signal: thresholds by level; ``persistence`` and ``singular`` in frames."""

    filter_s: float
    persistence: int
    singular: int
    thresholds: dict[int, Threshold]

    @property
    def threshold(self) -> Threshold:
        """Return the threshold with all channels in use."""
        return self.thresholds[max(self.thresholds)]

    def settings(self, given: RecordedSignal) -> RecordedSignal:
        """Return the settings of a signal with this design in them."""
        none = ("persistence_s", "singular_persistence_s", "outlier_threshold", "outlier_threshold_triplex")
        return given.model_copy(update={**self.keys(), **dict.fromkeys(none)})

    def keys(self) -> dict[str, float | int]:
        """Return its keys of a table of CONFIG; a level that was not designed has the threshold of the one above."""
        largest = max(self.thresholds)
        of_level = {FIELDS[level]: rounded_up(threshold.upper) for level, threshold in self.thresholds.items()}
        of_level["threshold"] = rounded_up(self.thresholds[largest].upper)
        return {
            **of_level,
            "persistence": self.persistence,
            "singular_persistence": self.singular,
            "filter_s": self.filter_s,
        }


@dataclass(frozen=True, slots=True)
class Grid:
    """What is asked for."""

    budget_per_h: float
    persistence: Sequence[int] = (8, 12, 24, 48)
    levels: Sequence[int] = (4, 3, 2)
    filters_s: Sequence[float] = (0.0, 0.1)
    seed: int = 0


@dataclass(frozen=True, slots=True)
class DataBlock:
    """One block: samples (C, n) of a signal, NaN where one is not comparable."""

    name: str
    samples: Floats
    rate_hz: float

    @property
    def hours(self) -> float:
        """Return its duration."""
        return self.samples.shape[1] / self.rate_hz / 3600.0


def designs(flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid, number: int = 0) -> list[Design]:
    """Yield the designs of every filter and persistence of the grid that the data can say something of.

    number : of the signal, for its random stream
    """
    return list(_designs(flights, given, grid, number))


def _designs(flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid, number: int) -> Iterator[Design]:
    fitted = len(flights[0].samples)
    levels = sorted({fitted, *(level for level in grid.levels if level < fitted)}, reverse=True)
    frames = [(count, _singular(given, count, flights[0].rate_hz)) for count in grid.persistence]
    for f, filter_s in enumerate(grid.filters_s):
        filtered = given.model_copy(update={"filter_s": filter_s})
        seen = [low_passed(flight.samples, filtered, flight.rate_hz) for flight in flights]
        at = {level: _at_level(flights, seen, given, frames, level, (grid, number, f)) for level in levels}
        for i, (persistence, singular) in enumerate(frames):
            thresholds = {level: threshold for level in levels if (threshold := at[level][i]) is not None}
            if fitted in thresholds:
                yield Design(filter_s, persistence, singular, thresholds)


def _singular(given: RecordedSignal, frames: int, rate_hz: float) -> int:
    """Return ``singular_persistence``: as CONFIG says, else as the persistence."""
    if given.singular_persistence_s is not None:
        return max(1, int(np.ceil(given.singular_persistence_s * rate_hz - 1e-9)))
    return given.singular_persistence if "singular_persistence" in given.model_fields_set else frames


def _at_level(
    flights: Sequence[DataBlock],
    seen: Sequence[Floats],
    given: RecordedSignal,
    frames: Sequence[tuple[int, int]],
    level: int,
    asked: tuple[Grid, int, int],
) -> list[Threshold | None]:
    """Return the threshold at a level for each of ``frames``; None where too few clusters are left to say anything."""
    grid, *place = asked
    rates = [flight.rate_hz for flight in flights]
    largest: list[Threshold | None] = [None] * len(frames)
    few = [False] * len(frames)
    for choice, channels in enumerate(in_use(len(seen[0]), level)):
        series = [exceeded_each(samples[list(channels)], frames, given.wraps) for samples in seen]
        for i, (persistence, _) in enumerate(frames):
            tail = peaks([of_flight[i] for of_flight in series], rates, grid.budget_per_h)
            few[i] |= tail.clusters < LEAST
            if few[i]:
                continue
            stream = np.random.SeedSequence(grid.seed, spawn_key=(*place, persistence, level, choice))
            threshold, before = _threshold(tail, grid.budget_per_h, level, np.random.default_rng(stream)), largest[i]
            largest[i] = threshold if before is None or threshold.upper > before.upper else before
    return [None if lost else threshold for threshold, lost in zip(largest, few, strict=True)]


def _threshold(tail: Peaks, budget_per_h: float, level: int, rng: np.random.Generator) -> Threshold:
    middle, shape = point(tail, budget_per_h)
    most = upper(draws(tail, budget_per_h, rng))
    return Threshold(level, max(most, middle), middle, tail.clusters, shape)


def rounded_up(value: float, digits: int = 4) -> float:
    """Return the least number of so many digits that is not below ``value``."""
    if not value > 0:
        return value
    step = 10.0 ** (int(np.floor(np.log10(value))) - digits + 1)
    up = float(np.ceil(value / step))
    return float(f"{up * step:.{digits}g}")
