"""What the next fault of a signal did, counted by cell: from a flown campaign `reliability`, or from open-loop trials.

A cell is a signal, how many of its channels are good before the fault, a design (single, near, alike), a kind and a
condition.  Every trial of a cell is one of three, by what follows the onset of its last fault to the end of the run:

    known loss  the signal was declared lost: level 0 at any time
    bad vote    it was not, and the vote was not kept (score/windows.py)
    kept        neither
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import polars as pl

from rig.campaign.folder import open_folder
from rig.campaign.rows import by_level
from rig.errors import BadInput
from rig.frame import CHANNELS
from rig.util.files import is_file

TESTED, SECOND = "tested", "second"  # ids of the fault that is counted, and of a near one after it
DESIGNS: Final = ("single", "near", "alike")
AT_ONCE: Final = {"single": 1, "near": 2, "alike": 2}  # channels that fail
CELL: Final = ("signal", "good_before", "design", "kind", "condition")
COUNTS: Final[dict[str, Any]] = {
    **dict.fromkeys(CELL, pl.String),
    "good_before": pl.Int64,
    **dict.fromkeys(("trials", "kept", "known_loss", "bad_vote"), pl.Int64),
    **dict.fromkeys(("lost_aircraft_known", "lost_aircraft_bad"), pl.Int64),  # null where not flown
    "announced": pl.Int64,  # kept, and every faulty channel of it failed
    "settle_s_mean": pl.Float64,  # from the onset to the failure of all faulty channels; null where none was
}
FALSE_ISOLATIONS: Final[dict[str, Any]] = {
    "signal": pl.String,
    "level": pl.Int64,
    "channel_hours": pl.Float64,
    "events": pl.Int64,
}
ABOUT: Final = "trials.json"  # in a folder of trials


@dataclass(frozen=True)
class Cells:
    """Counts of one manager: ``counts`` has the columns COUNTS, ``false_isolations`` FALSE_ISOLATIONS."""

    manager: str
    counts: pl.DataFrame
    false_isolations: pl.DataFrame


def cells(folder: Path) -> Cells:
    """Count a flown campaign `reliability`, or read a folder of trials; BadInput says in one line why it is neither."""
    if is_file(folder / ABOUT):
        from rig.reliability.trials_folder import read_trials

        return read_trials(folder)
    return of_tables(open_folder(folder).tables, str(folder))


def of_tables(tables: dict[str, pl.DataFrame], source: str) -> Cells:
    """Count a campaign's tables; ``source`` names them in a refusal."""
    runs = tables["runs"].filter(pl.col("outcome") == "flown")
    faults = tables["faults"].filter((pl.col("outcome") != "not executed") & pl.col("good_before").is_not_null())
    lacking = [column for column in ("design", "condition") if column not in runs.columns]
    if lacking or runs.is_empty() or faults.filter(pl.col("id") == TESTED).is_empty():
        what = f"its runs have no {lacking[0]!r}" if lacking else "no run of it has a fault that is called 'tested'"
        raise BadInput(f"{source}: no flown campaign `reliability`: {what}")
    managers = runs["manager"].unique().sort().to_list()
    if len(managers) > 1:
        raise BadInput(f"{source}: runs of several managers ({', '.join(managers)}); a folder must have one")
    counts = _with_planned(counted(_trials(runs, faults, source)), runs, tables["faults"])
    return Cells(managers[0], counts, _false_isolations(tables["signals"]))


