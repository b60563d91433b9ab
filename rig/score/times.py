"""The wall clock of a flight: how late its frames began, how long a unit under test took to answer.

Not part of a frame: the same flight has other times on another day.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

EDGES_US: Final = (10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)


def histogram(times_us: NDArray[np.float64]) -> dict[str, int]:
    """How many times lie below each of EDGES_US and not below the one before; ``more`` are all others."""
    counts = np.bincount(np.searchsorted(EDGES_US, times_us, side="right"), minlength=len(EDGES_US) + 1)
    return dict(zip((*(f"below_{edge}_us" for edge in EDGES_US), "more"), counts.tolist(), strict=True))


def times(timing: NDArray[Any]) -> dict[str, dict[str, int]]:
    """Histograms of lateness and of reply times, each when the flight has any; timing (n,) of TIMING."""
    fields = {"lateness": "late_us", "replies": "reply_us"}
    return {name: histogram(timing[field]) for name, field in fields.items() if timing[field].any()}
