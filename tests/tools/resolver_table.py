"""How often each criterion was right in the campaign `resolvers`: a table in Markdown, with intervals of 95 %.

    rig campaign run resolvers --out DIR && python tests/tools/resolver_table.py DIR

Right: every faulty channel is failed and no healthy one.  Wrong: a healthy channel is failed.  Nobody: neither.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import polars as pl

from rig.campaign.statistics import proportion

ORDERS: Final = (
    "ilm alone",
    "reference alone",
    "trend alone",
    "extremes and middle alone",
    "all in the default order",
)
PATTERNS: Final = ("2:2", "1:1:1:1", "1:1:1", "1:1")
STICKS: Final = ("stick_pitch", "stick_roll", "pedal")


def outcomes(folder: Path) -> pl.DataFrame:
    """A row for each flight that was flown: pattern, order, signal, and what became of it."""
    runs = pl.read_parquet(folder / "runs" / "*.parquet").filter(pl.col("outcome") == "flown")
    wrong = (pl.col("wrong_isolations") + pl.col("false_alarms")) > 0
    right = ~wrong & (pl.col("missed") == 0) & (pl.col("detected") > 0)
    told = pl.when(wrong).then(pl.lit("wrong")).when(right).then(pl.lit("right")).otherwise(pl.lit("nobody"))
    kind = pl.col("pattern").str.split(",").list.first()
    place = pl.col("pattern").str.extract(r"good (\w+)")
    return runs.with_columns(told.alias("told"), kind.alias("kind"), place.alias("place"))


def share(rows: pl.DataFrame, told: str) -> str:
    """The share of flights with this outcome, and its interval."""
    found = proportion(int((rows["told"] == told).sum()), len(rows))
    if found.value is None:
        return "none flown"
    return f"{found.value:.3f} ({found.low:.3f} to {found.high:.3f})"


def by_pattern(rows: pl.DataFrame) -> None:
    """Each criterion on each pattern."""
    print("| pattern | criterion | flights | right | wrong | nobody |\n|---|---|---|---|---|---|")
    for pattern in (*PATTERNS, "all"):
        for order in ORDERS:
            mine = rows.filter(pl.col("order") == order, (pl.col("kind") == pattern) | (pattern == "all"))
            cells = " | ".join(share(mine, told) for told in ("right", "wrong", "nobody"))
            print(f"| {pattern} | {order} | {len(mine)} | {cells} |")


def by_place(rows: pl.DataFrame) -> None:
    """The criteria that know no witness, by where the good channels lie."""
    print("\nBy the place of the good channels, all signals:\n")
    print("| pattern | good | criterion | flights | right | wrong |\n|---|---|---|---|---|---|")
    for pattern in PATTERNS:
        for place in sorted(set(rows.filter(pl.col("kind") == pattern)["place"])):
            for order in ORDERS[2:]:
                at = (pl.col("order") == order, pl.col("kind") == pattern, pl.col("place") == place)
                mine = rows.filter(*at)
                if order == "trend alone" and pattern in ("1:1:1:1", "1:1:1"):
                    continue
                told = f"{share(mine, 'right')} | {share(mine, 'wrong')}"
                print(f"| {pattern} | {place} | {order} | {len(mine)} | {told} |")


def by_signal(rows: pl.DataFrame) -> None:
    """The default order on each signal, no in-line monitor seeing anything."""
    print("\nDefault order, monitors silent, by signal:\n")
    print("| signal | flights | right | wrong | nobody |\n|---|---|---|---|---|")
    silent = rows.filter(pl.col("order") == ORDERS[-1], ~pl.col("faults.*.seen_by_ilm"))
    for signal in silent["faults.*.signal"].unique(maintain_order=True).sort():
        mine = silent.filter(pl.col("faults.*.signal") == signal)
        cells = " | ".join(share(mine, told) for told in ("right", "wrong", "nobody"))
        print(f"| {signal} | {len(mine)} | {cells} |")


def main() -> int:
    """Print the tables of a campaign's folder."""
    rows = outcomes(Path(sys.argv[1]))
    print(f"{len(rows)} flights\n")
    by_pattern(rows)
    by_place(rows)
    by_signal(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
