"""The smallest offset of one channel that is found, by signal and aircraft, from campaigns `detectability`:

    rig campaign run detectability --out DIR && python tests/tools/detectability.py DIR [DIR ...]

Smallest: of the faults from there on at least 99 % are failed, and rightly; - where too few are.  A column each DIR.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from rig.frame import SIGNALS

LEAST: Final = 30  # faults, to say a share of
SHARE: Final = 0.99


def smallest(faults: pl.DataFrame) -> float:
    """Of the sizes of ``faults``, unit of the signal; NaN when even the largest are missed."""
    found = faults.sort("magnitude").with_columns(ok=pl.col("isolation") == "right")
    sizes, right = found["magnitude"].to_numpy(), found["ok"].to_numpy().astype(float)
    share = np.cumsum(right[::-1])[::-1] / np.arange(len(right), 0, -1)  # of the faults from each on
    good = np.flatnonzero(share[: len(share) - LEAST + 1] >= SHARE)
    return float(sizes[good[0]]) if len(good) else float("nan")


def column(folder: Path) -> dict[tuple[str, str], tuple[float, int]]:
    """By plane and signal: the smallest offset that is found, and the faults that it rests on."""
    faults = pl.read_parquet(folder / "faults" / "*.parquet").join(
        pl.read_parquet(folder / "runs" / "*.parquet").select("run", "aircraft"), on="run"
    )
    planes = {"all": faults, **{key[0]: of for key, of in faults.partition_by("aircraft", as_dict=True).items()}}
    return {
        (str(plane), signal.name): (smallest(mine), len(mine))
        for plane, of in planes.items()
        for signal in SIGNALS
        if len(mine := of.filter(pl.col("signal") == signal.name))
    }


def main(folders: list[Path]) -> int:
    """A table for all aircraft together, then one for each."""
    found = [column(folder) for folder in folders]
    for plane in dict.fromkeys(plane for plane, _ in found[0]):
        print(f"\n{plane}\n\n| signal | faults | {' | '.join(folder.name for folder in folders)} |")
        print("|---|---|" + "---|" * len(folders))
        for signal in SIGNALS:
            cells = [one[plane, signal.name] for one in found if (plane, signal.name) in one]
            if cells:
                sizes = " | ".join(f"{size:.3g}" if size == size else "-" for size, _ in cells)
                print(f"| {signal.name} | {cells[0][1]} | {sizes} |")
    return 0


if __name__ == "__main__":
    sys.exit(main([Path(argument) for argument in sys.argv[1:]]))
