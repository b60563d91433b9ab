"""The plan of a folder that a search wrote: its choices are those of the table, not those of the campaign's draws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from rig.core.errors import BadInput
from rig.core.trust import Trust
from rig.scenario.overrides import parse_set
from rig.studies.campaign import tables as table
from rig.studies.campaign.campaign_file import Campaign, Levels, Range
from rig.studies.campaign.plan import Plan


class SearchedPlan(Plan):
    """A campaign whose runs a search chose."""

    def __init__(self, campaign: Campaign, source: str, trust: Trust, search: Any) -> None:
        """BadInput: a folder of open-loop trials or of confirming flights, whose runs are no flights of the campaign.

        search : of ``campaign.json``
        """
        super().__init__(campaign, source, trust)
        if not isinstance(search, dict) or search.get("bench") or search.get("confirms"):
            raise BadInput(f"{source}: holds open-loop trials or confirming flights of a search: rig search reads them")
        against = search.get("against")
        self._against = {} if against is None else dict([parse_set(against)])
        self.of_one_draw = 2 if self._against else 1
        self._types = types_of(campaign, self._against)

    def value_types(self) -> dict[str, set[type]]:
        """Return the types of all values that a search may choose."""
        return self._types

    def choose(self, runs: pl.DataFrame) -> None:
        """Take the choices out of the table of runs; those that are not flown yet are empty."""
        keys = [key for key in self._types if key in runs.columns]
        flown = {row["run"]: row for row in runs.select("run", *keys).iter_rows(named=True)}
        listed = {key: vary.values for key, vary in self.campaign.varied() if isinstance(vary, Levels)}
        listed |= {key: [value] for key, value in self._against.items()}
        kinds, most = table.varied_columns(self), len(self)
        self.choices = [
            {key: _value(row[key], listed.get(key, ()), kinds[key]) for key in row if row[key] is not None}
            for row in ({key: flown[number][key] for key in keys} if number in flown else {} for number in range(most))
        ]


def types_of(campaign: Campaign, against: Mapping[str, Any]) -> dict[str, set[type]]:
    """Return the types of each key's values in the order of the campaign, then of what every second flight has."""
    types: dict[str, set[type]] = {group: {str} for group in campaign.cases}
    for key, vary in campaign.varied():
        listed = {*map(type, vary.values)} if isinstance(vary, Levels) else set()
        number = {int if isinstance(vary, Range) and vary.whole else float}
        types[key] = types.get(key, set()) | (listed or number)
    return types | {key: {type(value)} for key, value in against.items()}


def _value(held: Any, listed: Sequence[Any], kind: Any) -> Any:
    """Return a value of the file by the cell that it became."""
    return next((value for value in listed if table.cell(value, kind) == held), held)
