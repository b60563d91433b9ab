"""Ctrl-C while flights are under way: it asks for an end instead of tearing them."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rig.loop import Stop


@contextmanager
def interruptible() -> Iterator[Stop]:
    """The first Ctrl-C sets ``requested``; a second one is Python's own.

    Only a process's main thread can be asked; elsewhere the Stop is never set.
    """
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def ask(number: int, frame: object) -> None:
        stop.requested = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, ask)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)
