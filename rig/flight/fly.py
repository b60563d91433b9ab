"""A flight with its records: the frames of loop.py into log, stream and summary.

import rig
flight = rig.fly("faults/f16_pitch_rate_hardover.toml", seed=2)
flight.survived, flight.failed            # True, {'pitch_rate': [3]}
flight.signal("pitch_rate").voted         # (frames,) array, rad/s
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path
from typing import Any, Protocol

import tomli_w

from rig.core.errors import BadInput, ManagerFailed, RigError
from rig.core.event import Event, StreamReport
from rig.core.frame import Table
from rig.core.interrupt import Stop, interruptible
from rig.core.settings import toml_text
from rig.core.threads import cores
from rig.core.trust import Trust
from rig.flight import loop
from rig.flight.block_length import Use, block_frames
from rig.flight.conclusion_rows import Conclusion
from rig.flight.flight_result import Flight
from rig.flight.operator_keys import Keys
from rig.flight.pace import Pace
from rig.flight.pace import realtime as real_time
from rig.flight.recorder import Findings, FlightRecords, RecordingThread, Watcher
from rig.flight.unit_loop import UnitComputer
from rig.log.of_flight import metadata_before, new_log
from rig.log.writer import compile_packing
from rig.scenario.overrides import Overrides, override_texts, plain_data
from rig.scenario.scenario import Given, Scenario, find, load
from rig.unit.running_unit import UnitUnderTest, running
from rig.unit.unit_file import Unit, as_lane, read_unit

Progress = Callable[[int, int], None]  # frames flown, frames in all
Watch = Callable[..., None]  # a block, its rate in Hz, its events; of a flight with servos, their rows too


class Stream(Protocol):
    """A live stream, which never waits for a viewer (show/viewer/stream.py)."""

    def put(self, table: Table, events: Sequence[Event]) -> None:
        """Take the next frames."""

    def close(self, timeout_s: float) -> StreamReport:
        """Send what is left."""
        ...


class Streams(Protocol):
    """The streams that a flight may open, handed in by the caller."""

    def check(self, where: str) -> None:
        """Raise BadInput unless there is a stream of that name; before anything is written."""

    def open(self, where: str, scenario: Scenario, log: Path, unit: str, paced: bool) -> Stream | None:
        """Open it; None for "off"."""
        ...


class Viewer(Protocol):
    """Told of the stream when it opens and when the flight is over, before it closes."""

    def opened(self, stream: Any, stop: Stop) -> None:
        """Show the stream, which is open at known addresses; the flight begins when this returns."""

    def flown(self, stream: Any, stop: Stop) -> None:
        """Note that the last frame has been handed over; the stream closes when this returns."""


class Outcome(Protocol):
    """Assesses a flight while it is flown."""

    def begin(self, scenario: Scenario, unit_lane: str | None = None, unit_votes: bool = True) -> None:
        """Take the scenario as it is flown, and what a unit under test is; the first frame comes next.

        unit_lane : of several computers, the one that it is; unit_votes : False for a control law
        """

    def add(self, table: Table) -> None:
        """Take the next frames, with their clean channels: a flight is assessed block by block while it is flown."""

    def conclusion(self, log: Path, frames: int) -> Conclusion:
        """Return the conclusion of the finished flight; frames : flown."""
        ...


def fly(
    scenario: Given = None,
    *,
    overrides: Overrides = (),
    seed: int | None = None,
    out: str | Path = "logs",
    rerun: str = "off",
    realtime_factor: float | None = None,
    progress: Progress | None = None,
    viewer: Viewer | None = None,
    watch: Watch | None = None,
    allow_code: bool = False,
    unit: Unit | str | Path | None = None,
    lane: str | None = None,
    realtime: bool = False,
    live: Callable[[Keys], AbstractContextManager[object]] | None = None,
    outcome: Outcome | None = None,
    streams: Streams | None = None,
) -> Flight:
    """Fly a scenario and log every frame.

    scenario : file, bundled name, table with the keys of a scenario file, or result of ``rig.load``; None: the default
    overrides : settings over the scenario: texts ``key=value`` as for ``--set``, or a table of dotted keys
    seed : seed of all random draws, over that of the scenario
    out : folder of the log
    rerun : live stream: "off", "save", "serve", "spawn" or an address "rerun+http://127.0.0.1:PORT/proxy"
    realtime_factor : 1.0 paces the frames by the wall clock; None flies as fast as possible
    progress : called with the frames flown and the frames in all
    viewer, outcome, streams : parts that ``rig fly`` supplies: they show the stream, assess the flight, open the stream
    watch : called with each recorded block of rows; must be quick, and must copy the rows that it keeps
    allow_code : True permits a manager class that the scenario names; one that an override names is always permitted
    unit, lane : unit under test in place of the built-in software, or its unit file; of several computers its lane
    realtime : True asks the system for real-time scheduling; sets ``realtime_factor`` to 1.0 if it is not given
    live : called with the keys of the flight; returns a context manager in which they may be pressed for ``[[live]]``
    BadInput: before anything is written. RigError: the log cannot be written, or a manager class raises.
    """
    text, name, sets = *_file(scenario), override_texts(overrides)
    scenario = load(scenario, overrides, seed, allow_code=allow_code)
    pace = Pace(scenario.rate_hz, 1.0 if realtime and realtime_factor is None else realtime_factor)
    scenario = scenario if live is None else scenario.armed()
    tested = as_lane(read_unit(unit) if isinstance(unit, str | Path) else unit, lane)
    if tested is not None and tested.is_manager:
        scenario, tested = managed(scenario, tested), None
    destination = _Destination(name, text, Path(out), rerun, streams, progress, viewer, watch, sets, outcome)
    with interruptible() as stop, running(tested) as under_test, real_time(realtime) as granted:
        keys = None if live is None else Keys(scenario, pace, stop)
        with nullcontext() if live is None or keys is None else live(keys):
            flight = _fly_and_record(scenario, destination, pace, stop, under_test, keys)
    printed, file = ("", "") if under_test is None else (under_test.printed, under_test.unit.unit_file)
    return replace(flight, overrides=sets, realtime=granted, printed=printed, unit_file=file)


def _file(scenario: Given) -> tuple[str, str]:
    """Return text and name of a scenario's file, for the log; empty for one that was loaded."""
    if isinstance(scenario, Scenario):
        return "", ""
    if isinstance(scenario, Mapping):
        return tomli_w.dumps(plain_data(scenario, "scenario")), ""
    path = find(scenario)
    return StringIO(toml_text(path), newline=None).read(), path.stem  # line ends as a text file's


