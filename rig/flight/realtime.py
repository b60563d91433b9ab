"""Real time, as far as the machine gives it: a scheduling class, memory that stays, a core of its own.

Frames on time are asked of the operating system, which may refuse; what was got is told, and given back at the end.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

PRIORITY: Final = 50  # of SCHED_FIFO: above all that is no driver's thread
# MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT: what is in use stays, and what libraries have reserved is not made memory.
_LOCK_NOW_AND_LATER: Final = 1 | 2 | 4


@contextmanager
def realtime(asked: bool) -> Iterator[dict[str, str]]:
    """Ask for all three while the context lasts; what was got, by name, empty when not ``asked``."""
    if not asked:
        yield {}
        return
    before = os.sched_getscheduler(0), os.sched_getparam(0), os.sched_getaffinity(0)
    try:
        yield {name: _got(ask) for name, ask in _ASKED.items()}
    finally:
        _rest.clear()
        with suppress(OSError):
            os.sched_setscheduler(0, *before[:2])
        os.sched_setaffinity(0, before[2])
        ctypes.CDLL(None).munlockall()


def _got(ask: Callable[[], str]) -> str:
    try:
        return ask()
    except OSError as error:
        return f"refused: {error.strerror}"


def beside() -> None:
    """Keep a thread that begins now, a recorder's, off the core of the frames."""
    if _rest:
        os.sched_setaffinity(0, _rest)


def _fifo() -> str:
    """For this thread alone: what it starts is ordinary."""
    os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    return f"SCHED_FIFO, priority {PRIORITY}"


def _lock() -> str:
    system: Any = ctypes.CDLL(None, use_errno=True)
    if system.mlockall(_LOCK_NOW_AND_LATER):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return "locked"


def _core() -> str:
    """The last core that this process may use; one alone is nobody's own."""
    may = sorted(os.sched_getaffinity(0))
    if len(may) < 2:
        return "none: there is only one"
    os.sched_setaffinity(0, {may[-1]})
    _rest.update(may[:-1])
    return f"core {may[-1]}"


_rest: set[int] = set()  # cores for all that is not the frames
_ASKED: Final[dict[str, Callable[[], str]]] = {"scheduling": _fifo, "memory": _lock, "core": _core}
