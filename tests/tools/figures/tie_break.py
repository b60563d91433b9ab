"""How often each criterion was right in the campaign ``tie_break``, with exact intervals of 95 %.

Correct: every faulty channel is isolated and no healthy one.  Wrong: a rule isolates a healthy channel.  Undecided:
neither, or the signal is given up, which isolates all of its channels.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import polars as pl

from figures import table
from rig.studies.campaign.statistics import proportion

ALL: Final = "all in the default order"
ORDERS: Final = ("ilm alone", "reference alone", "trend alone", "extremes and middle alone", ALL)
PATTERNS: Final = ("2:2", "1:1:1:1", "1:1:1", "1:1")
OUTCOMES: Final = ("correct", "wrong", "undecided")


def flown(folder: str) -> pl.DataFrame:
    """Return a row for each flight: pattern, place of the good channels, order, signal, outcome."""
    runs = pl.read_parquet(Path(folder) / "runs" / "*.parquet").filter(pl.col("outcome") == "flown")
    alarms = pl.read_parquet(Path(folder) / "alarms" / "*.parquet").filter(pl.col("decided_by") != "given_up")
    kept = (pl.col("wrong_isolations") + pl.col("false_alarms")) == 0
    wrong = pl.col("run").is_in(alarms["run"].unique().to_list())
    right = kept & (pl.col("missed") == 0) & (pl.col("detected") > 0)
    return runs.with_columns(
        result=pl.when(wrong).then(pl.lit("wrong")).when(right).then(pl.lit("correct")).otherwise(pl.lit("undecided")),
        kind=pl.col("pattern").str.split(",").list.first(),
        place=pl.col("pattern").str.extract(r"good (\w+)"),
        signal=pl.col("faults.*.signal"),
    )


def shares(runs: pl.DataFrame) -> list[str]:
    """Return the number of flights, and the share of each outcome with its interval."""
    cells = [str(len(runs))]
    for outcome in OUTCOMES:
        rate = proportion(int((runs["result"] == outcome).sum()), len(runs))
        cells.append("none flown" if rate.value is None else f"{rate.value:.3f} ({rate.low:.3f} to {rate.high:.3f})")
    return cells


def by_pattern(runs: pl.DataFrame, place: str | None = None) -> Iterator[list[str]]:
    """Yield a row for each pattern and criterion, of the flights with the good channels in ``place``."""
    here = runs if place is None else runs.filter(pl.col("place") == place)
    for pattern in (*PATTERNS, "all"):
        for order in ORDERS:
            chosen = here.filter(pl.col("order") == order, (pl.col("kind") == pattern) | (pattern == "all"))
            if len(chosen):
                yield [pattern, order, *shares(chosen)]


def by_signal(runs: pl.DataFrame) -> Iterator[list[str]]:
    """Yield a row for each signal: the default order where no in-line monitor sees the fault."""
    silent = runs.filter(pl.col("order") == ALL, ~pl.col("faults.*.seen_by_ilm"))
    for signal in silent["signal"].unique().sort():
        yield [signal, *shares(silent.filter(pl.col("signal") == signal))]


def tie_break(folder: str, place: str | None = None) -> None:
    """Print a campaign's flights by pattern, then by signal; ``place``: low, high, 1 to 4."""
    runs = flown(folder)
    table(("pattern", "criterion", "flights", *OUTCOMES), by_pattern(runs, place))
    if place is None:
        print("\nDefault order, monitors silent:\n")
        table(("signal", "flights", *OUTCOMES), by_signal(runs))
