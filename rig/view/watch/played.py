"""The page of a log, played at a speed."""

from __future__ import annotations

import time
from collections.abc import Callable

from rich.console import Console

from rig.errors import BadInput
from rig.frame import to_frame
from rig.log import Log
from rig.view.watch.draw import InPipe, OnTerminal
from rig.view.watch.live import UPDATE_S


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
    if not screen.is_terminal:
        page = InPipe(screen, title)
        page.draw(log.rows[-1:], log.rate_hz, [event for event in log.events if event.frame >= first])
        page.close()
        return
    page, began, shown = OnTerminal(screen, title), clock(), -1
    try:
        while shown < last:
            k = min(first + int((clock() - began) * speed * log.rate_hz), last)
            page.draw(log.rows[k : k + 1], log.rate_hz, [e for e in log.events if shown < e.frame <= k])
            shown = k
            sleep(UPDATE_S)
    except KeyboardInterrupt:
        return
    finally:
        page.close()  # the terminal is as before, whatever ended it