@dataclass(frozen=True, slots=True)
class _Destination:
    """Places that a flight is recorded to, and who is told of it."""

    name: str  # of the log
    text: str  # of the scenario's file
    out: Path
    rerun: str
    streams: Streams | None
    progress: Progress | None
    viewer: Viewer | None
    watch: Watch | None
    overrides: tuple[str, ...] = ()  # of the scenario's file
    outcome: Outcome | None = None


def managed(scenario: Scenario, unit: Unit) -> Scenario:
    """Return the scenario with the manager class that a unit file names, which is permission to run it."""
    named = scenario.redundancy.model_copy(update={"manager": unit.manager})
    return scenario.model_copy(update={"redundancy": named}).trusted(Trust(unit.source, named=unit.manager))


def _fly_and_record(
    scenario: Scenario, to: _Destination, pace: Pace, stop: Stop, unit: UnitUnderTest | None, keys: Keys | None
) -> Flight:
    """Fly into summary, log and stream; the log is finished whatever happens."""
    if to.streams is not None:
        to.streams.check(to.rerun)
    elif to.rerun != "off":
        raise BadInput(f"--rerun {to.rerun}: this function has no stream for a viewer; use rig.fly")
    use = _use(scenario, to, pace, unit, keys)
    kept = 0 if to.outcome is None else 2 * block_frames(scenario, use)
    if (outcome := to.outcome) is not None:
        outcome.begin(scenario, None if unit is None else unit.lane, unit is None or unit.unit.votes)
    known = None
    if unit is not None:  # it starts with the flight's computer and waits for the first frame: all else comes before
        Findings(scenario)
        compile_packing(scenario.row_parts)
        known = metadata_before(scenario, to.out)
    rig = loop.Rig(scenario, None if unit is None else UnitComputer(unit, pace, stop), keep_clean=kept)
    assess = None
    if outcome is not None:
        assess = lambda flown: outcome.add(Table(flown.rows, flown.beside, clean=rig.faults.clean_of(flown.rows)))  # noqa: E731 # every block
    named, about = to.name or scenario.title or scenario.aircraft, {} if unit is None else unit.metadata()
    software = "" if unit is None else unit.unit.name
    with new_log(to.out, named, scenario, to.text, about, to.overrides, software, known) as writer:
        path, viewer = writer.path, to.viewer
        paced = pace.period_s is not None
        stream = None if to.streams is None else to.streams.open(to.rerun, scenario, path, software, paced)
        if stream is not None and viewer is not None:
            viewer.opened(stream, stop)
        records = FlightRecords(scenario, writer, pace, unit, keys, _watchers(to, scenario, stream), assess)
        began = time.perf_counter()
        try:
            failure = _fly(rig, records, pace, stop, keys, use)
            wall_s = time.perf_counter() - began
            reason = records.close(stop, failure)
            if failure is not None:
                raise RigError(f"{failure}; the log is complete up to there: {path}")
            if stream is not None and viewer is not None and not stop.terminated:
                viewer.flown(stream, stop)
        finally:
            report = None if stream is None else stream.close(10.0)
    conclusion = None if outcome is None else outcome.conclusion(path, records.verdict.frames)
    return _result(records, path, reason, wall_s, report, conclusion)


