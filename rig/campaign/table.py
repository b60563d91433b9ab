"""The campaign's tables: their columns, their parts as one, their hash.

runs      one row a run
faults    one row a fault and channel of a run
alarms    one row a healthy channel that was failed in a run
episodes  one row a stretch of a run in which a signal had one pattern without a majority
signals   one row a signal of a run
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import fields
from functools import lru_cache
from typing import Any, Final

import numpy as np
import polars as pl

from rig.campaign import requirements, servos
from rig.campaign.plan import Plan
from rig.campaign.rows import OUTCOMES, TABLES, Row
from rig.frame import CHANNELS
from rig.record.flight_summary import Peaks
from rig.record.histogram import names

WALL_CLOCK: Final = ("wall_s", "replies")  # no part of what must be the same in every run of a campaign
COUNTED: Final = ("failed_with_box", "failed_by_rule")  # in ``alarms`` too, which are hashed
SUSPECTS: Final = "suspect_channels"  # in ``digest`` too
OF_SERVOS: Final = tuple(servos.RUNS)  # in ``digest`` too
MEASURED: Final = tuple(requirements.RUNS)  # hashed where a campaign has requirements
ADDED: Final = (
    "replies",
    *COUNTED,
    SUSPECTS,
    *OF_SERVOS,
    *MEASURED,
    "wrong_vote_first",
    "law_s",
)  # columns that parts of older versions lack; they are then empty

RUNS: Final[dict[str, Any]] = {
    "run": pl.Int64,
    "seed": pl.Int64,
    "aircraft": pl.String,
    "flight_point": pl.String,
    "manager": pl.String,
    "outcome": pl.String,  # flown, crashed, timed out, failed, unit dead, unit refused
    "reason": pl.String,  # of one that was not flown
    "digest": pl.String,
    "frames": pl.Int64,
    "duration_s": pl.Float64,
    "survived": pl.Boolean,
    "end_reason": pl.String,
    **{field.name: pl.Float64 for field in fields(Peaks)},
    **dict.fromkeys(OUTCOMES.values(), pl.Int64),
    "false_alarms": pl.Int64,
    "wrong_isolations": pl.Int64,
    "channel_hours": pl.Float64,
    "vote_above_threshold_s": pl.Float64,
    "unresolved": pl.Int64,  # episodes
    "out_of_limits_s": pl.Float64,  # against the twin, where it was flown
    "coverage": pl.String,  # JSON
    "wall_s": pl.Float64,
    "replies": pl.List(pl.Int64),  # reply times of a unit under test in each bin of record.histogram; empty without one
    **dict.fromkeys(COUNTED, pl.Int64),  # healthy channels, for a fault elsewhere
    SUSPECTS: pl.Int64,  # channels that were suspect in many frames and never failed
    **servos.RUNS,
    **requirements.RUNS,
}
FAULTS: Final[dict[str, Any]] = {
    "run": pl.Int64,
    "fault": pl.Int64,  # its place in the scenario, from 0
    "id": pl.String,
    "signal": pl.String,
    "channel": pl.Int64,
    "kind": pl.String,
    "magnitude": pl.Float64,
    "onset_s": pl.Float64,
    "exceeded_s": pl.Float64,
    "failed_s": pl.Float64,
    "outcome": pl.String,  # detected, missed, undetectable, not executed
    "delay_from_onset_s": pl.Float64,
    "delay_from_exceeded_s": pl.Float64,
    "isolation": pl.String,  # right, wrong, none
    "resolver": pl.String,
    "pattern": pl.String,
    "good_before": pl.Int64,
    "latent_before": pl.Int64,
    "vote_above_threshold_s": pl.Float64,  # these five from its onset to the next one on the signal
    "vote_error_max": pl.Float64,
    "vote_kept": pl.Boolean,
    "lost_s": pl.Float64,
    "wrong_vote_first": pl.Boolean,  # before the signal was declared lost
    "law_s": pl.Float64,  # the fault-tolerant law found it
}
ALARMS: Final[dict[str, Any]] = {
    "run": pl.Int64,
    "kind": pl.String,  # false alarm, wrong isolation, failed with its box, failed by rule
    "signal": pl.String,
    "channel": pl.Int64,
    "time_s": pl.Float64,
    "resolver": pl.String,
}
EPISODES: Final[dict[str, Any]] = {
    "run": pl.Int64,
    "signal": pl.String,
    "pattern": pl.String,
    "begin_s": pl.Float64,
    "frames": pl.Int64,
    "asked": pl.List(pl.String),
    "resolver": pl.String,  # whose answer stood at its end; unresolved when nobody's
    "failed": pl.List(pl.Int64),
    "verdict": pl.String,  # right, wrong, open
}
_LEVELS: Final = range(CHANNELS, 0, -1)
OF_SIGNALS: Final[dict[str, Any]] = {
    "run": pl.Int64,
    "signal": pl.String,
    "vote_above_threshold_s": pl.Float64,
    "vote_error_max": pl.Float64,
    "level_at_end": pl.Int64,
    "lost_s": pl.Float64,
    "unresolved_s": pl.Float64,
    **{f"channel_hours_level_{level}": pl.Float64 for level in _LEVELS},
    **{f"false_isolations_level_{level}": pl.Int64 for level in _LEVELS},
}
COLUMNS: Final = dict(zip(TABLES, (RUNS, FAULTS, ALARMS, EPISODES, OF_SIGNALS), strict=True))
_ORDER: Final = {
    "runs": ["run"],
    "faults": ["run", "fault", "channel"],
    "alarms": ["run", "time_s", "signal", "channel"],
    "episodes": ["run", "begin_s", "signal"],
    "signals": ["run"],
}


def varied_columns(plan: Plan) -> dict[str, Any]:
    """Return the columns of what varies: a key of the scenario or a group of cases each, typed by all their values."""
    return {key: _type(types) for key, types in plan.value_types().items() if key not in RUNS}


def _type(types: set[type]) -> Any:
    if types <= {int, float}:
        return pl.Int64 if types == {int} else pl.Float64
    return pl.Boolean if types == {bool} else pl.String


@lru_cache(maxsize=16)
def schema(plan: Plan, table: str) -> dict[str, Any]:
    """Return column names and types of one table; ``runs`` has what varies behind its number and seed."""
    if table != "runs":
        return COLUMNS[table]
    first = {"run": RUNS["run"], "seed": RUNS["seed"]}
    return {**first, **varied_columns(plan), **{k: v for k, v in RUNS.items() if k not in first}}


def frame(plan: Plan, table: str, rows: Sequence[Row]) -> pl.DataFrame:
    """Build a typed table of rows, what varies written beside them."""
    columns = schema(plan, table)
    if table == "runs":
        rows = [{**plan.choices[row["run"]], **row} for row in rows]
    return pl.DataFrame([{n: cell(row.get(n), kind) for n, kind in columns.items()} for row in rows], schema=columns)


def cell(value: Any, kind: Any) -> Any:
    """Convert a value of a column; one that varies may be of several kinds, and is then written as JSON."""
    as_it_is = value is None or isinstance(value, str) or kind != pl.String
    return value if as_it_is else json.dumps(value, sort_keys=True)


def joined(table: str, frames: Sequence[pl.DataFrame]) -> pl.DataFrame:
    """Join the parts of one table, in the order of the runs."""
    if not frames:
        return pl.DataFrame(schema=COLUMNS[table])
    return pl.concat(frames).sort(_ORDER[table], maintain_order=True)


def sha256(tables: dict[str, pl.DataFrame]) -> str:
    """Compute one hash of all tables: sorted rows, every number exactly; no wall clock, no count of what is there."""
    digest = hashlib.sha256()
    for name in TABLES:
        plain = tables[name].drop(*WALL_CLOCK, *COUNTED, SUSPECTS, *OF_SERVOS, strict=False)
        plain = plain.drop(*(each for each in MEASURED if each in plain.columns and plain[each].is_null().all()))
        digest.update(json.dumps([name, plain.columns, [str(t) for t in plain.dtypes]]).encode())
        for row in plain.iter_rows():
            digest.update(json.dumps(row, allow_nan=False).encode())
    return digest.hexdigest()


def replies(runs: pl.DataFrame) -> dict[str, Any] | None:
    """Add up the reply times of a unit under test over all frames of all runs, by histogram.py; None without one."""
    counted = runs["replies"].drop_nulls()
    if counted.is_empty():
        return None
    counts = np.sum([bins.to_numpy() for bins in counted], axis=0)
    return {"runs": len(counted), "frames": int(counts.sum()), "bins_us": names(), "counts": counts.tolist()}
