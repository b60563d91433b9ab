"""A flight with its records: the frames of loop.py into log, stream and verdict.

import rig
flight = rig.fly("faults/f16_pitch_rate_hardover.toml", seed=2)
flight.survived, flight.failed            # True, {'pitch_rate': [3]}
flight.signal("pitch_rate").voted         # (frames,) array, rad/s
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from rig import loop
from rig.errors import ManagerFailed, RigError
from rig.faults import Execution
from rig.frame import TIMING, Block, new_block
from rig.interrupt import Stop, interruptible
from rig.log import Log, LogWriter, SignalArrays, read_log
from rig.log.of_flight import new_log
from rig.record.events import Event, EventFinder, not_executed
from rig.record.flight_summary import Peaks, Verdict
from rig.record.pace import Jitter, JitterCounter, Pace
from rig.record.recorder import Recorder
from rig.scenario import Scenario, find, load
from rig.view.facts import of_resolved
from rig.view.sink import check_where
from rig.view.stream import Stream, StreamReport, open_stream

INTERRUPTED: Final = "interrupted"  # an end reason
Progress = Callable[[int, int], None]  # frames flown, frames in all
Watch = Callable[[Block, float, Sequence[Event]], None]  # a block, its rate in Hz, its events


class Viewer(Protocol):
    """Told of the stream when it opens and when the flight is over, before it closes."""

    def opened(self, stream: Stream) -> None:
        """The stream is open; its addresses are known."""

    def flown(self, stream: Stream) -> None:
        """The last frame has been handed over; the stream closes when this returns."""


@dataclass(frozen=True)
class Flight:
    """What a flight came to; its frames are read from the log when asked for."""

    log: Path
    scenario: Scenario
    frames: int
    digest: str
    survived: bool
    end_reason: str
    failed: dict[str, list[int]]
    not_executed: list[str]  # faults that did nothing: never triggered, or their channels were out already
    peaks: Peaks
    events: list[Event]
    wall_s: float
    us_per_frame: float
    jitter: Jitter | None  # paced flights only
    stream: StreamReport | None

    @property
    def duration_s(self) -> float:
        """Simulated time flown."""
        return self.frames / self.scenario.rate_hz

    @cached_property
    def recorded(self) -> Log:
        """The log, read when it is first asked for."""
        return read_log(self.log)

    @property
    def rows(self) -> Block:
        """All frames as one block, read from the log."""
        return self.recorded.rows

    def signal(self, name: str) -> SignalArrays:
        """The arrays of one signal; KeyError when there is no such signal."""
        return self.recorded.signal(name)

    def summary(self) -> dict[str, Any]:
        """The flight as plain data, as ``rig fly --json`` prints it."""
        dt_s = 1.0 / self.scenario.rate_hz
        timing: dict[str, Any] = {
            "us_per_frame": self.us_per_frame,
            "realtime_factor": self.duration_s / self.wall_s,
        }
        if self.jitter is not None:
            timing["jitter"] = asdict(self.jitter)
        return {
            "log": str(self.log),
            "frames": self.frames,
            "duration_s": self.duration_s,
            "seed": self.scenario.seed,
            "digest": self.digest,
            "survived": self.survived,
            "end_reason": self.end_reason,
            "failed": self.failed,
            "not_executed": self.not_executed,
            "peaks": asdict(self.peaks),
            "events": [{"time_s": event.frame * dt_s, **asdict(event)} for event in self.events],
            "timing": timing,
            "stream": None if self.stream is None else asdict(self.stream),
        }


def fly(
    scenario: Scenario | str | Path | None = None,
    *,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    out: str | Path = "logs",
    rerun: str = "off",
    realtime_factor: float | None = None,
    progress: Progress | None = None,
    viewer: Viewer | None = None,
    watch: Watch | None = None,
    allow_code: bool = False,
) -> Flight:
    """Fly a scenario (a file, a bundled name, or one loaded already) and log every frame.

    seed, overrides : laid over the file, as ``--seed`` and ``--set key=value``; not for a loaded scenario
    out             : folder of the log; rerun : see view.stream.open_stream
    realtime_factor : 1.0 paces frames by the wall clock; None flies as fast as it can
    watch : given every block while it is recorded; it must be quick, and copy the rows that it keeps
    allow_code : a manager class that the scenario names may be run; one that an override names may be in any case
    Raises BadInput before anything is written, RigError when the log cannot be written on or the user's own manager
    raises: the log is then finished.
    """
    text, name = "", ""
    if not isinstance(scenario, Scenario):
        path = find(scenario)
        scenario, text, name = load(path, overrides, seed), path.read_text(encoding="utf-8"), path.stem
    scenario = scenario.trusted(scenario.trust.allowing(allow_code))
    pace = Pace(scenario.rate_hz, realtime_factor)
    with interruptible() as stop:
        return _record(scenario, text, name, Path(out), rerun, pace, stop, progress, viewer, watch)


def _record(
    scenario: Scenario,
    text: str,
    name: str,
    out: Path,
    rerun: str,
    pace: Pace,
    stop: Stop,
    progress: Progress | None,
    viewer: Viewer | None,
    watch: Watch | None,
) -> Flight:
    """Run the frames through verdict, log and stream; the log is finished whatever happens."""
    check_where(rerun)
    rig = loop.Rig(scenario)
    records = _Records(scenario, pace)
    with new_log(out, name or scenario.title or scenario.aircraft, scenario, text) as writer:
        path = writer.path
        stream = open_stream(
            rerun, scenario.title or path.stem, scenario.rate_hz, path, of_resolved(scenario.resolved())
        )
        if stream is not None and viewer is not None:
            viewer.opened(stream)

        def record(rows: Block, timing: NDArray[Any]) -> None:
            events = records.record(rows, timing, writer, beside)
            if stream is not None:
                stream.put(rows.copy(), events)
            if watch is not None:
                watch(rows, scenario.rate_hz, events)
            if progress is not None:
                progress(records.verdict.frames, scenario.frames)

        began = time.perf_counter()
        try:
            with (
                ThreadPoolExecutor(1, "verdict") as beside,
                Recorder(record, threaded=pace.period_s is not None) as recorder,
            ):
                failure = _fly(rig, scenario, pace, stop, recorder)
            wall_s = time.perf_counter() - began
            reason = records.close(writer, stop, failure)
            if failure is not None:
                raise RigError(f"{failure}; the log is complete up to there: {path}")
            if stream is not None and viewer is not None and not stop.terminated:
                viewer.flown(stream)
        finally:
            report = None if stream is None else stream.close(10.0)
    return records.flight(path, reason, wall_s, report)


def _fly(rig: loop.Rig, scenario: Scenario, pace: Pace, stop: Stop, recorder: Recorder) -> ManagerFailed | None:
    """Fly to the end of the flight, or until the user's own manager raises, which is returned."""
    try:
        for rows, timing in loop.frames(rig, scenario, pace, stop):
            recorder.put(rows, timing)
    except ManagerFailed as failure:
        return failure
    return None


