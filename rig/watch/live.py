"""The page while a flight is flown, on a thread of its own: the recorder hands over a block and goes on.

A paced block (half a second) is shown frame by frame at the pace at which it was flown, one block late; of a flight
that is as fast as it can be, the latest frame is shown.  What comes faster than it can be drawn is not drawn.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

from rich.console import Console
from rich.live import Live

from rig.frame import Block
from rig.watch.page import EventLike, Page, event_line

UPDATE_S: Final = 0.1
PLAIN_WIDTH: Final = 120  # of the page in a pipe


@contextmanager
def watching(enabled: bool, realtime_factor: float | None, screen: Console | None = None) -> Iterator[Watch | None]:
    """What flight.fly is to be given as ``watch``; None when not enabled.

    On a terminal the page, which stays when the flight is over; else a line an event, and the page of the last frame.
    """
    if not enabled:
        yield None
        return
    watch = Watch(screen or _terminal(), realtime_factor)
    try:
        yield watch
    finally:
        watch.close()


def _terminal() -> Console:
    """Standard error, for standard output has the verdict."""
    screen = Console(stderr=True, highlight=False)
    return screen if screen.is_terminal else Console(stderr=True, highlight=False, width=PLAIN_WIDTH)


class Watch:
    """Takes blocks and draws the page of their frames."""

    def __init__(self, screen: Console, realtime_factor: float | None) -> None:
        self._screen = screen
        self._factor = realtime_factor
        self._page = Page()
        self._queue: deque[tuple[Block, float, Sequence[EventLike]]] = deque()
        self._changed = threading.Condition()  # guards the queue and _closing
        self._closing = False
        self.drawn = 0  # pages
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)
        self._thread.start()

    def __call__(self, rows: Block, rate_hz: float, events: Sequence[EventLike]) -> None:
        """Take a block; never waits for the terminal."""
        with self._changed:
            self._queue.append((rows.copy(), rate_hz, events))
            self._changed.notify()

    def close(self, timeout_s: float = 2.0) -> None:
        """Draw the last frame and end; a terminal that does not take it is left."""
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        if not self._screen.is_terminal:
            self._print()
            return
        with Live(console=self._screen, auto_refresh=False, transient=False) as live:
            last = None
            while (blocks := self._take()) is not None:
                for _, rate_hz, events in blocks:
                    self._page.note(events, rate_hz)
                last = blocks[-1]
                self._play(live, last[0], last[1])
            if last is not None:
                self._draw(live, last[0][-1], last[1])

    def _play(self, live: Live, rows: Block, rate_hz: float) -> None:
        """Draw frames of a block as they were flown, until it is over or others wait."""
        pace_hz = rate_hz * (self._factor or float("inf"))
        began, k = time.monotonic(), 0
        while k < len(rows) - 1 and not self._waiting():
            k = int(min((time.monotonic() - began + UPDATE_S) * pace_hz, len(rows) - 1))
            self._draw(live, rows[k], rate_hz)
            with self._changed:
                self._changed.wait_for(lambda: self._closing, UPDATE_S)

    def _draw(self, live: Live, row: Any, rate_hz: float) -> None:
        live.update(self._page.draw(row, rate_hz), refresh=True)
        self.drawn += 1

    def _print(self) -> None:
        """For a pipe: events as they come, the page once."""
        last = None
        while (blocks := self._take()) is not None:
            for _, rate_hz, events in blocks:
                for event in events:
                    self._screen.print(event_line(event.frame / rate_hz, event), soft_wrap=True)
            last = blocks[-1]
        if last is not None:
            self._screen.print(self._page.draw(last[0][-1], last[1]))
            self.drawn += 1

    def _take(self) -> list[tuple[Block, float, Sequence[EventLike]]] | None:
        """All blocks that wait, as soon as there is one; None when there will be no more."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._closing)
            taken = list(self._queue)
            self._queue.clear()
            return taken or None

    def _waiting(self) -> bool:
        with self._changed:
            return bool(self._queue) or self._closing
