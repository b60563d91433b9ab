"""What became of the flights of the campaign ``reliability-slow``, by aircraft and planned cell.

Kept, annunciated loss and undetected error as `rig reliability` counts them; flights in which the aircraft is lost,
and in which a
healthy channel of any signal is failed.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import polars as pl

from figures import table
from rig.studies.campaign.folder import open_folder
from rig.studies.reliability.campaign_cells import of_tables
from rig.studies.reliability.tally import OUTCOMES
from rig.verdict.words import BY_DESIGN

Tables = dict[str, pl.DataFrame]
HEADS: Final = ("aircraft", "fault", "flights", *(name.replace("_", " ") for name in OUTCOMES))
ENDS: Final = ("aircraft lost", "healthy channel failed", "not kept, signals")


def rows(tables: Tables, source: str) -> Iterator[list[object]]:
    """Yield a row for each design and number of good channels that was planned."""
    runs = tables["runs"].filter(pl.col("outcome") == "flown")
    by_design = pl.col("kind").is_in(BY_DESIGN)
    wrong = tables["alarms"].filter(~by_design)["run"].unique()
    cell = pl.col("design").str.extract(r"^(\w+ \d)")
    for (name,), flown in sorted(runs.group_by(cell), key=lambda item: item[0], reverse=True):
        counts = of_tables({**tables, "runs": flown}, source).counts
        sums = [int(counts[outcome].sum()) for outcome in OUTCOMES]
        off = (
            counts.group_by("signal")
            .agg(count=(pl.col("trials") - pl.col("correct")).sum())
            .filter(pl.col("count") > 0)
        )
        signals = ", ".join(f"{signal} {count}" for signal, count in off.sort("signal").iter_rows())
        lost, healthy = int((~flown["survived"]).sum()), int(flown["run"].is_in(wrong.to_list()).sum())
        yield [flown["aircraft"][0], name, len(flown), *sums, lost, healthy, signals]


def slow_drifts(*folders: str) -> None:
    """Print the flights of campaigns, one an aircraft."""
    table((*HEADS, *ENDS), (row for folder in folders for row in rows(open_folder(Path(folder)).tables, folder)))
