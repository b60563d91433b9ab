"""The number of flights or trials that a target needs, and their cost on this computer.

Each number of good channels has half of the target.  No failure in N trials gives a chance below 3 / N with 95 %.
Source: docs/explanation/reliability.md, 'How many'; the rules of thumb of 'The model' for four channels.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil, comb, log
from time import perf_counter
from typing import Final, NamedTuple

NONE_SEEN: Final = -log(0.05)
BUDGET: Final = 0.5  # of the target, for one cell
CAMPAIGN: Final = "reliability"  # of which a trial and a flight are measured
TRIALS: Final = 60_000  # distributed over all cells, of which some are run
UNITS: Final = 12  # of them, after one to warm up


class Needed(NamedTuple):
    """The requirement on one cell."""

    good_before: int
    chance: float  # largest chance that the fault is not tolerated; from 1 on any is enough
    trials: int  # without a failure among them
    open_loop: bool  # whether open-loop trials are enough, or flights are needed


class Cost(NamedTuple):
    """Seconds on one core of this computer."""

    trial_s: float
    flight_s: float

    def of(self, trials: int, open_loop: bool) -> float:
        """Return the seconds of a number of trials of one kind."""
        return trials * (self.trial_s if open_loop else self.flight_s)


def needed(target_per_hour: float, per_hour: float, channels: int = 4, hours: float = 1.0) -> list[Needed]:
    """Return the cells of a chain of ``channels``, the first fault first.

    In a flight of T hours k + 1 of n channels fail with a chance of C(n, k + 1) (lambda T)^(k + 1).  The last of them
    loses the signal if it is not tolerated.
    """
    cells = []
    for k in range(channels - 1):
        good = channels - k
        weight = comb(channels, k + 1) * (per_hour * hours) ** (k + 1) / hours
        chance = BUDGET * target_per_hour / weight
        cells.append(Needed(good, chance, 0 if chance >= 1.0 else ceil(NONE_SEEN / chance), good >= 3))
    return cells


def measure() -> Cost:
    """Time some trials and a flight on one core; the first of each warms up."""
    from rig.studies.campaign.campaign_file import find, read
    from rig.studies.campaign.estimate import estimate
    from rig.studies.campaign.plan import Plan
    from rig.studies.reliability.cell_trials import TrialRunner, shared_out

    plan = Plan(read(CAMPAIGN, {}), str(find(CAMPAIGN)))
    first, *units = shared_out(plan, TRIALS, 0, [4])[: UNITS + 1]
    run = TrialRunner(plan)
    for unit in (first, *units):  # records the healthy flight of each condition
        run(replace(unit, trials=1))
    began = perf_counter()
    for unit in units:
        run(unit)
    trial_s = (perf_counter() - began) / sum(unit.trials for unit in units)
    flown = estimate(plan, len(plan))
    return Cost(trial_s, flown.wall_s * flown.workers / flown.runs)
