"""The flights of a search, and the flights that confirm and shrink its results, as growing plans of a campaign."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from rig.core.errors import BadInput
from rig.core.trust import Trust
from rig.scenario.overrides import parse_set
from rig.studies.campaign.campaign_file import Campaign
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.searched import types_of
from rig.studies.search.methods import METHODS, decides
from rig.studies.search.objective import Measured, beside, deciding, measured
from rig.studies.search.rounds import Draw, Method, Schedule, drive
from rig.studies.search.space import arms
from rig.verdict.requirements.requirement import Requirement

MOST_CONFIRMING: Final = 100_000
SEARCH: Final = "search"  # of campaign.json
Row = dict[str, Any]  # of ``runs``
SCENARIO: Final = "scenario"  # column of a confirming flight: the scenario's own table


@dataclass(frozen=True, slots=True)
class Asked:
    """The options of a search, apart from its campaign."""

    requirements: tuple[str, ...]
    flights: int
    method: Method = "regions"
    against: str | None = None  # KEY=VALUE of a second flight of each draw
    seed: int = 0
    bench: bool = False
    trials_first: bool = False

    @property
    def of_one_draw(self) -> int:
        """Return the number of flights of a draw."""
        return 1 if self.against is None else 2


@dataclass(frozen=True, slots=True)
class Searched:
    """The values of all draws, and the requirements that were used."""

    ids: tuple[str, ...]
    results: list[Measured]  # of each draw, in their order
    standing: str  # of the method when no draw was left


class SearchPlan(Plan):
    """The runs drawn so far; those that no method chose come first."""

    def __init__(
        self,
        campaign: Campaign,
        source: str,
        asked: Asked,
        requirements: Sequence[Requirement],
        trust: Trust | None = None,
    ) -> None:
        """Raise BadInput for a space without a number, or a key of ``against`` that varies.

        requirements : those asked for; what settles ties is also measured
        """
        tables = [each.model_dump(exclude_none=True) for each in (*requirements, *beside(requirements))]
        own = {"sampling": "random", "runs": asked.flights, "seed": asked.seed, "requirements": tables}
        drawn = campaign.model_copy(update=own)
        super().__init__(drawn, source, trust)
        self.asked, self.of_one_draw, self.arms = asked, asked.of_one_draw, arms(campaign, source)
        self._against = {} if asked.against is None else dict([parse_against(asked.against)])
        for key in self._against:
            if key in dict(campaign.varied()) or key in campaign.cases:
                raise BadInput(f"--against {key}: varies in the campaign; choose a key that all flights share")
        self.draws: list[Draw] = []
        self.choices = []
        self.add(next(self.schedule()))
        self.random = len(self.draws)

    def schedule(self, **of_method: Any) -> Schedule:
        """Return the draws of the method, from the first one; ``of_method``: its own keywords."""
        return METHODS[self.asked.method](self.arms, self.most_draws, self.asked.seed, **of_method)

    def search(
        self, rows_of: Callable[[list[int]], list[Row]], told: Callable[[list[Measured]], None], **of_method: Any
    ) -> Searched:
        """Draw to the end, a round after the other.

        rows_of : returns the rows of runs by their numbers; told : gets all results so far after each round
        """
        ids: tuple[str, ...] = ()
        results: list[Measured] = []

        def results_of(draws: list[Draw]) -> list[Measured]:
            nonlocal ids
            rows = rows_of(self.add(draws) if results else list(range(len(self.choices))))  # it has the first ones
            of_draws = self.by_draw(rows)
            ids = ids or deciding(of_draws, self.asked.requirements)  # the draws that no method chose come first
            results.extend(new := [measured(of_draw, ids) for of_draw in of_draws])
            told(results)
            return new

        standing = drive(self.schedule(**of_method), results_of)
        return Searched(ids, results, standing)

    def by_draw(self, rows: Sequence[Row]) -> list[Sequence[Row]]:
        """Return the rows of flights, those of each draw together."""
        return [rows[i : i + self.of_one_draw] for i in range(0, len(rows), self.of_one_draw)]

    @property
    def most_draws(self) -> int:
        """Return the number of draws for which the flights are enough."""
        return self.asked.flights // self.of_one_draw

    def __len__(self) -> int:
        return self.asked.flights

    def add(self, draws: list[Draw]) -> list[int]:
        """Add the flights of ``draws``; return their numbers."""
        before = len(self.choices)
        for draw in draws:
            choice = self.arms[draw.arm].choice(draw.point)
            self.choices += [choice, {**choice, **self._against}][: self.of_one_draw]
        self.draws += draws
        return list(range(before, len(self.choices)))

    def value_types(self) -> dict[str, set[type]]:
        """Return the types of all possible values."""
        return types_of(self.campaign, self._against)

    def check(self) -> None:
        """Build the scenarios of all random flights.  BadInput names the file or the option, and the key."""
        self._check(self[0])
        if self._against:
            try:
                self._check(self[1])
            except BadInput as error:
                reason = str(error).removeprefix(f"{self.source}: run 1: ")
                raise BadInput(f"--against {self.asked.against}: {reason}") from None
        super().check()

    @property
    def _named(self) -> list[int]:
        """Return runs that together have every manager: the second run of a draw has that of ``against``."""
        return [number + i for number in super()._named for i in range(self.of_one_draw)]

    def identity(self) -> dict[str, Any]:
        """Return everything that decides the table."""
        asked = {**asdict(self.asked), "requirements": list(self.asked.requirements)}
        return {**super().identity(), SEARCH: {**asked, **decides(self.asked.method)}}


class ConfirmPlan(Plan):
    """The flights of scenarios that the search found or shrank; none belongs to the search itself."""

    def __init__(self, search: SearchPlan) -> None:
        super().__init__(search.campaign, search.source, search.trust)
        self.choices = []
        made = search.identity()
        self._identity = {**made, SEARCH: {**made[SEARCH], "confirms": True}}

    def __len__(self) -> int:
        return MOST_CONFIRMING

    def add(self, scenarios: list[dict[str, Any]]) -> list[int]:
        """Add flights of whole scenarios, with their seeds; return their numbers."""
        before = len(self.choices)
        self.choices += [{SCENARIO: json.dumps(scenario, sort_keys=True)} for scenario in scenarios]
        return list(range(before, len(self.choices)))

    def value_types(self) -> dict[str, set[type]]:
        """Return the type of the one column."""
        return {SCENARIO: {str}}

    def data(self, number: int) -> dict[str, Any]:
        """Return the table of a flight's scenario."""
        return dict(json.loads(self.choices[number][SCENARIO]))

    def seed(self, number: int) -> int:
        """Return the seed in the table of a flight."""
        return int(self.data(number)["seed"])

    def identity(self) -> dict[str, Any]:
        """Return the identity of the search, with a mark."""
        return self._identity


def parse_against(text: str) -> tuple[str, Any]:
    """Return key and value of ``--against``."""
    try:
        return parse_set(text)
    except BadInput as error:
        raise BadInput(str(error).replace("--set", "--against", 1)) from None
