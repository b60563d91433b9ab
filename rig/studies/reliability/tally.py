"""Count the outcomes of the next fault of a signal, by cell.

A cell is a signal, the number of good channels before the fault, a design (single, near, alike), a kind and a
condition.  A trial has one of three outcomes, counted from the onset of its last fault to the end of the run:

    annunciated loss  the signal was declared lost (level 0 at any time), and the vote was correct until then
    undetected error  the vote was wrong (verdict/scoring.py) before a loss was declared, or without one
    correct           neither

The kind is that of the tested fault, or the name that the campaign's group of cases `kind` gives it: words before the
kind, as in `slow drift`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import polars as pl

from rig.studies.reliability.rates_file import kind_of_fault
from rig.verdict.words import PUBLIC, vote_flags

TESTED, SECOND = "tested", "second"  # ids of the fault that is counted, and of a near one after it
DESIGNS: Final = ("single", "near", "alike")
LATENT: Final = "level then manoeuvre"  # condition: all faults in level flight, where a stuck channel is not detected
AT_ONCE: Final = {"single": 1, "near": 2, "alike": 2}  # channels that fail
CELL: Final = ("signal", "good_before", "design", "kind", "condition")
OUTCOMES: Final = tuple(name.replace(" ", "_") for name in PUBLIC["reliability"].values())
COUNTS: Final[dict[str, Any]] = {
    **dict.fromkeys(CELL, pl.String),
    "good_before": pl.Int64,
    **dict.fromkeys(("trials", *OUTCOMES), pl.Int64),
    **dict.fromkeys(("lost_aircraft_annunciated", "lost_aircraft_undetected"), pl.Int64),  # null where not flown
    "announced": pl.Int64,  # correct, and every faulty channel isolated
    "settle_s_mean": pl.Float64,  # from the onset to the isolation of all faulty channels; null if none was isolated
}
FALSE_ISOLATIONS: Final[dict[str, Any]] = {
    "signal": pl.String,
    "level": pl.Int64,
    "channel_hours": pl.Float64,
    "events": pl.Int64,
}


@dataclass(frozen=True)
class Cells:
    """Counts of one manager: ``counts`` has the columns COUNTS, ``false_isolations`` FALSE_ISOLATIONS."""

    manager: str
    counts: pl.DataFrame
    false_isolations: pl.DataFrame


def together(manager: str, parts: Sequence[Cells]) -> Cells:
    """Return the counts of several folders of one manager in one table."""
    counts, false_isolations = (
        pl.concat([getattr(part, name) for part in parts], how="diagonal_relaxed")
        for name in ("counts", "false_isolations")
    )
    return Cells(manager, counts, false_isolations)


def of_kind(kind: str, case: str | None) -> str:
    """Return the kind of the cell of a fault, by the name of its case in the group `kind`."""
    return case if case is not None and kind_of_fault(case) == kind else kind


def of_kinds(faults: pl.DataFrame, runs: pl.DataFrame) -> pl.DataFrame:
    """Return a campaign's ``faults`` by the kinds of their cells."""
    if "kind" not in runs.columns:
        return faults
    cases = dict(runs.select("run", "kind").iter_rows())
    kinds = [of_kind(kind, cases.get(run)) for run, kind in faults.select("run", "kind").iter_rows()]
    return faults.with_columns(kind=pl.Series(kinds, dtype=pl.String))


def declared_lost() -> pl.Expr:
    """Return True if the signal of a fault was declared lost while its vote was correct: the first event counts."""
    return (pl.col("lost_s") > 0) & ~pl.col("wrong_vote_first").fill_null(value=False)


def counted(trials: pl.DataFrame) -> pl.DataFrame:
    """Return the counts of trials: CELL, ``lost`` and ``off`` (bool), ``survived`` (bool or null), ``settle`` (s)."""
    kept, known, bad = vote_flags(pl.col("lost"), pl.col("off")).values()
    crashed, flown = ~pl.col("survived"), pl.col("survived").is_not_null().any()
    grouped = trials.group_by(CELL).agg(
        trials=pl.len().cast(pl.Int64),
        correct=kept.sum().cast(pl.Int64),
        annunciated_loss=known.sum().cast(pl.Int64),
        undetected_error=bad.sum().cast(pl.Int64),
        lost_aircraft_annunciated=pl.when(flown).then((crashed & known).sum()).cast(pl.Int64),
        lost_aircraft_undetected=pl.when(flown).then((crashed & bad).sum()).cast(pl.Int64),
        announced=(kept & pl.col("settle").is_not_null()).sum().cast(pl.Int64),
        settle_s_mean=pl.col("settle").filter(kept).sort().mean(),
    )
    return grouped.select(*COUNTS).sort(CELL)
