"""Yes or no of every flight of a campaign, as trials of one proportion, in groups.

A flight is at most one trial of a group: the faults of one flight are not independent.  A flight that could not be
flown, or to which the question does not apply, is none.
"""

from __future__ import annotations

import json
from typing import Final

import polars as pl

from rig.core.errors import BadInput
from rig.core.text import choices
from rig.studies.campaign.group_rates import Tables, acted, flown
from rig.studies.campaign.plan import Plan
from rig.studies.campaign.tables import COUNTED, FAULTS, RUNS, SUSPECTS
from rig.studies.campaign.varied import varied

_DETECTABLE: Final = pl.col("outcome") != "undetectable"
_BY_FAULT: Final = {  # faults that count, and of each yes or no; true of a flight if it is of every one in the group
    "detected": (_DETECTABLE, pl.col("outcome") == "detected"),
    "detected_of_all": (pl.lit(True), pl.col("outcome") == "detected"),  # undetectable ones too
    "correctly_isolated": (_DETECTABLE, pl.col("isolation") == "correct"),
}
_FLAGS: Final = ("survived",)
_COUNTS: Final = ("missed", "false_alarms", "wrong_isolations", "unresolved", *COUNTED, SUSPECTS)  # true above 0
_VIOLATED: Final = "violated"  # a count too, of a campaign with requirements
_OF_FAULTS: Final = ("signal", "kind", "pattern")  # columns of faults that make groups
_OF_RUNS: Final = ("aircraft", "flight_point", "manager")
assert {*_FLAGS, *_COUNTS, _VIOLATED, *_OF_RUNS} <= RUNS.keys() and {*_OF_FAULTS} <= FAULTS.keys()


def require_names(plan: Plan, of: str, by: str | None) -> None:
    """Raise BadInput for an ``--of`` or ``--by`` that no flight of a plan has."""
    asked = [each.id for each in plan.requirements]
    known = [*_BY_FAULT, *_FLAGS, *_COUNTS, *([_VIOLATED, *asked] if asked else [])]
    if of not in known:
        raise BadInput(f"--of {of}: no flight has this column; {choices(of, known)}")
    groups = [*_OF_FAULTS, *_OF_RUNS, *varied(plan)]
    if by is not None and by not in groups:
        raise BadInput(f"--by {by}: no flight has this column; {choices(by, groups)}")


def trials(tables: Tables, of: str, by: str | None = None) -> pl.DataFrame:
    """Return the columns ``run``, ``group`` (text; empty without ``by``) and ``yes``, sorted by run and group."""
    by_fault = of in _BY_FAULT
    found = _of_faults(tables, of, by) if by_fault else _grouped(tables, by).join(_of_runs(tables, of), on="run")
    return found.select("run", "group", "yes").drop_nulls().sort("run", "group")


def _of_faults(tables: Tables, of: str, by: str | None) -> pl.DataFrame:
    counts, yes = _BY_FAULT[of]
    faults = acted(tables).filter(counts).with_columns(yes=yes)
    faults = faults.join(flown(tables).select("run"), on="run")
    if by in _OF_FAULTS:
        return faults.group_by("run", group=pl.col(by).cast(pl.String)).agg(pl.col("yes").all())
    return _grouped(tables, by).join(faults.group_by("run").agg(pl.col("yes").all()), on="run")


def _of_runs(tables: Tables, of: str) -> pl.DataFrame:
    """Return ``run`` and ``yes`` of the flights to which a column of ``runs``, or a requirement, applies."""
    runs = flown(tables)
    if of in _FLAGS:
        return runs.select("run", yes=of)
    if of in runs.columns:
        return runs.select("run", yes=pl.col(of) > 0)
    rows = [(run, met(text, of)) for run, text in runs.select("run", "requirements").drop_nulls().rows()]
    return pl.DataFrame(rows, schema={"run": pl.Int64, "yes": pl.Boolean}, orient="row")


def met(verdicts: str, requirement: str) -> bool | None:
    """Return whether a flight meets a requirement on every signal, from its ``requirements``; None: not applicable."""
    mine = [v for v in json.loads(verdicts) if v["requirement"] == requirement and v["robustness"] is not None]
    return all(verdict["status"] == "met" for verdict in mine) if mine else None


def _grouped(tables: Tables, by: str | None) -> pl.DataFrame:
    """Return ``run`` and ``group``: a flight with faults on two signals is in the groups of both."""
    runs = flown(tables)
    if by is None:
        return runs.select("run", group=pl.lit(""))
    named = (tables["faults"] if by in _OF_FAULTS else runs).select("run", group=pl.col(by).cast(pl.String))
    return named.join(runs.select("run"), on="run").drop_nulls().unique()