class Findings:
    """What is found in the rows of a flight, block after block: events, its summary, faults that did nothing."""

    def __init__(self, scenario: Scenario) -> None:
        self.verdict = Verdict()
        self._finder, self._execution = event_finder(scenario), Execution(scenario.faults)

    def add(self, rows: Block) -> list[Event]:
        """The events of the next rows."""
        events = self._finder.find(rows)
        self.verdict.add(rows, events)
        self._execution.add(rows)
        return events

    def end(self) -> list[Event]:
        """What only the end can tell: the faults that did nothing."""
        return not_executed(self.verdict.frames - 1, self._execution.missing) if self.verdict.frames else []


class _Records(Findings):
    """What is kept of every block, and what the flight comes to."""

    def __init__(self, scenario: Scenario, pace: Pace) -> None:
        super().__init__(scenario)
        self.scenario = scenario
        self._jitter = None if pace.period_s is None else JitterCounter(pace.period_s)

    def record(self, rows: Block, timing: NDArray[Any], writer: LogWriter, beside: ThreadPoolExecutor) -> list[Event]:
        """Into summary and log; the events of the block."""
        events = self._finder.find(rows)
        hashed = beside.submit(self.verdict.add, rows, events)  # both leave the interpreter to each other
        writer.write(rows, timing, events)
        self._execution.add(rows)
        hashed.result()
        if self._jitter is not None:
            self._jitter.add(timing["frame_us"], timing["late_us"])
        return events

    def close(self, writer: LogWriter, stop: Stop, failure: ManagerFailed | None) -> str:
        """Write what only the end can tell; why the flight ended."""
        verdict, last = self.verdict, self.end()
        verdict.events += last
        writer.write(new_block(0), np.zeros(0, TIMING), last)
        reason = end_reason(verdict, stop, self.scenario) if failure is None else "the manager class raised"
        writer.close({"digest": verdict.digest, "end_reason": reason, "survived": str(verdict.survived)})
        return reason

    def flight(self, path: Path, reason: str, wall_s: float, report: StreamReport | None) -> Flight:
        """What the records of a finished flight come to."""
        verdict = self.verdict
        return Flight(
            log=path,
            scenario=self.scenario,
            frames=verdict.frames,
            digest=verdict.digest,
            survived=verdict.survived,
            end_reason=reason,
            failed=verdict.failed,
            not_executed=[name for name, _ in self._execution.missing],
            peaks=verdict.peaks,
            events=verdict.events,
            wall_s=wall_s,
            us_per_frame=wall_s / max(verdict.frames, 1) * 1e6,
            jitter=None if self._jitter is None else self._jitter.result(),
            stream=report,
        )


def event_finder(scenario: Scenario) -> EventFinder:
    """What finds the events of a flight of this scenario."""
    return EventFinder(labels(scenario))


def labels(scenario: Scenario) -> list[str]:
    """The faults of a scenario by name, for the event finder."""
    return [fault.label for fault in scenario.faults]


def end_reason(verdict: Verdict, stop: Stop, scenario: Scenario) -> str:
    """Why the flight ended, as a reader would say it."""
    if not verdict.survived:
        return verdict.end.label
    return INTERRUPTED if stop.requested and verdict.frames < scenario.frames else "duration flown"
