"""Open-loop trials before the flights: where the best trial of each region is, a flight begins.

A trial costs a small share of a flight, and most flights that violate have a trial that does.  The trials are in memory
alone: they depend on the plan alone, so a resumed search makes them again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Final

from rig.core.errors import BadInput
from rig.core.interrupt import Stop
from rig.core.progress import tell
from rig.studies.search import open_loop
from rig.studies.search.fly_missing import Interrupted
from rig.studies.search.objective import VOTE, Measured
from rig.studies.search.regions import best_apart
from rig.studies.search.rounds import Draw
from rig.studies.search.search_plan import Asked, Row, SearchPlan

TIMES: Final = 10  # trials for each draw of the search
MOST: Final = 6000  # trials; the forest makes those of a long search slow
ROUND: Final = 40  # trials
LEAST: Final = 8  # flights that trials choose, and a tenth of all


@dataclass(frozen=True, slots=True)
class Tried:
    """The finds of the trials of a search."""

    trials: int
    violated: int
    starts: list[Draw]  # the best of each region, the best first
    results: list[Measured]  # of the trials of ``starts``

    def agreement(self, flown: Sequence[Measured]) -> dict[str, int]:
        """Return the figures; ``flown``: the results of the flights at ``starts``."""
        alike = [a.violated == b.violated for a, b in zip(flown, self.results, strict=False)]
        return {"trials": self.trials, "violated": self.violated, "flights": len(alike), "agree": sum(alike)}


def trial_plan(plan: SearchPlan) -> SearchPlan:
    """Return the plan of the trials of a search.  BadInput: open-loop trials cannot have its settings."""
    asked = plan.asked
    if asked.bench or asked.method != "regions":
        raise BadInput(f"--trials-first: not with {'--bench' if asked.bench else f'--method {asked.method}'}")
    count = min(TIMES * asked.flights, MOST)
    trials = Asked(asked.requirements, count, "regions", asked.against, asked.seed, bench=True)
    requirements = [each for each in plan.requirements if each.id != VOTE.id]
    made = SearchPlan(plan.campaign, plan.source, trials, requirements, plan.trust)
    try:
        open_loop.check(made)
    except BadInput as error:
        raise BadInput(str(error).replace("--bench", "--trials-first")) from None
    return made


def can_try(plan: SearchPlan) -> bool:
    """Return True if open-loop trials can have the settings of a search by regions."""
    try:
        trial_plan(plan)
    except BadInput:
        return False
    return True


def tried(plan: SearchPlan, stop: Stop) -> Tried:
    """Make the trials of a search.  Interrupted: asked to stop."""
    trials = trial_plan(plan)

    def rows_of(numbers: list[int]) -> list[Row]:
        rows = []
        for number in numbers:
            if stop.requested:
                raise Interrupted
            rows.append(open_loop.trial_row(trials[number], trials.requirements))
        return rows

    def told(_: list[Measured]) -> None:
        tell(f"{len(trials.choices)} open-loop trials", len(trials.choices) - 1, len(trials))

    return _best(plan, trials, trials.search(rows_of, told, size=ROUND).results)


def _best(plan: SearchPlan, trials: SearchPlan, results: list[Measured]) -> Tried:
    """Return the best trial of each region, those that violate if any does."""
    violated = sum(each.violated for each in results)
    most = max(LEAST, plan.most_draws // 10)
    places = list(islice(best_apart(trials.draws, [each.value for each in results]), most))
    kept = [i for i in places if results[i].violated] or places[:LEAST]
    return Tried(len(trials.choices), violated, [trials.draws[i] for i in kept], [results[i] for i in kept])
