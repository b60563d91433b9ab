"""The live stream: a bounded queue that never blocks the frame loop, and a worker that talks to Rerun.

A sink may block for seconds (no viewer listens) or for ever (a reader has stopped).  The flight continues; blocks
that find the queue full are dropped and counted.  The log, not the stream, is the record of a flight.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol
from urllib.parse import urlsplit

from rig.core.event import Event, StreamReport
from rig.core.frame import Table
from rig.show.viewer import viewer
from rig.show.viewer.facts import UNKNOWN, Facts, Layout, Shown, of_resolved
from rig.show.viewer.sink import About, check_where, open_sink

if TYPE_CHECKING:
    from rig.scenario.scenario import Scenario

QUEUE_BYTES: Final = 128 * 1024 * 1024  # of waiting rows: minutes of flight
FLUSH_S: Final = 30.0  # longest wait of the worker for a sink at the end; close has a separate one


class SinkLike(Protocol):
    """The part of rig.show.viewer.sink.Sink that the worker uses."""

    where: str
    browser: str

    def begin(self) -> None: ...  # noqa: D102
    def send(self, table: Table, rate_hz: float, events: Sequence[Event]) -> None: ...  # noqa: D102
    def flush(self, timeout_s: float) -> None: ...  # noqa: D102
    def close(self) -> None: ...  # noqa: D102


def open_stream(where: str, title: str, rate_hz: float, out_path: Path, facts: Facts = UNKNOWN) -> Stream | None:
    """Open the stream of ``where``; None for "off".

    where : off | save | serve | spawn | rerun+http://127.0.0.1:PORT/proxy
    out_path : the log's; "save" writes beside it, with the suffix .rrd
    facts : thresholds and faults of the scenario
    BadInput: unknown word, another machine, no display, no viewer listens, file cannot be written.
    """
    check_where(where)
    if where == "off":
        return None
    about = About(title, f"**{title}**", Layout([Shown(facts=facts)]))
    return Stream(open_sink(where, about, out_path.with_suffix(".rrd")), rate_hz)


class Streams:
    """The streams that a flight may open (flight/fly.py is given them)."""

    @staticmethod
    def check(where: str) -> None:
        """Raise BadInput unless there is a stream of that name; import what it needs, which takes a second."""
        check_where(where)
        if where != "off":
            import_module("rig.show.viewer.blueprint")  # and Rerun

    @staticmethod
    def open(where: str, scenario: Scenario, log: Path, unit: str, paced: bool) -> Stream | None:
        """Open the stream of ``where`` for a flight whose ``log`` is open; None for "off"."""
        facts = replace(of_resolved(scenario.resolved()), unit=unit, paced=paced)
        return open_stream(where, scenario.title or log.stem, scenario.rate_hz, log, facts)


class Stream:
    """Takes blocks from the frame loop and sends them to a sink from a separate thread."""

    def __init__(self, sink: SinkLike, rate_hz: float, queue_bytes: int = QUEUE_BYTES) -> None:
        self.where = sink.where
        self.browser = sink.browser
        self._sink = sink
        self._rate_hz = rate_hz
        self._queue_bytes = queue_bytes
        self._changed = threading.Condition()  # guards all below
        self._queue: deque[tuple[Table, Sequence[Event]]] = deque()
        self._closing = False
        self._frames = 0  # given to put
        self._pending = 0  # of these, queued or being sent
        self._sent = 0
        self._error = ""
        self._worker = threading.Thread(target=self._run, name="rerun stream", daemon=True)
        self._worker.start()

    def put(self, table: Table, events: Sequence[Event] = ()) -> None:
        """Queue frames, which the caller must not change, and their events, without waiting for the sink."""
        with self._changed:
            self._frames += len(table)
            if not self._closing and (self._pending + len(table)) * table.rows.itemsize <= self._queue_bytes:
                self._queue.append((table, events))
                self._pending += len(table)
                self._changed.notify_all()

    @property
    def watched(self) -> bool:
        """True if a viewer is connected to the server of "serve"; True for all other sinks."""
        return not self.browser or viewer.connected(urlsplit(self.where.removeprefix("rerun+")).port or 0)

    def drain(self, timeout_s: float = 5.0) -> StreamReport:
        """Wait until the queue is sent; a server continues until close."""
        with self._changed:
            done = self._changed.wait_for(lambda: not self._pending, timeout_s)
            return self._report("" if done else f"not all frames were sent within {timeout_s:g} s", self._pending)

    def close(self, timeout_s: float = 5.0) -> StreamReport:
        """Send what is queued, close the sink and report; after ``timeout_s`` do not wait for the worker."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._worker.join(timeout_s)
        late = self._worker.is_alive()
        if late:
            import rerun

            rerun.unregister_shutdown()  # otherwise the end of the process would wait for a sink that does not reply
        with self._changed:
            return self._report(f"the sink did not finish within {timeout_s:g} s" if late else "", 0)

    def _report(self, trouble: str, pending: int) -> StreamReport:
        dropped = self._frames - self._sent - pending
        return StreamReport(self.where, self.browser, self._sent, dropped, self._error or trouble)

    def _run(self) -> None:
        self._try(self._sink.begin)
        while (item := self._next()) is not None:
            table, events = item
            sent = self._try(lambda: self._sink.send(table, self._rate_hz, events))  # noqa: B023 # called at once
            with self._changed:
                self._pending -= len(table)
                self._sent += len(table) if sent else 0
                self._changed.notify_all()
        self._try(lambda: self._sink.flush(FLUSH_S))
        self._try(self._sink.close)

    def _next(self) -> tuple[Table, Sequence[Event]] | None:
        """Wait for the next block; None after the last one."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._closing)
            return self._queue.popleft() if self._queue else None

    def _try(self, action: Callable[[], None]) -> bool:
        """Run ``action``; keep the first failure of any kind for the report: the flight continues."""
        try:
            action()
        except Exception as error:  # noqa: BLE001
            with self._changed:
                reason = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
                self._error = self._error or reason.splitlines()[0]
            return False
        return True
