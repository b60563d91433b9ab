"""What is found in the rows of a flight and kept of them: events, verdict, the log, times."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.errors import ManagerFailed
from rig.faults import Execution
from rig.flight.operator_keys import Keys
from rig.flight.pace import Histogram, JitterCounter, Pace
from rig.frame import TIMING, Block, new_block
from rig.log import LogWriter
from rig.record.events import Event, EventFinder, not_executed
from rig.record.flight_summary import Verdict
from rig.scenario import Scenario
from rig.unit.unit import UnitUnderTest
from rig.util.interrupt import Stop

INTERRUPTED: Final = "interrupted"  # an end reason


class Findings:
    """What is found in the rows of a flight, block after block: events, its summary, faults that did nothing."""

    def __init__(self, scenario: Scenario) -> None:
        self.verdict = Verdict()
        self._finder, self.execution = event_finder(scenario), Execution(scenario.faults)

    def add(self, rows: Block) -> list[Event]:
        """The events of the next rows."""
        events = self._finder.find(rows)
        self.verdict.add(rows, events)
        self.execution.add(rows)
        return events

    def end(self) -> list[Event]:
        """What only the end can tell: the faults that did nothing."""
        return not_executed(self.verdict.frames - 1, self.execution.missing) if self.verdict.frames else []


class Records(Findings):
    """What is kept of every block, and what the flight comes to."""

    def __init__(self, scenario: Scenario, pace: Pace, unit: UnitUnderTest | None, keys: Keys | None = None) -> None:
        super().__init__(scenario)
        self.scenario, self._unit, self._replies, self._keys = scenario, unit, Histogram(), keys
        self.jitter = None if pace.period_s is None else JitterCounter(pace.period_s)

    def record(self, rows: Block, timing: NDArray[Any], writer: LogWriter, beside: ThreadPoolExecutor) -> list[Event]:
        """Into summary and log; the events of the block."""
        events = self._finder.find(rows)
        if self._keys is not None and len(rows):
            events = sorted([*self._keys.told(int(rows["frame"][-1])), *events], key=lambda event: event.frame)
        hashed = beside.submit(self.verdict.add, rows, events)  # both leave the interpreter to each other
        writer.write(rows, timing, events)
        self.execution.add(rows)
        hashed.result()
        if self.jitter is not None:
            self.jitter.add(timing["frame_us"], timing["late_us"])
        if self._unit is not None:
            self._replies.add(timing["reply_us"])
        return events

    def of_unit(self) -> dict[str, Any] | None:
        """What became of the exchanges, and how long they took."""
        if self._unit is None:
            return None
        return {"name": self._unit.unit.name, **self._unit.result(), "reply": self._replies.as_dict()}

    def close(self, writer: LogWriter, stop: Stop, failure: ManagerFailed | None) -> str:
        """Write what only the end can tell; why the flight ended."""
        if self._unit is not None:
            self._unit.end()
        verdict, last = self.verdict, self.end()
        verdict.events += last
        writer.write(new_block(0), np.zeros(0, TIMING), last)
        failed = "the manager class raised" if self._unit is None else "the unit under test is dead"
        reason = end_reason(verdict, stop, self.scenario) if failure is None else failed
        unit = self.of_unit()
        about = {} if unit is None else {"unit": json.dumps(unit)}
        if self._keys is not None:
            about["keys"] = self._keys.pressed.to_json()
        writer.close({"digest": verdict.digest, "end_reason": reason, "survived": str(verdict.survived), **about})
        return reason


def event_finder(scenario: Scenario) -> EventFinder:
    """What finds the events of a flight of this scenario."""
    return EventFinder([fault.label for fault in scenario.faults])


def end_reason(verdict: Verdict, stop: Stop, scenario: Scenario) -> str:
    """Why the flight ended, as a reader would say it."""
    if not verdict.survived:
        return verdict.end.label
    return INTERRUPTED if stop.requested and verdict.frames < scenario.frames else "duration flown"
