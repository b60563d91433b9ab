"""Pacing: frames on absolute deadlines of the wall clock, as a rig with hardware would fly them.

Without a factor the flight runs as fast as it can; what it computes is the same either way.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SPIN_S = 0.0003  # the end of a wait is spent polling: a sleep wakes up late


class Pace:
    """Frame k begins at start + k dt / factor, whatever happened before it."""

    def __init__(self, rate_hz: float, factor: float | None) -> None:
        self.period_s = None if factor is None else 1.0 / (rate_hz * factor)
        self._start_s = 0.0

    def wait(self, frame: int) -> float:
        """Sleep until frame ``frame`` is due; how late it begins, s (0 when not paced)."""
        if self.period_s is None:
            return 0.0
        now = time.perf_counter()
        if frame == 0:
            self._start_s = now
        due = self.due(frame)
        if due - now > SPIN_S:
            time.sleep(due - now - SPIN_S)
        while (now := time.perf_counter()) < due:
            pass
        return now - due

    def move(self, seconds: float) -> None:
        """Begin all frames to come so much later."""
        self._start_s += seconds

    def due(self, frame: int, share: float = 0.0) -> float:
        """The time of ``perf_counter`` at which ``share`` of frame ``frame`` is over, in a paced flight."""
        return self._start_s + (frame + share) * (self.period_s or 0.0)


@dataclass(frozen=True, slots=True)
class Jitter:
    """How late frames began: microseconds; an overrun is a frame that ended after the next was due."""

    median_us: float
    p99_us: float
    worst_us: float
    overruns: int


class Histogram:
    """Times in bounded memory: whole microseconds up to 0.1 s, and the longest."""

    def __init__(self) -> None:
        self.counts = np.zeros(100_001, np.int64)
        self.worst_us = 0.0

    def add(self, times_us: NDArray[np.float64]) -> None:
        """Count the times of one block."""
        whole = np.clip(times_us.astype(np.int64), 0, len(self.counts) - 1)
        self.counts += np.bincount(whole, minlength=len(self.counts))
        self.worst_us = max(self.worst_us, float(times_us.max(initial=0.0)))

    def at(self, share: float) -> float:
        """The time, us, below which ``share`` of them are."""
        reached = np.cumsum(self.counts)
        return float(np.searchsorted(reached, share * reached[-1]))

    def as_dict(self) -> dict[str, float]:
        """Median, 99 %, 99.9 % and worst."""
        at = {"median_us": 0.5, "p99_us": 0.99, "p999_us": 0.999}
        return {**{name: self.at(share) for name, share in at.items()}, "worst_us": self.worst_us}


class JitterCounter:
    """Collects the lateness of frames, and how many ended after the next was due."""

    def __init__(self, period_s: float) -> None:
        self._period_us = period_s * 1e6
        self._late = Histogram()
        self._overruns = 0

    def add(self, frame_us: NDArray[np.float64], late_us: NDArray[np.float64]) -> None:
        """Count the frames of one block."""
        self._late.add(late_us)
        self._overruns += int(np.count_nonzero(late_us + frame_us > self._period_us))

    def result(self) -> Jitter:
        """Median, 99 % and worst of all frames so far."""
        return Jitter(self._late.at(0.5), self._late.at(0.99), self._late.worst_us, self._overruns)
