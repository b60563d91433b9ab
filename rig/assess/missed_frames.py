"""Frames that a unit under test did not answer, as faults of their own kind: ``on_miss = "fault"``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rig.frame import Block, Unit
from rig.util.runs import runs_where

_UNANSWERED: Final = (Unit.HELD, Unit.LATE, Unit.DEAD, Unit.REFUSED)


@dataclass(frozen=True, slots=True)
class Miss:
    """Frames in a row, the last included, that were flown on an older answer."""

    first_frame: int
    last_frame: int
    status: str  # of the first of them: held, dead, refused


def misses(rows: Block) -> list[Miss]:
    """All misses of a flight, in the order of time."""
    missed = np.isin(rows["unit"], _UNANSWERED)
    frames, status = rows["frame"], rows["unit"]
    return [
        Miss(int(frames[first]), int(frames[end - 1]), Unit(status[first]).name.lower())
        for first, end in runs_where(missed).tolist()
    ]
