"""Hold-out test: half of the flights design, the flight's manager runs over the other half, and then the other way.

The design has the persistence and filter that were chosen on all flights; only its thresholds are new.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import poisson

from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.design import FIELDS, DataBlock, Design, Grid, designs, rounded_up, with_sums
from rig.studies.thresholds.distances import in_use
from rig.studies.thresholds.pieces import isolations
from rig.studies.thresholds.residual_series import residuals
from rig.studies.thresholds.tail import GAP_S

OVER: Final = 0.0228  # chance of so many by luck from which a count is significantly over: two sigma
MOST: Final = 200_000  # frames up to which other levels are flown too


@dataclass(frozen=True, slots=True)
class Count:
    """The false isolations of a signal at a level in held-out flights."""

    counted: int
    hours: float  # of channels' flights: at level 3, of each triple
    budget_per_h: float

    @property
    def expected(self) -> float:
        """Return the number of false isolations that the rate allows."""
        return self.budget_per_h * self.hours

    @property
    def over(self) -> bool:
        """Return True if there are significantly more false isolations than the rate allows."""
        return self.counted > 0 and bool(poisson.sf(self.counted - 1, self.expected) < OVER)


def holdout(flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid, chosen: Design) -> dict[int, Count] | None:
    """Return the counts by level of both halves, every second flight each; None if a half cannot be designed."""
    halves = (flights[0::2], flights[1::2])
    frames = sum(flight.samples.shape[1] for flight in flights)
    levels = grid.levels if frames <= MOST else ()  # () : only all channels in use
    own = replace(grid, persistence=(chosen.persistence,), filters_s=(chosen.filter_s,), levels=levels)
    counts: list[dict[int, Count]] = []
    for design_on, test_on in (halves, halves[::-1]):
        again = _again(design_on, given, own, chosen) if design_on and test_on else None
        if again is None:
            return None
        counts.append(count(test_on, given, again, grid.budget_per_h))
    return {level: _sum([of_level, counts[1][level]]) for level, of_level in counts[0].items() if level in counts[1]}


def _again(flights: Sequence[DataBlock], given: RecordedSignal, grid: Grid, chosen: Design) -> Design | None:
    """Return the design of ``flights`` with the settings of ``chosen``, as far as the flights have events."""
    made = designs(flights, given, grid)
    if not made:
        return None
    if not chosen.spreads:
        return made[0]
    found = residuals([(flight.samples, flight.reference) for flight in flights], given, flights[0].rate_hz)
    summed = with_sums(flights, given, made[0], found, (chosen.spreads,), grid)
    return summed[0] if summed else made[0]


def _sum(counts: Sequence[Count]) -> Count:
    hours = float(np.sum([of.hours for of in counts]))
    return Count(sum(of.counted for of in counts), hours, counts[0].budget_per_h)


def count(flights: Sequence[DataBlock], given: RecordedSignal, design: Design, budget_per_h: float) -> dict[int, Count]:
    """Count the false isolations of ``design`` in flights by level, for each choice of channels in use."""
    settings = design.settings(given)
    counts: dict[int, Count] = {}
    for level, threshold in design.thresholds.items():
        choices, within = in_use(len(flights[0].samples), level), rounded_up(threshold.upper)
        at_level = settings.model_copy(update={"threshold": within, FIELDS[level]: within})
        number = sum(
            len(isolations(flight.samples[list(channels)].T, at_level, flight.rate_hz, round(GAP_S * flight.rate_hz)))
            for flight in flights
            for channels in choices
        )
        counts[level] = Count(number, len(choices) * sum(flight.hours for flight in flights), budget_per_h)
    return counts


def total(counts: Mapping[str, Mapping[int, Count]]) -> Count | None:
    """Return the sum over all signals with all channels in use."""
    first = [of[max(of)] for of in counts.values() if of]
    return _sum(first) if first else None
