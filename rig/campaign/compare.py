"""Two campaigns on the same seeds, run by run: what changes when one thing differs, a manager say."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, Final

import polars as pl

from rig.campaign.folder import Folder, difference
from rig.campaign.statistics import mcnemar, proportion
from rig.errors import BadInput

_BY_RUN: Final = {
    "survived": pl.col("survived"),
    "no false alarm": pl.col("false_alarms") == 0,
    "no wrong isolation": pl.col("wrong_isolations") == 0,
    "no fault missed": pl.col("missed") == 0,
}
_BY_FAULT: Final = {
    "fault detected": pl.col("outcome") == "detected",
    "fault rightly isolated": pl.col("isolation") == "right",
}


def compare(first: Folder, second: Folder) -> dict[str, Any]:
    """Paired outcomes of the runs that both have flown. BadInput when their seeds are not the same."""
    (runs, faults), (other_runs, other_faults) = _tables(first), _tables(second)
    runs = runs.join(other_runs, on=["run"], suffix="_second")
    if runs.is_empty():
        raise BadInput(f"{first.path} and {second.path} have no flown run in common")
    if (runs["seed"] != runs["seed_second"]).any():
        raise BadInput(f"{first.path} and {second.path} were not flown on the same seeds; nothing can be paired")
    faults = faults.join(other_faults, on=["run", "fault", "channel"], suffix="_second")
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


def _tables(folder: Folder) -> tuple[pl.DataFrame, pl.DataFrame]:
    """The runs that were flown and the faults on channels, with the outcomes that are compared."""
    runs = folder.tables["runs"].filter(pl.col("outcome") == "flown")
    faults = folder.tables["faults"].filter(pl.col("channel").is_not_null())
    return runs.with_columns(**_BY_RUN), faults.with_columns(**_BY_FAULT)


def _tested(pairs: pl.DataFrame, name: str, unit: str) -> dict[str, Any]:
    a, b = pairs[name].to_numpy().astype(bool), pairs[f"{name}_second"].to_numpy().astype(bool)
    return {
        "outcome": name,
        "unit": unit,
        "first": asdict(proportion(int(a.sum()), len(a))),
        "second": asdict(proportion(int(b.sum()), len(b))),
        "pairs": asdict(mcnemar(a, b)),
    }
