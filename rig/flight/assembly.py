"""A flight with its records: the frames of loop.py into log, stream and verdict.

import rig
flight = rig.fly("faults/f16_pitch_rate_hardover.toml", seed=2)
flight.survived, flight.failed            # True, {'pitch_rate': [3]}
flight.signal("pitch_rate").voted         # (frames,) array, rad/s
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from rig import loop
from rig.errors import ManagerFailed, RigError
from rig.flight import unit_loop
from rig.flight.operator_keys import Keys
from rig.flight.pace import Pace
from rig.flight.realtime import beside as off_the_core
from rig.flight.realtime import realtime as asked_realtime
from rig.flight.recorder import Records
from rig.flight.recording_thread import Recorder
from rig.flight.result import Flight
from rig.frame import Block
from rig.log.of_flight import new_log
from rig.record.events import Event
from rig.scenario import Scenario, find, load
from rig.unit.settings import Unit, read_unit
from rig.unit.unit import UnitUnderTest, running
from rig.util.interrupt import Stop, interruptible
from rig.util.trust import Trust
from rig.view.facts import of_resolved
from rig.view.sink import check_where
from rig.view.stream import Stream, StreamReport, open_stream

Progress = Callable[[int, int], None]  # frames flown, frames in all
Watch = Callable[[Block, float, Sequence[Event]], None]  # a block, its rate in Hz, its events


class Viewer(Protocol):
    """Told of the stream when it opens and when the flight is over, before it closes."""

    def opened(self, stream: Stream, stop: Stop) -> None:
        """The stream is open, its addresses are known; the flight begins when this returns."""

    def flown(self, stream: Stream, stop: Stop) -> None:
        """The last frame has been handed over; the stream closes when this returns."""


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
    unit: Unit | str | Path | None = None,
    realtime: bool = False,
    live: Callable[[Keys], AbstractContextManager[object]] | None = None,
) -> Flight:
    """Fly a scenario (a file, a bundled name, or one loaded already) and log every frame.

    seed, overrides : laid over the file, as ``--seed`` and ``--set key=value``; not for a loaded scenario
    out             : folder of the log; rerun : see view.stream.open_stream
    realtime_factor : 1.0 paces frames by the wall clock; None flies as fast as it can
    watch : given every block while it is recorded; it must be quick, and copy the rows that it keeps
    allow_code : a manager class that the scenario names may be run; one that an override names may be in any case
    realtime : ask the system for frames on time (record/realtime.py); at the pace of the clock when no factor is given
    live : a context, given the Keys of the flight, in which they may be pressed; the faults of [[live]] wait for theirs
    unit : flight software under test, or its unit file (docs/unit.md), in the place of our manager
    Raises BadInput before anything is written, RigError when the log cannot be written on or the user's own manager
    raises: the log is then finished.
    """
    text, name = "", ""
    if not isinstance(scenario, Scenario):
        path = find(scenario)
        scenario, text, name = load(path, overrides, seed), path.read_text(encoding="utf-8"), path.stem
    scenario = scenario.trusted(scenario.trust.allowing(allow_code))
    pace = Pace(scenario.rate_hz, 1.0 if realtime and realtime_factor is None else realtime_factor)
    scenario = scenario if live is None else scenario.armed()
    keys = None if live is None else Keys(scenario)
    pressed = nullcontext() if live is None or keys is None else live(keys)
    tested = read_unit(unit) if isinstance(unit, str | Path) else unit
    if tested is not None and tested.carrier == "python":
        scenario, tested = managed(scenario, tested), None
    asked = _Asked(name, text, Path(out), rerun, progress, viewer, watch, tuple(overrides))
    with interruptible() as stop, running(tested) as under, asked_realtime(realtime) as got, pressed:
        flown = _record(scenario, asked, pace, stop, under, keys)
    return replace(flown, overrides=asked.overrides, realtime=got, printed="" if under is None else under.printed)


@dataclass(frozen=True, slots=True)
class _Asked:
    """Where a flight is recorded, and who is told of it."""

    name: str  # of the log
    text: str  # of the scenario's file
    out: Path
    rerun: str
    progress: Progress | None
    viewer: Viewer | None
    watch: Watch | None
    overrides: tuple[str, ...] = ()  # of the scenario's file


def managed(scenario: Scenario, unit: Unit) -> Scenario:
    """The scenario with the manager class that a unit file names, which is permission to run it."""
    named = scenario.redundancy.model_copy(update={"manager": unit.manager})
    return scenario.model_copy(update={"redundancy": named}).trusted(Trust(unit.source, named=unit.manager))


def _record(
    scenario: Scenario, asked: _Asked, pace: Pace, stop: Stop, unit: UnitUnderTest | None, keys: Keys | None
) -> Flight:
    """Run the frames through verdict, log and stream; the log is finished whatever happens."""
    check_where(asked.rerun)
    rig, viewer = loop.Rig(scenario), asked.viewer
    about = {}
    if unit is not None:
        unit_loop.put(unit, rig, scenario, pace, stop)
        about["unit"] = json.dumps({**unit.unit.about(), "said": unit.said})
    records = Records(scenario, pace, unit, keys)
    if keys is not None:
        rig.asked = keys.of_flight(rig, pace, stop)
    named = asked.name or scenario.title or scenario.aircraft
    with new_log(asked.out, named, scenario, asked.text, about, asked.overrides) as writer:
        path, shown = writer.path, scenario.title or writer.path.stem
        facts = replace(of_resolved(scenario.resolved()), **_clocked(unit, pace))
        stream = open_stream(asked.rerun, shown, scenario.rate_hz, path, facts)
        if stream is not None and viewer is not None:
            viewer.opened(stream, stop)
        told = _told(asked, scenario, stream, records)

        def record(rows: Block, timing: NDArray[Any]) -> None:
            events = records.record(rows, timing, writer, beside)
            for tell in told:
                tell(rows, events, timing)

        began = time.perf_counter()
        try:
            with (
                ThreadPoolExecutor(1, "verdict", off_the_core) as beside,
                Recorder(record, threaded=pace.period_s is not None) as recorder,
            ):
                failure = _fly(rig, scenario, pace, stop, recorder)
            wall_s = time.perf_counter() - began
            reason = records.close(writer, stop, failure)
            if failure is not None:
                raise RigError(f"{failure}; the log is complete up to there: {path}")
            if stream is not None and viewer is not None and not stop.terminated:
                viewer.flown(stream, stop)
        finally:
            report = None if stream is None else stream.close(10.0)
    return _came_to(records, path, reason, wall_s, report)


Tell = Callable[[Block, Sequence[Event], NDArray[Any]], None]


def _clocked(unit: UnitUnderTest | None, pace: Pace) -> dict[str, Any]:
    """What the viewer must know to show the wall clock."""
    return {"unit": "" if unit is None else unit.unit.name, "paced": pace.period_s is not None}


def _told(asked: _Asked, scenario: Scenario, stream: Stream | None, records: Records) -> list[Tell]:
    """Who is given every block with its events when the log has it."""
    told: list[Tell] = []
    if stream is not None:
        told.append(lambda rows, events, timing: stream.put(rows.copy(), events, timing.copy()))
    if (watch := asked.watch) is not None:
        told.append(lambda rows, events, timing: watch(rows, scenario.rate_hz, events))
    if (progress := asked.progress) is not None:
        told.append(lambda rows, events, timing: progress(records.verdict.frames, scenario.frames))
    return told


def _fly(rig: loop.Rig, scenario: Scenario, pace: Pace, stop: Stop, recorder: Recorder) -> ManagerFailed | None:
    """Fly to the end of the flight, or until the user's own manager raises, which is returned."""
    try:
        for rows, timing in loop.frames(rig, scenario, pace, stop):
            recorder.put(rows, timing)
    except ManagerFailed as failure:
        return failure
    return None


def _came_to(records: Records, path: Path, reason: str, wall_s: float, report: StreamReport | None) -> Flight:
    """What the records of a finished flight come to."""
    verdict = records.verdict
    return Flight(
        log=path,
        scenario=records.scenario,
        frames=verdict.frames,
        digest=verdict.digest,
        survived=verdict.survived,
        end_reason=reason,
        failed=verdict.failed,
        not_executed=[name for name, _ in records.execution.missing],
        peaks=verdict.peaks,
        events=verdict.events,
        wall_s=wall_s,
        us_per_frame=wall_s / max(verdict.frames, 1) * 1e6,
        jitter=None if records.jitter is None else records.jitter.result(),
        stream=report,
        unit=records.of_unit(),
        printed="",
        realtime={},
    )
