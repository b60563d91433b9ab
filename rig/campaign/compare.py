"""Two campaigns on the same seeds, run by run: what changes when one thing differs, a manager say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import polars as pl

from rig.campaign.folder import Folder, difference
from rig.campaign.statistics import mcnemar, proportion
from rig.errors import BadInput

_BY_RUN: dict[str, Callable[[], pl.Expr]] = {
    "survived": lambda: pl.col("survived"),
    "no false alarm": lambda: pl.col("false_alarms") == 0,
    "no wrong isolation": lambda: pl.col("wrong_isolations") == 0,
    "no fault missed": lambda: pl.col("missed") == 0,
}
_BY_FAULT: dict[str, Callable[[], pl.Expr]] = {
    "fault detected": lambda: pl.col("outcome") == "detected",
    "fault rightly isolated": lambda: pl.col("isolation") == "right",
}


def compare(first: Folder, second: Folder) -> dict[str, Any]:
    """Paired outcomes of the runs that both have flown. BadInput when their seeds are not the same."""
    runs = _paired(first, second, "runs", ["run"], _BY_RUN)
    if runs.is_empty():
        raise BadInput(f"{first.path} and {second.path} have no flown run in common")
    if (runs["seed"] != runs["seed_second"]).any():
        raise BadInput(f"{first.path} and {second.path} were not flown on the same seeds; nothing can be paired")
    faults = _paired(first, second, "faults", ["run", "fault", "channel"], _BY_FAULT)
    faults = faults.filter((pl.col("outcome") != "not executed") & (pl.col("outcome_second") != "not executed"))
    return {
        "first": str(first.path),
        "second": str(second.path),
        "differs": difference(first.plan.identity(), second.plan.identity()),
        "runs": len(runs),
        "faults": len(faults),
        "outcomes": [
            *(_tested(runs, name, "run") for name in _BY_RUN),
            *(_tested(faults, name, "fault") for name in _BY_FAULT),
        ],
    }


def _paired(
    first: Folder, second: Folder, table: str, on: list[str], tests: dict[str, Callable[[], pl.Expr]]
) -> pl.DataFrame:
    named = [expression().alias(name) for name, expression in tests.items()]
    parts = []
    for folder in (first, second):
        rows = folder.tables[table]
        rows = (
            rows.filter(pl.col("outcome") == "flown")
            if table == "runs"
            else rows.filter(pl.col("channel").is_not_null())
        )
        keep = [*on, "outcome", *(["seed"] if table == "runs" else [])]
        parts.append(rows.select(*keep, *named))
    return parts[0].join(parts[1], on=on, how="inner", suffix="_second")


def _tested(pairs: pl.DataFrame, name: str, unit: str) -> dict[str, Any]:
    a, b = pairs[name].to_numpy().astype(bool), pairs[f"{name}_second"].to_numpy().astype(bool)
    return {
        "outcome": name,
        "unit": unit,
        "first": asdict(proportion(int(a.sum()), len(a))),
        "second": asdict(proportion(int(b.sum()), len(b))),
        "pairs": asdict(mcnemar(a, b)),
    }
