"""Counts of what the next fault did, by cell."""

from __future__ import annotations

from dataclasses import dataclass

from pathlib import Path

import polars as pl


@dataclass(frozen=True, slots=True)
class Cells:
    """Of one manager."""

    manager: str
    counts: pl.DataFrame
    false_isolations: pl.DataFrame


def cells(folder: Path) -> Cells:
    """Temporary."""
    raise NotImplementedError
