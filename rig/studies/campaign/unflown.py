"""Runs that could not be flown: a table tells why, they do not count as done, and the next command flies them again."""

from __future__ import annotations

from typing import Any, Final

import polars as pl

from rig.studies.campaign import table_parts as parts
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.tables import TABLES

OUTCOMES: Final = ("crashed", "timed out", "failed", "unit dead", "unit refused")  # of a run that was not flown


def not_flown(runs: pl.DataFrame) -> dict[str, Any]:
    """Return how many runs of a table were not flown, and of the first its number, outcome and reason."""
    rows = runs.filter(pl.col("outcome").is_in(OUTCOMES)).sort("run")  # an open-loop trial is none
    first = None if rows.is_empty() else f"run {rows['run'][0]}: {rows['outcome'][0]}: {rows['reason'][0]}"
    return {"not_flown": len(rows), "first_reason": first}


def take_out(folder: Folder, below: int) -> set[int]:
    """Take the rows of runs that were not flown out of the tables, those ``below`` a number; return the runs that stay.

    The folder is held.  A part that has others too is written again with the others; a kill between the two costs the
    time of these.  BadInput as ``Folder.done``.
    """
    tables = folder.read()
    runs = tables["runs"]
    again = set(runs.filter((pl.col("outcome") != "flown") & (pl.col("run") < below))["run"].to_list())
    for name in parts.names(folder.path) if again else ():
        path = folder.path / "runs" / f"{name}.parquet"
        there = set(pl.read_parquet(path.read_bytes(), columns=["run"])["run"].to_list())
        if there & again:
            path.unlink()
            if kept := there - again:
                folder.write({kind: tables[kind].filter(pl.col("run").is_in(kept)).to_dicts() for kind in TABLES})
    return set(runs["run"].to_list()) - again
