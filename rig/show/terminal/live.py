"""The page during a flight, and of a log that is played at a speed.

During a flight the recorder hands over each block and does not wait.

A thread chooses the frames to draw, ten per second.  In a paced flight they follow the clock, one block late; in an
unpaced flight the thread takes the latest frame.  A second process draws them, so that drawing does not delay frames.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

from rich.console import Console

from rig.core.console import Screen
from rig.core.errors import BadInput
from rig.core.event import Event
from rig.core.frame import Table, to_frame
from rig.core.settings import LONGEST_S
from rig.log import Log
from rig.show.terminal.draw import Drawer, InPipe, InProcess, OnTerminal

UPDATE_S: Final = 0.1


@contextmanager
def watching(enabled: bool, realtime_factor: float | None) -> Iterator[Watch | None]:
    """Yield the argument ``watch`` of a flight; None if not enabled.

    A terminal shows the page, which stays after the flight; a pipe gets one line per event, and the page of the last
    frame.  Both go to standard error, because standard output has the verdict.
    """
    if not enabled:
        yield None
        return
    screen = Screen(stderr=True)
    watch = Watch(InProcess() if screen.is_terminal else InPipe(Screen(stderr=True, width=120)), realtime_factor)
    try:
        yield watch
    finally:
        watch.close()


class Watch:
    """Takes blocks, and draws the pages of some of their frames."""

    def __init__(self, drawer: Drawer, realtime_factor: float | None) -> None:
        self._drawer = drawer
        self._factor = realtime_factor
        self._queue: deque[tuple[Table, float, Sequence[Event]]] = deque()
        self._changed = threading.Condition()  # guards the queue and _closing
        self._closing = False
        self.drawn = 0  # pages
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)
        self._thread.start()

    def __call__(self, table: Table, rate_hz: float, events: Sequence[Event]) -> None:
        """Take a block without waiting for the terminal."""
        kept = table.copy() if self._factor else table[-1:].copy()
        with self._changed:
            self._queue.append((kept, rate_hz, events))
            self._changed.notify()

    def close(self, timeout_s: float = 15.0) -> None:
        """Draw the last frame and end; do not wait longer than ``timeout_s`` for the terminal."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        last: Table | None = None
        rate_hz = 1.0
        while (blocks := self._take()) is not None:
            flown, rate_hz, _ = blocks[-1]
            self._play(flown, rate_hz, [event for _, _, events in blocks for event in events])
            last = flown[-1:]
        if last is not None:
            self._draw(last, rate_hz, ())
        self._drawer.close()

    def _play(self, flown: Table, rate_hz: float, events: Sequence[Event]) -> None:
        """Draw frames of a block at the pace of the flight, until it ends or the next block waits."""
        pace_hz = rate_hz * (self._factor or float("inf"))
        rows, began, k = flown.rows, time.monotonic(), -1
        while k < len(rows) - 1 and (k < 0 or not self._waiting()):
            k = int(min((time.monotonic() - began + UPDATE_S) * pace_hz, len(rows) - 1))
            due = [event for event in events if event.frame <= rows["frame"][k]]
            events = events[len(due) :]
            self._draw(flown[k : k + 1], rate_hz, due)
            with self._changed:
                self._changed.wait_for(lambda: self._closing, UPDATE_S)
        self._drawer.draw(None, rate_hz, events)  # events of frames that were not drawn

    def _draw(self, flown: Table, rate_hz: float, events: Sequence[Event]) -> None:
        self._drawer.draw(flown, rate_hz, events)
        self.drawn += 1

    def _take(self) -> list[tuple[Table, float, Sequence[Event]]] | None:
        """Wait for blocks and take all of them; None after the last one."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._closing)
            taken = list(self._queue)
            self._queue.clear()
            return taken or None

    def _waiting(self) -> bool:
        with self._changed:
            return bool(self._queue) or self._closing


def play(
    log: Log,
    title: str,
    screen: Console,
    speed: float = 1.0,
    from_s: float = 0.0,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Show the log from ``from_s`` on at ``speed`` times real time; the last page stays.

    A pipe gets the events from ``from_s`` on, one per line, and the page of the last frame.
    BadInput: the log ends before ``from_s``.
    """
    last = len(log.rows) - 1
    first = to_frame(min(from_s, LONGEST_S), log.rate_hz)  # beyond all flights
    if first > last:
        raise BadInput(f"--from {from_s:g}: the log ends at {last / log.rate_hz:g} s")
    flown = log.table
    if not screen.is_terminal:
        page, end = InPipe(screen, title), flown[-1:]
        page.draw(end, log.rate_hz, [event for event in log.events if event.frame >= first])
        page.close()
        return
    page, began, shown = OnTerminal(screen, title), clock(), -1
    try:
        while shown < last:
            k = min(first + int((clock() - began) * speed * log.rate_hz), last)
            now, due = flown[k : k + 1], [e for e in log.events if shown < e.frame <= k]
            page.draw(now, log.rate_hz, due)
            shown = k
            sleep(UPDATE_S)
    except KeyboardInterrupt:
        return
    finally:
        page.close()  # restores the terminal
