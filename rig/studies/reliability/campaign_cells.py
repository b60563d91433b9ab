"""Read the cells of a folder: a flown campaign `reliability`, which is counted here, or open-loop trials.

A folder of trials holds the draws and the outcomes:

trials.json               campaign, seed, number, manager, versions; written last: a folder without it is unfinished
cells.parquet             tally.COUNTS
false_isolations.parquet  tally.FALSE_ISOLATIONS
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.core import sealed
from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.core.frame import CHANNELS
from rig.core.notes import note
from rig.core.outputs import TRIALS
from rig.studies.campaign.folder import open_folder
from rig.studies.campaign.study_folder import FORMAT, UNSEALED
from rig.studies.reliability.tally import (
    CELL,
    COUNTS,
    DESIGNS,
    FALSE_ISOLATIONS,
    OUTCOMES,
    SECOND,
    TESTED,
    Cells,
    counted,
    declared_lost,
    of_kinds,
)

_SUMS: Final = ("trials", *OUTCOMES, "announced", "level", "channel_hours", "events")
_REMEDY: Final = "run the trials again into another folder"
TABLES: Final = {"cells": COUNTS, "false_isolations": FALSE_ISOLATIONS}


def cells(folder: Path) -> Cells:
    """Count a flown campaign `reliability`, or read a folder of trials.  BadInput: the folder is neither."""
    return read_trials(folder) if is_file(folder / TRIALS) else of_tables(open_folder(folder).tables, str(folder))


def of_tables(tables: dict[str, pl.DataFrame], source: str) -> Cells:
    """Count the tables of a campaign; an error names ``source``."""
    runs = tables["runs"].filter(pl.col("outcome") == "flown")
    planned = of_kinds(tables["faults"], runs)
    faults = planned.filter((pl.col("outcome") != "not executed") & pl.col("good_before").is_not_null())
    lacking = [column for column in ("design", "condition") if column not in runs.columns]
    if lacking or runs.is_empty() or faults.filter(pl.col("id") == TESTED).is_empty():
        what = f"the runs have no {lacking[0]!r}" if lacking else "no run has a fault with id = 'tested'"
        raise BadInput(f"{source}: not a flown campaign `reliability`: {what}")
    managers = runs["manager"].unique().sort().to_list()
    if len(managers) > 1:
        raise BadInput(f"{source}: has runs of several managers ({', '.join(managers)}); a folder must have one")
    counts = _with_planned(counted(_trials(runs, faults, source)), runs, planned)
    return Cells(managers[0], counts, _false_isolations(tables["signals"]))


def _trials(runs: pl.DataFrame, faults: pl.DataFrame, source: str) -> pl.DataFrame:
    """Return a row for each run whose tested fault began on a channel in use."""
    runs = runs.select("run", "condition", "survived", design=pl.col("design").str.split(" ").list.first())
    unknown = sorted(set(runs["design"].unique().to_list()) - set(DESIGNS))
    if unknown:
        raise BadInput(f"{source}: design {unknown[0]!r}: must begin with one of {', '.join(DESIGNS)}")
    first = [pl.col(name).first() for name in ("signal", "kind", "good_before", "vote_correct")]
    tested, second = (
        faults.filter(pl.col("id") == name)
        .sort("run", "channel")
        .group_by("run", maintain_order=True)
        .agg(*first, lost=declared_lost().first(), settle=_settled())
        for name in (TESTED, SECOND)
    )
    second = second.select("run", kept2="vote_correct", lost2="lost", settle2="settle")
    both = runs.join(tested, on="run", how="inner").join(second, on="run", how="left")
    return both.select(
        *CELL,
        lost=pl.coalesce("lost2", "lost"),
        off=~pl.coalesce("kept2", "vote_correct"),
        survived="survived",
        settle=pl.when(pl.col("kept2").is_null())
        .then("settle")
        .when(pl.col("settle").is_not_null() & pl.col("settle2").is_not_null())
        .then(pl.max_horizontal("settle", "settle2")),
    ).filter(pl.col("good_before").is_between(1, CHANNELS))


def _settled() -> pl.Expr:
    """Return the time from the onset to the last isolation of a fault's channels; null if one was not isolated."""
    delay = pl.col("delay_from_onset_s")
    return pl.when(delay.is_null().any()).then(None).otherwise(delay.max())


def _with_planned(counts: pl.DataFrame, runs: pl.DataFrame, faults: pl.DataFrame) -> pl.DataFrame:
    """Add rows without trials for planned faults that never began, because earlier faults had ended the run."""
    tested = faults.filter(pl.col("id") == TESTED).select("run", "signal", "kind").unique()
    design = pl.col("design").str
    good = design.extract(r"^\w+ (\d)").cast(pl.Int64)
    planned = runs.select("run", "condition", design=design.split(" ").list.first(), good_before=good)
    planned = planned.join(tested, on="run").select(*CELL).drop_nulls().unique()
    absent = planned.join(counts, on=CELL, how="anti")
    zeros = [
        pl.lit(0, pl.Int64).alias(name)
        for name in ("trials", "correct", "annunciated_loss", "undetected_error", "announced")
    ]
    return pl.concat([counts, absent.with_columns(zeros)], how="diagonal").select(*COUNTS).sort(CELL)


def _false_isolations(signals: pl.DataFrame) -> pl.DataFrame:
    """Return FALSE_ISOLATIONS of a campaign's table ``signals``; sums are in the order of the runs."""
    levels = range(CHANNELS, 0, -1)
    hours, events = ([f"{name}_level_{n}" for n in levels] for name in ("channel_hours", "false_isolations"))
    parts = [
        signals.sort("run")
        .group_by("signal")
        .agg(channel_hours=pl.col(hour).sort().sum(), events=pl.col(event).sum())
        .with_columns(level=pl.lit(level, pl.Int64))
        for level, hour, event in zip(levels, hours, events, strict=True)
    ]
    return pl.concat(parts).select(*FALSE_ISOLATIONS).sort("signal", "level", descending=[False, True])


def read_trials(folder: Path) -> Cells:
    """Read the cells of a folder of trials.  BadInput names a damaged or missing file."""
    path = folder / TRIALS
    about = sealed.read_json(path, _REMEDY, formats=(FORMAT, UNSEALED))
    if not isinstance(about.get("manager"), str):
        raise BadInput(f"{path}: is damaged: names no manager; {_REMEDY}")
    if about["format"] == UNSEALED:
        note(f"{folder}: written by an earlier version of rig; its tables have no checksum")
    return Cells(about["manager"], *(_table(folder, about, name, columns) for name, columns in TABLES.items()))


def place(about: dict[str, Any], name: str) -> str:
    """Return the mark of a table of the trials described by ``about``."""
    return f"{sealed.identity(json.dumps(about, sort_keys=True).encode())} {name}"


def _table(folder: Path, about: dict[str, Any], name: str, columns: dict[str, Any]) -> pl.DataFrame:
    path = folder / f"{name}.parquet"
    if not is_file(path):
        raise BadInput(f"{path}: is missing; {_REMEDY}")
    table = sealed.read_table(path, place(about, name), _REMEDY, under_seal=about["format"] != UNSEALED)
    if dict(table.schema) != {name: kind() if isinstance(kind, type) else kind for name, kind in columns.items()}:
        raise BadInput(f"{path}: the columns are not those of trials; {_REMEDY}")
    if absent := [column for column in (*CELL, *_SUMS) if column in columns and table[column].null_count()]:
        raise BadInput(f"{path}: a value of {absent[0]} is missing; {_REMEDY}")
    return table
