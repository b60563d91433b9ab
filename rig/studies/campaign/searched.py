"""The plan of a folder that a search wrote: the values come from the table, not from the campaign's draws."""

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
        """Raise BadInput for a folder of open-loop trials or confirming flights, whose runs are not the campaign's.

        search : of ``campaign.json``
        """
        super().__init__(campaign, source, trust)
        if not isinstance(search, dict) or search.get("bench") or search.get("confirms"):
            raise BadInput(f"{source}: contains open-loop trials or confirming flights; only rig search reads them")
        against = search.get("against")
        self._against = {} if against is None else dict([parse_set(against)])
        self.of_one_draw = 2 if self._against else 1
        self._types = types_of(campaign, self._against)

    def value_types(self) -> dict[str, set[type]]:
        """Return the types of all values that a search may choose."""
        return self._types

    def choose(self, runs: pl.DataFrame) -> None:
        """Return the choices from the table of runs; runs that are not flown yet have empty ones."""
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
    """Return the types of each key's values in the order of the campaign, then of the key of every second flight."""
    types: dict[str, set[type]] = {group: {str} for group in campaign.cases}
    for key, vary in campaign.varied():
        listed = {*map(type, vary.values)} if isinstance(vary, Levels) else set()
        number = {int if isinstance(vary, Range) and vary.whole else float}
        types[key] = types.get(key, set()) | (listed or number)
    return types | {key: {type(value)} for key, value in against.items()}


def _value(held: Any, listed: Sequence[Any], kind: Any) -> Any:
    """Return the value of the file from its cell in the table."""
    return next((value for value in listed if table.cell(value, kind) == held), held)
