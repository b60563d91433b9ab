"""Real time: frames on absolute deadlines of the wall clock, as a rig with hardware would fly them.

Without a factor the flight runs as fast as it can; what it computes is the same either way.  Frames on time are asked
of the operating system, which may refuse: a scheduling class, locked memory, a dedicated core.
"""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.flight.time_histogram import Histogram

SPIN_S: Final = 0.0003  # the end of a wait is spent polling: a sleep wakes up late
PRIORITY: Final = 50  # of SCHED_FIFO: above all that is no driver's thread
# MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT: what is in use stays, and what libraries have reserved is not made memory.
_LOCK_NOW_AND_LATER: Final = 1 | 2 | 4


class Pace:
    """Frame k begins at start + k dt / factor, whatever happened before it."""

    def __init__(self, rate_hz: float, factor: float | None) -> None:
        self.period_s = None if factor is None else 1.0 / (rate_hz * factor)
        self._start_s = 0.0

    def wait(self, frame: int) -> float:
        """Sleep until frame ``frame`` is due; return how late it begins, s (0 when not paced)."""
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
        """Return the time of ``perf_counter`` at which ``share`` of frame ``frame`` is over, in a paced flight."""
        return self._start_s + (frame + share) * (self.period_s or 0.0)


@dataclass(frozen=True, slots=True)
class Jitter:
    """Lateness of the starts of the frames."""

    median_us: float  # median, us
    p99_us: float  # 99 %, us
    worst_us: float  # largest, us
    overruns: int  # frames that ended after the next was due


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
        """Return median, 99 % and worst of all frames so far."""
        return Jitter(self._late.at(0.5), self._late.at(0.99), self._late.worst_us, self._overruns)


@contextmanager
def realtime(wanted: bool) -> Iterator[dict[str, str]]:
    """Ask the system for all three while the context lasts; yields what it gave by name, empty unless ``wanted``."""
    if not wanted:
        yield {}
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0), os.sched_getaffinity(0)
    try:
        yield {name: _granted(request) for name, request in _REQUESTS.items()}
    finally:
        _other_cores.clear()
        with suppress(OSError):
            os.sched_setscheduler(0, *before[:2])
        os.sched_setaffinity(0, before[2])
        ctypes.CDLL(None).munlockall()


def _granted(request: Callable[[], str]) -> str:
    try:
        return request()
    except OSError as error:
        return f"refused: {error.strerror}"


def off_the_core() -> None:
    """Keep a thread that begins now, a recorder's, off the core of the frames."""
    if _other_cores:
        os.sched_setaffinity(0, _other_cores)


def _fifo() -> str:
    """Raise this thread alone: what it starts is ordinary."""
    os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    return f"SCHED_FIFO, priority {PRIORITY}"


def _lock() -> str:
    system: Any = ctypes.CDLL(None, use_errno=True)
    if system.mlockall(_LOCK_NOW_AND_LATER):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return "locked"


def _core() -> str:
    """Take the last core that this process may use; a process keeps its only core."""
    allowed = sorted(os.sched_getaffinity(0))
    if len(allowed) < 2:
        return "none: there is only one"
    os.sched_setaffinity(0, {allowed[-1]})
    _other_cores.update(allowed[:-1])
    return f"core {allowed[-1]}"


_other_cores: set[int] = set()  # cores for all that is not the frames
_REQUESTS: Final[dict[str, Callable[[], str]]] = {"scheduling": _fifo, "memory": _lock, "core": _core}
