"""The wall clock of a flight: how late its frames began, how long a unit under test took to answer.

Not part of a frame: the same flight has other times on another day.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.record.time_bins import EDGES_US, binned


def histogram(times_us: NDArray[np.float64]) -> dict[str, int]:
    """How many times lie below each of EDGES_US and not below the one before; ``more`` are all others."""
    named = *(f"below_{edge}_us" for edge in EDGES_US), "more"
    return dict(zip(named, binned(times_us).tolist(), strict=True))


def times(timing: NDArray[Any]) -> dict[str, dict[str, int]]:
    """Histograms of lateness and of reply times, each when the flight has any; timing (n,) of TIMING."""
    fields = {"lateness": "late_us", "replies": "reply_us"}
    return {name: histogram(timing[field]) for name, field in fields.items() if timing[field].any()}
