"""The page of a log, played at a speed."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

from rich.console import Console
from rich.live import Live

from rig.errors import BadInput
from rig.frame import to_frame
from rig.log import Log
from rig.watch.live import UPDATE_S
from rig.watch.page import Page, event_line


def play(
    log: Log,
    title: str,
    screen: Console,
    speed: float = 1.0,
    from_s: float = 0.0,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> None:
    """Show the log from ``from_s`` on, ``speed`` times as fast as it was flown; the last page stays.

    In a pipe: its events from there on, a line each, and the page of its last frame.
    BadInput: the log ends before ``from_s``.
    """
    first, last = to_frame(from_s, log.rate_hz), len(log.rows) - 1
    if first > last:
        raise BadInput(f"--from {from_s:g}: the log ends at {last / log.rate_hz:g} s")
    page = Page(title)
    if not screen.is_terminal:
        _print(log, page, screen, first)
        return
    began, shown = clock(), -1
    with Live(console=screen, auto_refresh=False) as live, suppress(KeyboardInterrupt):
        while shown < last:
            k = min(first + int((clock() - began) * speed * log.rate_hz), last)
            page.note([event for event in log.events if shown < event.frame <= k], log.rate_hz)
            live.update(page.draw(log.rows[k], log.rate_hz), refresh=True)
            shown = k
            sleep(UPDATE_S)


def _print(log: Log, page: Page, screen: Console, first: int) -> None:
    for event in log.events:
        if event.frame >= first:
            screen.print(event_line(event.frame / log.rate_hz, event), soft_wrap=True)
    screen.print(page.draw(log.rows[-1], log.rate_hz))
