"""The keys that vary between the runs of a campaign, and the outcomes of faults and runs at each level."""

from __future__ import annotations

from typing import Any, Final

import polars as pl

from rig.studies.campaign.group_rates import (
    DELAYS,
    MOST_LEVELS,
    OF_RUN,
    Tables,
    acted,
    alarm_rate,
    fault_rates,
    flown,
    quantiles,
    share_of,
)
from rig.studies.campaign.plan import Plan

# Settings of the flown system are told apart even if they are numbers or lists; settings of faults are not.
_FLOWN: Final = ("redundancy.", "control.", "actuators.", "computers.")
_TOLD: Final = ("aircraft", "flight_point", "manager")  # columns of every run
_OF_FAULTS: Final = ("signal", "kind", "id")  # settings of a fault that its row has


def varied(plan: Plan) -> list[str]:
    """Return the keys that vary between the runs."""
    return list(dict.fromkeys(key for choice in plan.choices for key in choice))


def by_name(plan: Plan, runs: pl.DataFrame) -> list[str]:
    """Return the columns of ``runs`` that vary by name, whose flights are not one population."""
    types, chosen = plan.value_types(), varied(plan)
    names = [key for key in chosen if _is_name(key, types.get(key, set())) and key in runs.columns]
    if "redundancy.manager" in names:
        names.remove("redundancy.manager")  # the column has it, and a unit's name
    several = [name for name in _TOLD if name not in names and runs[name].drop_nulls().n_unique() > 1]
    return [*several, *names]


def _is_name(key: str, types: set[type]) -> bool:
    """Return True for a key whose values are names, or settings of the flown system."""
    first, _, last = key.rpartition(".")
    if first.startswith("faults") and last in _OF_FAULTS:
        return False
    return types <= {str, bool} or (key.startswith(_FLOWN) and float not in types)


def by_varied(tables: Tables, plan: Plan) -> list[dict[str, Any]]:
    """Return detection, delay, survival and false alarms at every level of a key that varies by name or few numbers.

    Each of several managers has its rows: ``of``.
    detection counts the faults whose error exceeded the threshold, which depends on the manager; detection_of_all
    counts every fault that acted, the same faults at each level if the campaign is a grid.
    """
    runs, named = flown(tables), by_name(plan, tables["runs"])
    columns = dict.fromkeys([*named, *(key for key in varied(plan) if key != "redundancy.manager")])
    columns = [column for column in columns if column in runs.columns]
    faults = acted(tables, [*columns, *([] if "manager" in columns else ["manager"])])
    several, rows = "manager" in named, []
    for column in columns:
        levels = runs[column].drop_nulls().unique().sort()
        if len(levels) < 2 or (len(levels) > MOST_LEVELS and column not in named):
            continue
        by = [column, "manager"] if several and column != "manager" else [column]
        for (level, *of), part in runs.filter(pl.col(column).is_not_null()).sort(by).group_by(by, maintain_order=True):
            here = pl.all_horizontal(
                pl.col(f"{OF_RUN}{name}") == value for name, value in zip(by, (level, *of), strict=True)
            )
            rows.append({"key": column, "level": level, "of": "".join(of), **_at_level(part, faults.filter(here))})
    return rows


def _at_level(runs: pl.DataFrame, faults: pl.DataFrame) -> dict[str, Any]:
    found = faults.filter(pl.col("outcome") == "detected")
    return {
        "runs": len(runs),
        "survival": share_of(runs["survived"]),
        "false_alarms": alarm_rate(runs),
        **fault_rates(faults),
        **{name: quantiles(found[name].drop_nulls()) for name in DELAYS},
    }
