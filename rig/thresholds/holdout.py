"""Half of the flights design, the other half is flown: false isolations that the flight's manager really has.

Both ways.  The design has the persistence and filter that were chosen on all flights; only its thresholds are new.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import poisson

from rig.recordings.settings import RecordedSignal
from rig.thresholds.design import FIELDS, Design, Flight, Grid, designs, rounded_up
from rig.thresholds.distances import in_use
from rig.thresholds.monitored import isolations
from rig.thresholds.tail import GAP_S

OVER: Final = 0.0228  # chance of so many by luck from which a count is significantly over: two sigma
MOST: Final = 200_000  # frames up to which other levels are flown too


@dataclass(frozen=True, slots=True)
class Count:
    """False isolations of a signal at a level in flights that did not design it."""

    counted: int
    hours: float  # of channels' flights: at level 3, of each triple
    budget_per_h: float

    @property
    def expected(self) -> float:
        """Return the number that the budget allows."""
        return self.budget_per_h * self.hours

    @property
    def over(self) -> bool:
        """Return True if there are more than chance makes of the budget."""
        return self.counted > 0 and bool(poisson.sf(self.counted - 1, self.expected) < OVER)


def holdout(flights: Sequence[Flight], given: RecordedSignal, grid: Grid, chosen: Design) -> dict[int, Count] | None:
    """Return counts by level of both halves, every second flight each; None where a half cannot be designed."""
    halves = (flights[0::2], flights[1::2])
    frames = sum(flight.samples.shape[1] for flight in flights)
    levels = grid.levels if frames <= MOST else ()  # () : only all channels in use
    own = replace(grid, persistence=(chosen.persistence,), filters_s=(chosen.filter_s,), levels=levels)
    found: list[dict[int, Count]] = []
    for of, test in (halves, halves[::-1]):
        if not of or not test:
            return None
        made = designs(of, given, own)
        if not made:
            return None
        found.append(count(test, given, made[0], grid.budget_per_h))
    return {level: _both(one, found[1][level]) for level, one in found[0].items() if level in found[1]}


def _both(a: Count, b: Count) -> Count:
    return Count(a.counted + b.counted, a.hours + b.hours, a.budget_per_h)


def count(flights: Sequence[Flight], given: RecordedSignal, design: Design, budget_per_h: float) -> dict[int, Count]:
    """Count the false isolations of ``design`` in flights, by level, for each choice of channels in use."""
    settings = design.settings(given)
    found: dict[int, Count] = {}
    for level, threshold in design.thresholds.items():
        choices = in_use(len(flights[0].samples), level)
        at_level = settings.model_copy(
            update={"threshold": rounded_up(threshold.upper), FIELDS[level]: rounded_up(threshold.upper)}
        )
        number = sum(
            len(isolations(flight.samples[list(channels)].T, at_level, flight.rate_hz, round(GAP_S * flight.rate_hz)))
            for flight in flights
            for channels in choices
        )
        found[level] = Count(number, len(choices) * sum(flight.hours for flight in flights), budget_per_h)
    return found


def total(counts: Mapping[str, Mapping[int, Count]]) -> Count | None:
    """Add up all signals with all channels in use."""
    first = [of[max(of)] for of in counts.values() if of]
    if not first:
        return None
    return Count(sum(c.counted for c in first), float(np.sum([c.hours for c in first])), first[0].budget_per_h)
