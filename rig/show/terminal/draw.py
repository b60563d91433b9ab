"""Who draws a page: this process on a terminal, another one beside it, or nobody where there is none."""

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
        """Draw the page of a row, with these events too; without a row they are for the next page."""

    def close(self) -> None:
        """End; the last page stays."""


class OnTerminal:
    """Draws over and over in the same place."""

    def __init__(self, screen: Console, title: str = "") -> None:
        self._page = Page(title)
        self._live = Live(console=screen, auto_refresh=False)
        self._live.start()

    def draw(self, row: Table | None, rate_hz: float, events: Sequence[Event]) -> None:
        """Draw now, if there is a row."""
        self._page.note(events, rate_hz)
        if row is not None:
            self._live.update(self._page.draw(row, rate_hz), refresh=True)

    def close(self) -> None:
        """Leave the last page on the terminal."""
        self._live.stop()


class InPipe:
    """Events as they come, a line each; the page of the last row at the end."""

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
    """Has another process draw on this one's standard error; one that ended or hangs is not waited for."""

    def __init__(self) -> None:
        self._process = subprocess.Popen([sys.executable, "-P", "-m", "rig.show.terminal.draw"], stdin=subprocess.PIPE)

    def draw(self, row: Table | None, rate_hz: float, events: Sequence[Event]) -> None:
        """Pass it on, if there is anything."""
        if row is not None or events:
            with suppress(OSError):
                pickle.dump((row, rate_hz, events), self._pipe)
                self._pipe.flush()

    def close(self) -> None:
        """Let it draw what it has been given, and end."""
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
    """Draw what comes on standard input from an InProcess until it ends; Ctrl-C is for the flight, not for this."""
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
