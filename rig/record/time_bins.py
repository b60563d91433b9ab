"""Histograms of times of the wall clock, with the same bins in a score, a campaign and the viewer."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

EDGES_US: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)
BINS: Final = len(EDGES_US) + 1


def binned(times_us: NDArray[Any]) -> NDArray[np.int64]:
    """How many times lie below each of EDGES_US and not below the one before, and at last all others: (BINS,)."""
    return np.bincount(np.searchsorted(EDGES_US, times_us, side="right"), minlength=BINS)


def names() -> list[str]:
    """What each bin holds, for a reader."""
    inner = [f"{low} to {high}" for low, high in pairwise(EDGES_US)]
    return [f"below {EDGES_US[0]}", *inner, f"{EDGES_US[-1]} and more"]
