"""Ctrl-C, SIGTERM and SIGHUP: a flight ends after its frame, all other work ends at once and cleanly.

A supervisor or a shutdown sends SIGTERM, a closed terminal sends SIGHUP.  A signal that was ignored when the process
started (nohup) stays ignored; a shell ignores Ctrl-C for background jobs in this way.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final, NoReturn

TERMINATIONS: Final = tuple(
    number for number in (signal.SIGTERM, getattr(signal, "SIGHUP", None)) if number is not None
)
GOES_ON: Final = "the same command resumes"  # interrupted work, and runs that were not flown
FLIES_AGAIN: Final = "the same command flies them again"
CODE: Final = 128  # plus the number of the signal: the exit code of an ended process, as in shells


class Terminated(SystemExit):
    """The end by SIGTERM or SIGHUP: it is no error of the code that it interrupts, unlike another SystemExit."""


SIGNALLED: Final = (KeyboardInterrupt, Terminated)  # no handler of the exceptions of a user's code stops these


class Stop:
    """A request to end flights after the present frame: the first signal, and a second Ctrl-C."""

    requested = False
    signal = 0
    insisted = False

    @property
    def terminated(self) -> bool:
        """True if SIGTERM or SIGHUP asked for the end, so that no second Ctrl-C will follow."""
        return self.signal in TERMINATIONS

    def heed(self) -> None:
        """End the process as its signal would have, if there was one."""
        if self.requested:
            raise Terminated(CODE + self.signal) if self.terminated else KeyboardInterrupt


@contextmanager
def interruptible(*, again: bool = False) -> Iterator[Stop]:
    """Set ``requested`` at the first Ctrl-C and at SIGTERM or SIGHUP; Python handles a second Ctrl-C.

    again : the second Ctrl-C sets ``insisted``, and Python handles the third
    Only the main thread of a process receives signals; in other threads the request is never made.
    """
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def ask(number: int, frame: object) -> None:
        if number == signal.SIGINT:
            stop.insisted = stop.requested and again
            if stop.insisted or not again:
                signal.signal(number, before[signal.SIGINT])
        stop.requested, stop.signal = True, stop.signal or number

    with _put_back() as before:
        for number in before:
            signal.signal(number, ask)
        yield stop


@contextmanager
def at_once() -> Iterator[None]:
    """End the block by KeyboardInterrupt or Terminated, also within a flight."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    with _put_back():
        signal.signal(signal.SIGINT, signal.default_int_handler)
        end_cleanly()
        yield


@contextmanager
def _put_back() -> Iterator[dict[signal.Signals, Any]]:
    """Yield the handlers of Ctrl-C and of the terminations, and restore them at the end."""
    before = {number: signal.getsignal(number) or signal.SIG_DFL for number in (signal.SIGINT, *_heeded())}
    try:
        yield before
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def end_cleanly() -> None:
    """End the process by Terminated at SIGTERM or SIGHUP, so that half-written files are removed.

    Exit code 128 + signal.  The first one counts: timeout(1) and closed terminals send two.
    """

    def end(number: int, frame: object) -> NoReturn:
        for each in _heeded():
            signal.signal(each, signal.SIG_IGN)
        raise Terminated(CODE + number)

    for number in _heeded():
        signal.signal(number, end)


def _heeded() -> list[signal.Signals]:
    """Return the terminations that are not ignored."""
    return [number for number in TERMINATIONS if signal.getsignal(number) is not signal.SIG_IGN]


def signal_name(number: int) -> str:
    """Return a signal's number and name: ``9 (SIGKILL)``, ``37 (SIGRTMIN+3)``; without a name only the number."""
    with suppress(ValueError):  # most of the real-time signals have no name in Python
        return f"{number} ({signal.Signals(number).name})"
    first, last = (getattr(signal, name, 0) for name in ("SIGRTMIN", "SIGRTMAX"))
    return f"{number} (SIGRTMIN+{number - first})" if first < number < last else str(number)