def _trials(runs: pl.DataFrame, faults: pl.DataFrame, source: str) -> pl.DataFrame:
    """Return a row for each run whose tested fault began on a channel in use."""
    runs = runs.select("run", "condition", "survived", design=pl.col("design").str.split(" ").list.first())
    unknown = sorted(set(runs["design"].unique().to_list()) - set(DESIGNS))
    if unknown:
        raise BadInput(f"{source}: design {unknown[0]!r}: must begin with {', '.join(DESIGNS)}")
    window = [pl.col(name).first() for name in ("vote_kept", "lost_s")]
    tested, second = (
        faults.filter(pl.col("id") == name)
        .sort("run", "channel")
        .group_by("run", maintain_order=True)
        .agg(*(pl.col(key).first() for key in ("signal", "kind", "good_before")), *window, settle=_settled())
        for name in (TESTED, SECOND)
    )
    second = second.select("run", kept2="vote_kept", lost2="lost_s", settle2="settle")
    both = runs.join(tested, on="run", how="inner").join(second, on="run", how="left")
    return both.select(
        *CELL,
        lost=pl.coalesce("lost2", "lost_s") > 0,
        off=~pl.coalesce("kept2", "vote_kept"),
        survived="survived",
        settle=pl.when(pl.col("kept2").is_null())
        .then("settle")
        .when(pl.col("settle").is_not_null() & pl.col("settle2").is_not_null())
        .then(pl.max_horizontal("settle", "settle2")),
    ).filter(pl.col("good_before").is_between(1, CHANNELS))


def _with_planned(counts: pl.DataFrame, runs: pl.DataFrame, faults: pl.DataFrame) -> pl.DataFrame:
    """Add rows of no trial for what was planned and never came to be: earlier faults had ended it."""
    tested = faults.filter(pl.col("id") == TESTED).select("run", "signal", "kind").unique()
    design = pl.col("design").str
    good = design.extract(r"^\w+ (\d)").cast(pl.Int64)
    planned = runs.select("run", "condition", design=design.split(" ").list.first(), good_before=good)
    planned = planned.join(tested, on="run").select(*CELL).drop_nulls().unique()
    absent = planned.join(counts, on=CELL, how="anti")
    zeros = [pl.lit(0, pl.Int64).alias(name) for name in ("trials", "kept", "known_loss", "bad_vote", "announced")]
    return pl.concat([counts, absent.with_columns(zeros)], how="diagonal").select(*COUNTS).sort(CELL)


def _settled() -> pl.Expr:
    """Return the time from the onset to the failure of the last of a fault's channels; null when one was not failed."""
    delay = pl.col("delay_from_onset_s")
    return pl.when(delay.is_null().any()).then(None).otherwise(delay.max())


def counted(trials: pl.DataFrame) -> pl.DataFrame:
    """Count trials: CELL, ``lost`` and ``off`` (bool), ``survived`` (bool or null), ``settle`` (s or null)."""
    lost, bad = pl.col("lost"), ~pl.col("lost") & pl.col("off")
    crashed = ~pl.col("survived")
    flown = pl.col("survived").is_not_null().any()
    grouped = trials.group_by(CELL).agg(
        trials=pl.len().cast(pl.Int64),
        kept=(~lost & ~pl.col("off")).sum().cast(pl.Int64),
        known_loss=lost.sum().cast(pl.Int64),
        bad_vote=bad.sum().cast(pl.Int64),
        lost_aircraft_known=pl.when(flown).then((crashed & lost).sum()).cast(pl.Int64),
        lost_aircraft_bad=pl.when(flown).then((crashed & bad).sum()).cast(pl.Int64),
        announced=(~lost & ~pl.col("off") & pl.col("settle").is_not_null()).sum().cast(pl.Int64),
        settle_s_mean=pl.col("settle").filter(~lost & ~pl.col("off")).sort().mean(),
    )
    return grouped.select(*COUNTS).sort(CELL)


def _false_isolations(signals: pl.DataFrame) -> pl.DataFrame:
    """Build FALSE_ISOLATIONS of a campaign's table ``signals``; sums in the order of the runs."""
    levels = range(CHANNELS, 0, -1)
    hours, events = (list(by_level(name, levels)) for name in ("channel_hours", "false_isolations"))
    parts = [
        signals.sort("run")
        .group_by("signal")
        .agg(channel_hours=pl.col(hour).sort().sum(), events=pl.col(event).sum())
        .with_columns(level=pl.lit(level, pl.Int64))
        for level, hour, event in zip(levels, hours, events, strict=True)
    ]
    return pl.concat(parts).select(*FALSE_ISOLATIONS).sort("signal", "level", descending=[False, True])
