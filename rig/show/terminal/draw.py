"""The drawing of a page: in this process on a terminal, in a second process, or as lines in a pipe."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import IO, Protocol

from rich.console import Console
from rich.live import Live

from rig.core.console import Screen
from rig.core.event import Event
from rig.core.frame import Table
from rig.show.terminal.redundancy_page import Page, event_line


class Drawer(Protocol):
    """Draws the page of one frame (1,) after another."""

    def draw(self, row: Table | None, rate_hz: float, events: Sequence[Event]) -> None:
        """Draw the page of a row with these events; without a row, keep the events for the next page."""

    def close(self) -> None:
        """End; the last page stays."""


class OnTerminal:
    """Draws each page over the one before."""

    def __init__(self, screen: Console, title: str = "") -> None:
        self._page = Page(title)
        self._live = Live(console=screen, auto_refresh=False)
        self._live.start()

    def draw(self, row: Table | None, rate_hz: float, events: Sequence[Event]) -> None:
        """Draw at once, if there is a row."""
        self._page.note(events, rate_hz)
        if row is not None:
            self._live.update(self._page.draw(row, rate_hz), refresh=True)

    def close(self) -> None:
        """Leave the last page on the terminal."""
        self._live.stop()


class InPipe:
    """Prints each event as a line, and the page of the last row at the end."""

    def __init__(self, screen: Console, title: str = "") -> None:
        self._screen = screen
        self._page = Page(title)
        self._last: tuple[Table, float] | None = None

    def draw(self, row: Table | None, rate_hz: float, events: Sequence[Event]) -> None:
        """Print the events, keep the row."""
        for event in events:
            self._screen.print(event_line(event.frame / rate_hz, event), soft_wrap=True)
        self._last = self._last if row is None else (row, rate_hz)

    def close(self) -> None:
        """Print the page."""
        if self._last is not None:
            self._screen.print(self._page.draw(*self._last))


class InProcess:
    """Draws in a second process on standard error; does not wait for that process if it has ended or hangs."""

    def __init__(self) -> None:
        self._process = subprocess.Popen([sys.executable, "-P", "-m", "rig.show.terminal.draw"], stdin=subprocess.PIPE)

    def draw(self, row: Table | None, rate_hz: float, events: Sequence[Event]) -> None:
        """Send row and events to the process, if there are any."""
        if row is not None or events:
            with suppress(OSError):
                pickle.dump((row, rate_hz, events), self._pipe)
                self._pipe.flush()

    def close(self) -> None:
        """Let the process draw the pages that it has received, and end it."""
        with suppress(OSError):
            self._pipe.close()
        try:
            self._process.wait(10.0)  # on a busy machine it may still be starting
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    @property
    def _pipe(self) -> IO[bytes]:
        assert self._process.stdin is not None
        return self._process.stdin


def main() -> None:
    """Draw the pages that arrive on standard input from an InProcess; ignore Ctrl-C, which ends the flight."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(AttributeError, OSError):
        os.nice(5)  # the frames come first
    drawer = OnTerminal(Screen(stderr=True))
    with suppress(EOFError):
        while True:
            drawer.draw(*pickle.load(sys.stdin.buffer))
    drawer.close()


if __name__ == "__main__":
    main()
