"""One run of a campaign, flown again alone."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from rig.campaign.folder import Folder
from rig.errors import BadInput
from rig.flight import Flight, fly


def again(folder: Folder, number: int, out: Path) -> tuple[Flight, str | None]:
    """The flight of a run with its full log in ``out``, and the digest that the table has of it, if any."""
    if number >= len(folder.plan):
        raise BadInput(f"--run {number}: must be from 0 to {len(folder.plan) - 1}")
    row = folder.tables["runs"].filter(pl.col("run") == number)
    return fly(folder.plan[number].scenario(), out=out), row["digest"][0] if len(row) else None
