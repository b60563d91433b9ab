"""Design the thresholds of one signal for a false-isolation rate, for each filter, persistence and level.

At each level, each choice of channels that may be in use gets a threshold for the whole rate.  The largest counts,
because it is not known which channels will remain.  The upper value of the bootstrap (tail.py) is the result.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.settings import in_frames
from rig.core.threads import heed
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.distances import DUPLEX, exceeded_each, in_use, near_first, nearest
from rig.studies.thresholds.pieces import low_passed
from rig.studies.thresholds.residual_series import Residuals, series
from rig.studies.thresholds.slow_fault_limits import ALLOWANCES, OFF, Rule, alarms, stale_frames
from rig.studies.thresholds.tail import LEAST, Peaks, Tail, draws, fitted, peaks, point, upper

Floats = NDArray[np.float64]
BESIDE: Final = 1e-4  # of healthy frames beyond a threshold: one beside a transient makes it last longer
EXACT: Final = "stale_frames"  # the key that is not rounded
FIELDS: Final = {4: "threshold", 3: "threshold_triplex", 2: "threshold_duplex"}  # by channels in use


@dataclass(frozen=True, slots=True)
class Threshold:
    """The threshold at one level: upper value and point estimate, unit of the signal, and the data behind them."""

    level: int
    upper: float
    point: float
    clusters: int
    shape: float
    tail: Tail | None = field(default=None, compare=False, repr=False)  # of the choice of channels that counts


@dataclass(frozen=True, slots=True)
class Design:
    """One row of the table of a signal: the thresholds by level; ``persistence`` and ``splits`` in frames."""

    filter_s: float
    persistence: int
    in_split: int
    thresholds: dict[int, Threshold]
    slow_faults: dict[str, float | None] = field(default_factory=dict)  # keys of what was asked for; falsy: off
    spreads: float = 0.0  # limit of the sums, spreads times frames
    kept: bool = False  # thresholds, persistence and filter are those that were given

    @property
    def threshold(self) -> Threshold:
        """Return the threshold with all channels in use."""
        return self.thresholds[max(self.thresholds)]

    def settings(self, given: RecordedSignal) -> RecordedSignal:
        """Return the settings of a signal with this design."""
        none = () if self.kept else ("persistence_s", "split_persistence_s")
        return given.model_copy(update={**dict.fromkeys(none), **self.slow_faults, **self.keys()})

    def keys(self) -> dict[str, float | int]:
        """Return the keys of this design for a table of CONFIG; a level without a design takes the level above."""
        slow_faults = {
            key: value if key == EXACT else rounded_up(value) for key, value in self.slow_faults.items() if value
        }
        if self.kept:
            return slow_faults
        of_level = {FIELDS[level]: rounded_up(threshold.upper) for level, threshold in self.thresholds.items()}
        return {
            **of_level,
            "threshold": rounded_up(self.threshold.upper),
            **slow_faults,
            "persistence": self.persistence,
            "split_persistence": self.in_split,
            "filter_s": self.filter_s,
        }


@dataclass(frozen=True, slots=True)
class Grid:
    """The rate, and the grid of filters, persistences and levels."""

    budget_per_h: float
    persistence: Sequence[int] = (8, 12, 24, 48)
    levels: Sequence[int] = (4, 3, 2)
    filters_s: Sequence[float] = (0.0, 0.1)
    seed: int = 0
    slow_faults: Sequence[Rule] = ()
    transients: bool = False  # no threshold within the noise of single frames
    kept: bool = False  # thresholds, persistence and filter that are given stay; only the rest is designed


@dataclass(frozen=True, slots=True)
class DataBlock:
    """One block of data: the samples (C, n) of a signal, NaN if one is not comparable, and its reference (n,)."""

    name: str
    samples: Floats
    rate_hz: float
    reference: Floats | None = field(default=None, compare=False)

    @property
    def hours(self) -> float:
        """Return the duration of the block."""
        return self.samples.shape[1] / self.rate_hz / 3600.0


def designs(flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid, number: int = 0) -> list[Design]:
    """Yield the designs of every filter and persistence of the grid for which the data have enough events.

    number : of the signal, for its random stream
    """
    made = [_kept(flights, given, grid)] if grid.kept else list(_designs(flights, given, grid, number))
    off = {key: value for rule in grid.slow_faults for key, value in OFF[rule].items()}
    if "stale" in grid.slow_faults and made:
        off["stale_frames"] = stale_frames([flight.samples for flight in flights], flights[0].rate_hz)
    return [replace(design, slow_faults={**off, **design.slow_faults}) for design in made]


def _kept(flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid) -> Design:
    """Return the thresholds that are given as a design."""
    fitted, rate_hz = len(flights[0].samples), flights[0].rate_hz
    of_level = {4: given.threshold, 3: given.threshold_triplex, 2: given.threshold_duplex}
    thresholds = {
        level: Threshold(level, within := of_level[level] or given.threshold, within, 0, 0.0)
        for level in (4, 3, 2)
        if level == fitted or (level < fitted and level in grid.levels)
    }
    persistence = in_frames(given.persistence, given.persistence_s, rate_hz)
    in_split = in_frames(given.split_persistence, given.split_persistence_s, rate_hz)
    return Design(given.filter_s, persistence, in_split, thresholds, kept=True)


def _designs(flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid, number: int) -> Iterator[Design]:
    fitted = len(flights[0].samples)
    levels = sorted({fitted, *(level for level in grid.levels if level < fitted)}, reverse=True)
    frames = [(count, _split(given, count, flights[0].rate_hz)) for count in grid.persistence]
    for f, filter_s in enumerate(grid.filters_s):
        filtered = given.model_copy(update={"filter_s": filter_s})
        seen = [low_passed(flight.samples, filtered, flight.rate_hz) for flight in flights]

        def compared(channels: tuple[int, ...], seen: Sequence[Floats] = seen) -> list[Floats]:
            return [samples[list(channels)] for samples in seen]

        by_level = {
            level: _at_level(flights, compared, given.wraps, frames, level, (grid, number, f)) for level in levels
        }
        least = dict.fromkeys(levels, 0.0)
        if grid.transients:
            least = {level: of_one_frame(compared, given.wraps, fitted, level) for level in levels}
        for i, (persistence, in_split) in enumerate(frames):
            thresholds = {
                level: _at_least(least[level], threshold)
                for level in levels
                if (threshold := by_level[level][i]) is not None
            }
            if fitted in thresholds:
                yield Design(filter_s, persistence, in_split, thresholds)


def _at_least(least: float, threshold: Threshold) -> Threshold:
    return replace(threshold, upper=max(threshold.upper, least))


def of_one_frame(compared: Callable[[tuple[int, ...]], list[Floats]], wraps: bool, fitted: int, level: int) -> float:
    """Return the distance of a channel to all others in BESIDE of the frames, the largest over all choices."""
    largest = 0.0
    for channels in in_use(fitted, level):
        heed()
        parts = [near_first(samples) if wraps else samples for samples in compared(channels) if samples.size]
        distances = np.concatenate([np.maximum.reduce(nearest(samples)) for samples in parts] or [np.zeros(1)])
        comparable = distances[np.isfinite(distances)]
        largest = max(largest, float(np.quantile(comparable, 1.0 - BESIDE)) if len(comparable) else 0.0)
    return largest


def with_sums(
    flights: Sequence[DataBlock],
    given: RecordedSignal,
    design: Design,
    found: Residuals,
    limits: Sequence[float],
    grid: Grid,
    number: int = 0,
) -> list[Design]:
    """Return ``design`` with each CUSUM limit, spreads times frames, for which the data have enough events.

    The allowance is the largest that a level needs, for the whole rate.
    given : with the slow-fault tests, if the sums will add up their residuals; found : residuals of all channels
    """
    rate_hz, allowances = flights[0].rate_hz, ALLOWANCES * found.spread
    asked = {spreads: rounded_up(spreads * found.spread / rate_hz) for spreads in limits}
    uppers: dict[float, list[float]] = {spreads: [] for spreads in limits}
    for level in (level for level in design.thresholds if level > DUPLEX):
        for choice, channels in enumerate(in_use(len(flights[0].samples), level)):
            rows = [series((each.samples[list(channels)], each.reference), given, rate_hz) for each in flights]
            for spreads, limit in asked.items():
                told = design.settings(given).model_copy(update={"slow_limit": limit})
                series_of = [alarms(row, told, rate_hz, allowances) for row in rows]
                tail = peaks(series_of, [rate_hz] * len(rows), grid.budget_per_h)
                stream = np.random.SeedSequence(grid.seed, spawn_key=(number, int(spreads), 1, level, choice))
                few = tail.clusters < LEAST
                rng = np.random.default_rng(stream)
                uppers[spreads].append(0.0 if few else from_tail(tail, grid.budget_per_h, level, rng).upper)
    return [
        replace(
            design,
            slow_faults={**design.slow_faults, "slow_limit": asked[spreads], "slow_allowance": max(of_limit)},
            spreads=spreads,
        )
        for spreads, of_limit in uppers.items()
        if of_limit and min(of_limit) > 0.0
    ]


def _split(given: RecordedSignal, frames: int, rate_hz: float) -> int:
    """Return ``split_persistence``: from CONFIG, or equal to the persistence if not given."""
    if given.split_persistence_s is not None:
        return in_frames(1, given.split_persistence_s, rate_hz)
    return given.split_persistence if "split_persistence" in given.model_fields_set else frames


def _at_level(
    flights: Sequence[DataBlock],
    compared: Callable[[tuple[int, ...]], list[Floats]],
    wraps: bool,
    frames: Sequence[tuple[int, int]],
    level: int,
    asked: tuple[Grid, int, int],
) -> list[Threshold | None]:
    """Return the threshold at a level for each of ``frames``; None if too few clusters are left.

    compared : the compared distance of some channels, a series a flight
    """
    grid, *place = asked
    largest: list[Threshold | None] = [None] * len(frames)
    few = [False] * len(frames)
    for choice, channels in enumerate(in_use(len(flights[0].samples), level)):
        heed()
        parts = [(samples, f.rate_hz) for samples, f in zip(compared(channels), flights, strict=True) if samples.size]
        if not parts:
            return [None] * len(frames)
        series = [exceeded_each(samples, frames, wraps) for samples, _ in parts]
        rates = [rate_hz for _, rate_hz in parts]
        for i, (persistence, _) in enumerate(frames):
            tail = peaks([of_flight[i] for of_flight in series], rates, grid.budget_per_h)
            few[i] |= tail.clusters < LEAST
            if few[i]:
                continue
            stream = np.random.SeedSequence(grid.seed, spawn_key=(*place, persistence, level, choice))
            threshold, before = from_tail(tail, grid.budget_per_h, level, np.random.default_rng(stream)), largest[i]
            largest[i] = threshold if before is None or threshold.upper > before.upper else before
    return [None if lost else threshold for threshold, lost in zip(largest, few, strict=True)]


def from_tail(tail: Peaks, budget_per_h: float, level: int, rng: np.random.Generator) -> Threshold:
    """Return the threshold of a tail at ``level``: the upper value of the bootstrap and the point estimate."""
    middle, shape = point(tail, budget_per_h)
    most = upper(draws(tail, budget_per_h, rng))
    return Threshold(level, max(most, middle), middle, tail.clusters, shape, fitted(tail))


def rounded_up(value: float, digits: int = 4) -> float:
    """Return ``value`` rounded up to the given number of digits."""
    if not value > 0:
        return value
    step = 10.0 ** (int(np.floor(np.log10(value))) - digits + 1)
    up = float(np.ceil(value / step))
    return float(f"{up * step:.{digits}g}")
