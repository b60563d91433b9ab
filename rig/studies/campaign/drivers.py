"""The sensitivity of a result of a campaign, a column of its tables, to every key that the campaign varied."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, Final

import numpy as np
import polars as pl

from rig.core.column import Column
from rig.core.errors import BadInput
from rig.core.text import choices
from rig.studies.campaign.folder import Folder
from rig.studies.campaign.group_rates import DELAYS, Tables, flown
from rig.studies.campaign.pawn import DUMMY, RESAMPLES, SLICES, Codes, indices, slices
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.tables import FAULTS, RUNS
from rig.studies.campaign.varied import varied
from rig.verdict.requirements.robustness import number_of

LEAST: Final = 40  # flights with the output
MOST_NAMES: Final = 50  # levels of an input that is no number
_SHORT: Final = {"delay_s": DELAYS[0]}
_NUMBERS: Final = (int, float, bool)
_NO_RESULT: Final = ("run", "seed", "wall_s", "fault", "channel")
COLUMNS: Final = (
    *(Column("input", "name", type=str), Column("groups", worth=5), Column("rows", worth=6)),
    *(Column("index", format=".3f"), Column("95 %", lambda row: f"{row['low']:.3f} to {row['high']:.3f}", worth=8)),
    *(Column("noise floor", "floor", ".3f"), Column("largest", format=".3f", worth=4)),
    Column("above the floor", lambda row: row["verdict"]),
)


def sensitivity(folder: Folder, of: str, seed: int = 0) -> dict[str, Any]:
    """Return the indices of what a campaign varied for an output, as plain data.

    of : a column of numbers of ``runs``, or of ``faults`` (the largest of the flight's faults), or a requirement, of
        which it is the least robustness
    BadInput: no flight has it, it is constant, too few flights have it, nothing varies.
    """
    tables, plan = folder.tables, folder.plan
    runs = flown(tables).join(output(tables, plan, of), on="run", how="left").sort("run")
    has = runs.filter(pl.col("output").is_not_null() & pl.col("output").is_finite())
    if len(has) < LEAST:
        raise BadInput(f"{folder.path}: {of}: {len(has)} of {len(runs)} flights have it; {LEAST} are needed")
    values = has["output"].to_numpy()
    if values.min() == values.max():
        raise BadInput(f"{folder.path}: {of}: is {values[0]:g} in all {len(has)} flights that have it")
    given = dict(inputs(has, plan))
    used = {name: codes for name, codes in given.items() if codes is not None and len(np.unique(codes[codes >= 0])) > 1}
    if not used:
        raise BadInput(f"{folder.path}: varies nothing that could drive {of}")
    found = indices(used, values, seed)
    return {
        "folder": str(folder.path),
        "of": of,
        "flights": len(runs),
        "rows": len(has),
        "left_out": len(runs) - len(has),
        "left_out_inputs": sorted(given.keys() - used.keys()),
        **{"method": "PAWN", "slices": SLICES, "resamples": RESAMPLES, "seed": seed},
        "inputs": [{**asdict(each), "verdict": _verdict(each.name, each.is_above_floor)} for each in found],
    }


def _verdict(name: str, is_above: bool) -> str:
    return "" if name == DUMMY else "yes" if is_above else "no"


def inputs(runs: pl.DataFrame, plan: Plan) -> Iterator[tuple[str, Codes | None]]:
    """Yield every key that varies, with the groups of the runs; None for one of too many names."""
    for key in varied(plan):
        column = runs[key]
        if column.dtype.is_numeric():
            yield key, slices(column.cast(pl.Float64).fill_null(np.nan).to_numpy())
            continue
        levels = column.drop_nulls().unique().sort()
        codes = column.cast(pl.String).replace_strict(
            levels.cast(pl.String), np.arange(len(levels)), default=-1, return_dtype=pl.Int64
        )
        yield key, codes.to_numpy() if len(levels) <= MOST_NAMES else None


def outputs(plan: Plan) -> list[str]:
    """Return the names of all outputs that the flights of a plan have."""
    chosen = {*varied(plan), *_NO_RESULT}
    names = [name for of in (RUNS, FAULTS) for name, column in of.items() if column.type in _NUMBERS]
    return [*_SHORT, *dict.fromkeys(name for name in names if name not in chosen), *(r.id for r in plan.requirements)]


def output(tables: Tables, plan: Plan, of: str) -> pl.DataFrame:
    """Return ``run`` and ``output`` of the runs that have an output.  BadInput: no flight has it."""
    known = outputs(plan)
    if of not in known:
        raise BadInput(f"--of {of}: no flight has this column; {choices(of, known)}")
    name = _SHORT.get(of, of)
    if name in (each.id for each in plan.requirements):
        rows = [(run, _least(text, name)) for run, text in tables["runs"].select("run", "requirements").rows()]
        return pl.DataFrame(rows, schema={"run": pl.Int64, "output": pl.Float64}, orient="row")
    table = tables["runs"] if name in RUNS else tables["faults"]
    return table.group_by("run").agg(output=pl.col(name).cast(pl.Float64).max())


def _least(verdicts: str | None, requirement: str) -> float | None:
    """Return the least robustness of a requirement in a run, from its ``requirements``."""
    mine = [v["robustness"] for v in json.loads(verdicts or "[]") if v["requirement"] == requirement]
    return min((margin for each in mine if each is not None and (margin := number_of(each)) is not None), default=None)