def _use(scenario: Scenario, to: _Destination, pace: Pace, unit: UnitUnderTest | None, keys: Keys | None) -> Use:
    """Return what the flight is for; a user's software may take long over a frame, and a killed flight loses it."""
    if pace.period_s is not None:
        return "paced"
    own = unit is not None or ":" in scenario.redundancy.manager
    return "watched" if own or to.rerun != "off" or to.watch is not None or keys is not None else "alone"


def _watchers(to: _Destination, scenario: Scenario, stream: Stream | None) -> list[Watcher]:
    """Return who is given every block with its events when the log has it."""
    watchers: list[Watcher] = []
    if stream is not None:
        watchers.append(lambda table, events: stream.put(table.copy(), events))
    if (watch := to.watch) is not None:
        watchers.append(lambda table, events: watch(table, scenario.rate_hz, events))
    if (progress := to.progress) is not None:
        watchers.append(lambda table, _: progress(int(table["frame"][-1]) + 1, scenario.frames))
    return watchers


def _fly(
    rig: loop.Rig, records: FlightRecords, pace: Pace, stop: Stop, keys: Keys | None, use: Use
) -> ManagerFailed | None:
    """Fly to the end of the flight, or until the user's own manager raises or the unit stops, which is returned."""
    before_row = None if keys is None else keys.before_row
    beside = pace.period_s is not None or cores() > 1  # on one core it would only take turns with the frames
    with RecordingThread(records) if beside else nullcontext(records) as recorder:
        try:
            loop.fly(rig, [recorder], pace=pace, stop=stop, before_row=before_row, use=use)
        except ManagerFailed as failure:
            return failure
    return None


def _result(
    records: FlightRecords,
    path: Path,
    reason: str,
    wall_s: float,
    report: StreamReport | None,
    conclusion: Conclusion | None,
) -> Flight:
    """Return what the records of a finished flight come to."""
    verdict = records.verdict
    return Flight(
        log=path,
        scenario=records.scenario,
        frames=verdict.frames,
        digest=verdict.digest,
        survived=verdict.survived,
        end_reason=reason,
        failed=verdict.failed,
        suspects=tuple(one for one in verdict.suspects if one.rows),
        not_executed=[name for name, _ in records.execution.missing],
        peaks=verdict.peaks,
        events=verdict.events,
        wall_s=wall_s,
        us_per_frame=wall_s / max(verdict.frames, 1) * 1e6,
        jitter=None if records.jitter is None else records.jitter.result(),
        stream=report,
        unit=records.unit_result(),
        printed="",
        realtime={},
        coils_failed=records.actuators.failed_at(records.scenario.rate_hz),
        lanes_failed=records.computers.failed_at(),
        conclusion=conclusion,
    )
