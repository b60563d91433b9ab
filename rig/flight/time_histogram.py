"""Times of the wall clock counted: in the bins that score, campaign and viewer share, and by the microsecond.

Not part of a frame: the same flight has other times on another day.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

EDGES_US: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 100_000)
BINS: Final = len(EDGES_US) + 1


def binned(times_us: NDArray[Any]) -> NDArray[np.int64]:
    """Return (BINS,) how many times are below each of EDGES_US and not below the one before; the last: all others."""
    return np.bincount(np.searchsorted(EDGES_US, times_us, side="right"), minlength=BINS)


def names() -> list[str]:
    """Return a label of each bin for a reader."""
    inner = [f"{low} to {high}" for low, high in pairwise(EDGES_US)]
    return [f"below {EDGES_US[0]}", *inner, f"{EDGES_US[-1]} and more"]


def keyed(counts: NDArray[np.int64]) -> dict[str, int]:
    """Return ``counts`` (BINS,) by their JSON keys; ``more`` is the last one."""
    keys = *(f"below_{edge}_us" for edge in EDGES_US), "more"
    return dict(zip(keys, counts.tolist(), strict=True))


class Times:
    """The bins of lateness and of reply times of a flight, added up block by block."""

    def __init__(self) -> None:
        self._fields = {"lateness": "late_us", "replies": "reply_us"}
        self._counts = {name: np.zeros(BINS, np.int64) for name in self._fields}
        self._any = dict.fromkeys(self._fields, False)

    def add(self, timing: NDArray[Any]) -> None:
        """Count the next rows (n,) of TIMING."""
        for name, field in self._fields.items():
            self._counts[name] += binned(timing[field])
            self._any[name] |= bool(timing[field].any())

    def as_dict(self) -> dict[str, dict[str, int]]:
        """Return the bins by their keys, of what the flight has."""
        return {name: keyed(self._counts[name]) for name, there in self._any.items() if there}


class Histogram:
    """Times in bounded memory: whole microseconds up to 0.1 s, and the longest."""

    def __init__(self) -> None:
        self.counts = np.zeros(EDGES_US[-1] + 1, np.int64)
        self.worst_us = 0.0

    def add(self, times_us: NDArray[np.float64]) -> None:
        """Count the times of one block."""
        whole = np.clip(times_us.astype(np.int64), 0, len(self.counts) - 1)
        self.counts += np.bincount(whole, minlength=len(self.counts))
        self.worst_us = max(self.worst_us, float(times_us.max(initial=0.0)))

    def at(self, share: float) -> float:
        """Return the time, us, below which ``share`` of them are."""
        reached = np.cumsum(self.counts)
        return float(np.searchsorted(reached, share * reached[-1]))

    def as_dict(self) -> dict[str, float]:
        """Return median, 99 %, 99.9 % and worst."""
        shares = {"median_us": 0.5, "p99_us": 0.99, "p999_us": 0.999}
        return {**{name: self.at(share) for name, share in shares.items()}, "worst_us": self.worst_us}
