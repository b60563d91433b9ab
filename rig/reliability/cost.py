"""What a trial and a flight of the bundled campaign `reliability` take here, on one core: measured."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Final, NamedTuple

from rig.campaign.config import find, read
from rig.campaign.estimate import estimate
from rig.campaign.plan import Plan
from rig.reliability.trials import Flight, shared_out

CAMPAIGN: Final = "reliability"
TRIALS: Final = 60_000  # shared out over all cells, of which some are run
UNITS: Final = 12  # of them, after one to warm up


class Cost(NamedTuple):
    """Seconds on one core."""

    trial_s: float
    flight_s: float

    def of(self, trials: int, open_loop: bool) -> float:
        """Return the seconds of so many trials of one kind."""
        return trials * (self.trial_s if open_loop else self.flight_s)


def measure() -> Cost:
    """Run some trials and a flight; the first of each warms up."""
    plan = Plan(read(CAMPAIGN, {}), str(find(CAMPAIGN)))
    first, *units = shared_out(plan, TRIALS, 0, [4])[: UNITS + 1]
    run = Flight(plan)
    for unit in (first, *units):  # records the healthy flight of each condition
        run(replace(unit, trials=1))
    began = perf_counter()
    for unit in units:
        run(unit)
    trial_s = (perf_counter() - began) / sum(unit.trials for unit in units)
    flown = estimate(plan, len(plan))
    return Cost(trial_s, flown.wall_s * flown.workers / flown.runs)
