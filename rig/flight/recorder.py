"""Recorders of a flight: what is found in its rows and kept of them, in the frame loop or on a thread beside it.

Findings         events, summary, faults that did nothing: enough for a flight in memory
FlightRecords    the same with the log, times, and all who watch: ``rig fly``
RecordingThread  another recorder, while the next block is flown: ``rig fly`` too
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from typing import Any, Final, Self

import numpy as np

from rig.core.ending import WHOLE
from rig.core.errors import ManagerFailed
from rig.core.frame import COMPUTERS, TIMING, Table, new_block, to_frame
from rig.core.interrupt import Stop
from rig.flight.events import Event, EventFinder, not_executed
from rig.flight.lane_events import ComputerFinder, Order
from rig.flight.loop import Recorder
from rig.flight.operator_keys import Keys
from rig.flight.pace import JitterCounter, Pace, off_the_core
from rig.flight.servo_events import ActuatorFinder
from rig.flight.summary import Verdict
from rig.flight.time_histogram import Histogram
from rig.log.writer import LogWriter
from rig.scenario.scenario import Scenario
from rig.unit.running_unit import UnitUnderTest
from rig.world.faults import Execution
from rig.world.faults.places import OF_LANES, lanes_of, site

INTERRUPTED: Final = "interrupted"  # an end reason
# A recording spends most of its time outside the interpreter's lock (hash, checksum, compression,
# write); it must get the lock back quickly in between, or the frames would wait for it in the end.
SWITCH_S: Final = 2e-4
# Given each block with its events, which stay as they are.
Watcher = Callable[[Table, Sequence[Event]], None]


class Findings:
    """Findings in the rows of a flight, block after block: events, its summary, faults that did nothing."""

    def __init__(self, scenario: Scenario) -> None:
        self.verdict, self.events = Verdict(), list[Event]()
        self._finder, self.execution = event_finder(scenario), Execution(scenario.faults)
        self.actuators, self.computers = ActuatorFinder(), computer_finder(scenario)

    def record(self, table: Table) -> None:
        """Take the next frames in and keep all of their events."""
        events = self.found(table)
        self.verdict.add(table, events)
        self.execution.add(table.rows)
        self.events += events

    def found(self, table: Table) -> list[Event]:
        """Return the events of the next frames, in order of time."""
        events = [*self._finder.find(table.rows), *self.computers.find(table), *self.actuators.find(table)]
        return sorted(events, key=lambda event: event.frame)

    def end(self) -> list[Event]:
        """Return what only the end can tell: the faults that did nothing."""
        return not_executed(self.verdict.frames - 1, self.execution.missing) if self.verdict.frames else []


class FlightRecords(Findings):
    """Every block into summary and log, and to those who watch."""

    def __init__(
        self,
        scenario: Scenario,
        writer: LogWriter,
        pace: Pace,
        unit: UnitUnderTest | None = None,
        keys: Keys | None = None,
        watchers: Sequence[Watcher] = (),
        assess: Callable[[Table], None] | None = None,
    ) -> None:
        super().__init__(scenario)
        self.scenario, self._writer, self._unit, self._keys, self._watchers = scenario, writer, unit, keys, watchers
        self._assess = assess
        self.jitter = None if pace.period_s is None else JitterCounter(pace.period_s)
        self._replies = Histogram()

    def record(self, table: Table) -> None:
        """Record the next frames; watchers are given them when the log has them."""
        events, last = self.found(table), int(table["frame"][-1])
        if self._unit is not None:
            news = self._unit.news.until(last)
            events = sorted([*events, *news], key=lambda event: event.frame) if news else events
        if self._keys is not None:
            events = sorted([*self._keys.events_until(last), *events], key=lambda event: event.frame)
        self.verdict.add(table, events)
        if self._assess is not None:
            self._assess(table)
        self._writer.write(table, events)
        self.execution.add(table.rows)
        if self.jitter is not None:
            self.jitter.add(table.timing["frame_us"], table.timing["late_us"])
        if self._unit is not None:
            self._replies.add(table.timing["reply_us"])
        for watcher in self._watchers:
            watcher(table, events)

    def unit_result(self) -> dict[str, Any] | None:
        """Return the counts and times of the exchanges with a unit under test."""
        if self._unit is None:
            return None
        lane = {} if self._unit.lane is None else {"lane": self._unit.lane}
        role = {"role": self._unit.unit.role} if self._unit.unit.replaces_law else {}
        return {"name": self._unit.unit.name, **role, **lane, **self._unit.result(), "reply": self._replies.as_dict()}

    def close(self, stop: Stop, failure: ManagerFailed | None) -> str:
        """End the unit's session and write what only the end can tell; return why the flight ended."""
        if self._unit is not None:
            self._unit.end()
        verdict, last = self.verdict, self.end()
        verdict.events += last
        self._writer.write(Table(new_block(0), timing=np.zeros(0, TIMING)), last)
        failed = "the manager class raised" if self._unit is None else "the unit under test is dead"
        reason = end_reason(verdict, stop, self.scenario) if failure is None else failed
        unit = self.unit_result()
        result = {"digest": verdict.digest, "end_reason": reason, "survived": str(verdict.survived)}
        result |= {} if unit is None else {"unit": json.dumps(unit)}
        result |= {} if self._keys is None else {"keys": self._keys.pressed.to_json()}
        self._writer.close(result)
        return reason


class RecordingThread:
    """Hands blocks to a recorder on a thread, in order, and at most one is under way; a context.

    Neither the disk nor the compressor delays a frame, and a flight that is not paced ends sooner.  An error of the
    recorder is raised by the next ``record`` or at the end.
    """

    def __init__(self, recorder: Recorder) -> None:
        self._recorder, self._pool = recorder, ThreadPoolExecutor(1, "recorder", off_the_core)
        self._pending: Future[None] | None = None
        self._context = copy_context()  # listeners to progress are there too
        self._switch_s = sys.getswitchinterval()

    def record(self, table: Table) -> None:
        """Begin to record the next frames as soon as the block before them is done.

        The arrays must stay as they are until the next call has returned.
        """
        self._wait()
        self._pending = self._pool.submit(self._context.run, self._recorder.record, table)

    def _wait(self) -> None:
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def __enter__(self) -> Self:
        sys.setswitchinterval(SWITCH_S)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        try:
            if kind is None:
                self._wait()
        finally:
            sys.setswitchinterval(self._switch_s)
            self._pool.shutdown()


def event_finder(scenario: Scenario) -> EventFinder:
    """Return what finds the events of a flight of this scenario."""
    return EventFinder([fault.label for fault in scenario.faults])


def computer_finder(scenario: Scenario) -> ComputerFinder:
    """Return what finds the events of the lanes of a flight of this scenario."""
    rate_hz, config = scenario.rate_hz, scenario.computers
    orders = [
        Order(to_frame(each.at_s, rate_hz), each.do, None if each.lane is None else COMPUTERS.index(each.lane))
        for each in config.commands
    ]
    lanes = [lanes_of(fault.signal) if site(fault.signal) in OF_LANES else [] for fault in scenario.faults]
    return ComputerFinder(rate_hz, orders, [tuple(i for i in each if i < config.count) for each in lanes])


def end_reason(verdict: Verdict, stop: Stop, scenario: Scenario) -> str:
    """Return why the flight ended; ``rig.core.ending`` has it in words."""
    if not verdict.survived:
        return verdict.end.label
    return INTERRUPTED if stop.requested and verdict.frames < scenario.frames else WHOLE
