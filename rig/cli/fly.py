"""``rig fly`` and ``rig cost``, and how one flight is printed."""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from typer import Exit, echo

from rig.cli.common import AllowCodeOrSet, Json, Logs, ScenarioName, Sets, UnitFile, emit, flag, opt, takes_options
from rig.cli.printing import MOST_LINES, counts, field, line, rest, table
from rig.cli.requirements_option import Requirements, Strict, show_notes, show_verdicts
from rig.cli.working import working
from rig.core.column import Column
from rig.core.errors import BadInput, RigError
from rig.core.progress import tell
from rig.core.units.quantities import moment

if TYPE_CHECKING:
    from rig.core.event import Event
    from rig.core.interrupt import Stop
    from rig.flight.conclusion_rows import Conclusion
    from rig.flight.cost import Bench
    from rig.flight.fly import Flight
    from rig.scenario.scenario import Scenario
    from rig.show.terminal.live import Watch
    from rig.show.viewer.stream import Stream
    from rig.verdict.requirements.along import MeasuredConclusion
    from rig.verdict.requirements.requirement_recorder import Verdict

FEW: Final = 3
_OF_CHANNEL: Final = re.compile(r"(\w+)\.(\d) (isolated by \w+|readmitted)")
LONG: Final = 30_000  # frames: five minutes at 100 a second
LOG_BYTES: Final = 1_450  # of a frame in a log; what each lane, and what servos, add
LANE_BYTES: Final = 60
SERVO_BYTES: Final = 440
FRAME_S: Final = 1.5e-4  # to fly and log one
LOOK_S: Final = 0.1  # between two looks for a viewer, or for Ctrl-C


@dataclass(frozen=True, kw_only=True)
class FlyOptions:
    """The options of ``rig fly``."""

    scenario: ScenarioName = None
    sets: Sets = None
    seed: Annotated[int | None, opt("N", "Seed of all random draws.", min=0, show_default="as in the scenario")] = None
    out: Logs = Path("logs")
    rerun: Annotated[
        str, opt("WHERE", "Output to Rerun: off, save, serve, spawn or rerun+http://127.0.0.1:PORT/proxy.")
    ] = "off"
    wait: Annotated[
        bool,
        flag(
            "--wait/--no-wait",
            "With --rerun serve: start the flight when a viewer is connected. The server runs until Ctrl-C.",
        ),
    ] = True
    realtime_factor: Annotated[
        float | None,
        opt("X", "Speed against the wall clock, 1: real time.", min=0.001, show_default="as fast as possible"),
    ] = None
    realtime: Annotated[
        bool,
        flag(
            "--realtime",
            "Run in real time, with real-time scheduling, locked memory and one core if the system grants them.",
        ),
    ] = False
    watch: Annotated[bool, flag("--watch", "Show the redundancy page in the terminal during the flight.")] = False
    unit: UnitFile = None
    lane: Annotated[str | None, opt("A|B|C|D", "Lane that the unit under test replaces.", show_default=False)] = None
    requirements: Requirements = None
    strict: Strict = False
    allow_code: AllowCodeOrSet = False
    as_json: Json = False


@takes_options
def fly(options: FlyOptions) -> None:
    """Fly one scenario, log each frame, and print the outcome."""
    from rig.show.terminal.live import watching
    from rig.unit.running_unit import running
    from rig.verdict.conclusion import next_commands
    from rig.verdict.requirements.along import MeasuredConclusion, plain, violated

    if options.watch and options.as_json:
        raise BadInput("--watch: not with --json")

    class Told(MeasuredConclusion):
        """The same, with a line before a long flight on its disk space and time."""

        def begin(self, scenario: Scenario, unit_lane: str | None = None, unit_votes: bool = True) -> None:
            super().begin(scenario, unit_lane, unit_votes)
            if (takes := long_flight(scenario)) and not quiet:
                echo(takes, err=True)

    outcome = Told(options.requirements or (), baseline=True)
    quiet = options.as_json or options.watch
    with watching(options.watch, options.realtime_factor) as page, working("starting", not quiet):
        flight = _fly(options, page, outcome)
        with running(options.unit if outcome.needs_baseline else None) as tested:  # which flies its baseline too
            verdicts = outcome.verdicts(flight.log, tested, options.allow_code or bool(options.sets))

    def data() -> dict[str, object]:
        requirements = {"requirements": [plain(verdict) for verdict in verdicts]} if outcome.requirements else {}
        told = {"conclusion": [*(flight.conclusion or ())], **requirements, "next": next_commands(flight)}
        return {**flight.summary(), **told}

    def show() -> None:
        show_flight(flight, verdicts=verdicts)
        show_notes(outcome.requirements, flight.scenario)

    emit(options.as_json, data, show)
    if options.rerun == "save" and flight.stream is not None and flight.stream.error:
        raise RigError(f"{flight.stream.where}: cannot be written: {flight.stream.error}")
    if options.strict and violated(verdicts):
        raise Exit(1)


def long_flight(scenario: Scenario) -> str:
    """Return roughly the disk space and time of a long flight; "" for a short one."""
    frames = scenario.frames
    if frames < LONG:
        return ""
    lanes = scenario.computers.count if scenario.computers.count > 1 else 0
    bytes_a_frame = LOG_BYTES + LANE_BYTES * lanes + SERVO_BYTES * scenario.has_servos
    takes = f"about {frames * bytes_a_frame / 1e6:.0f} MB of log, at least {frames * FRAME_S:.0f} s to fly"
    return f"{frames} frames ({scenario.duration_s:g} s of flight): {takes}"


def _fly(options: FlyOptions, page: Watch | None, outcome: MeasuredConclusion) -> Flight:
    """Fly a scenario as the options say."""
    from rig.flight.fly import fly
    from rig.show.terminal.keyboard import keyboard
    from rig.show.viewer.stream import Streams

    paced = options.realtime or options.realtime_factor is not None
    return fly(
        options.scenario,
        seed=options.seed,
        overrides=options.sets or (),
        out=options.out,
        rerun=options.rerun,
        streams=Streams(),
        realtime_factor=options.realtime_factor,
        progress=None if options.watch else lambda done, total: tell("flying", done, total),
        viewer=Watching(options.wait),
        watch=page,
        allow_code=options.allow_code,
        unit=options.unit,
        lane=options.lane,
        realtime=options.realtime,
        live=keyboard(options.watch and paced),
        outcome=outcome,
    )


class Watching:
    """Print the address of a stream; a served one waits for a viewer, and stays open until Ctrl-C."""

    def __init__(self, wait: bool = True) -> None:
        self._wait = wait

    def opened(self, stream: Stream, stop: Stop) -> None:
        """Print the address to open, and wait until a viewer is connected; Ctrl-C cancels the flight."""
        if not stream.browser:
            return
        waiting = "; the flight starts when a viewer is connected (--no-wait: at once)" if self._wait else ""
        echo(f"watch at {stream.browser}{waiting}", err=True)
        tell("waiting for a viewer")
        while self._wait and not stop.requested and not stream.watched:
            time.sleep(LOOK_S)

    def flown(self, stream: Stream, stop: Stop) -> None:
        """Keep the server open until Ctrl-C, which may have come in flight."""
        if not stream.browser or stop.requested:
            return
        stream.drain()
        echo("the flight is over, the server still runs; Ctrl-C ends it", err=True)
        tell("serving")
        while not stop.requested:
            time.sleep(LOOK_S)


def show_flight(flight: Flight, run: str = "", verdicts: Sequence[Verdict] = ()) -> None:
    """Print the events and facts of a flight, its conclusion, its requirements, and the next commands.

    run : of a campaign, how it compares with the table
    """
    from rig.verdict.conclusion import next_commands

    _verdict(flight)
    if flight.conclusion is not None:
        conclusion(flight.conclusion, next_commands(flight)[0])
    show_verdicts(verdicts)
    if run:
        field("run", run)
    notes = ("faults, votes and transients in detail", "the flight in Rerun", "vote again on the recorded sensors")
    for i, (command, note) in enumerate(zip(next_commands(flight), notes, strict=True)):
        field("next" if i == 0 else "", f"{command}   # {note}", fold=False)


def conclusion(concluded: Conclusion, more: str = "--json has all") -> None:
    """Print a conclusion in at most MOST lines; more : the command that shows what does not fit."""
    style = {"SURVIVED": "bold green", "LOST": "bold red"}.get(concluded.outcome, "bold yellow")
    line((concluded.outcome, style), f"  {concluded.summary}", indent=2)
    lines = concluded.lines(more=more)
    width = max((len(label) for label, _ in lines), default=0)
    for label, text in lines:
        line(f"  {label:{width}}   {text}", indent=width + 5)


def _verdict(flight: Flight) -> None:
    scenario = flight.scenario
    settings = [f"seed {scenario.seed}", flight.voter, *flight.overrides]
    line((scenario.title or scenario.aircraft, "bold"), f"  {', '.join(settings)}")
    events = list(_events(flight.events))
    for event in events[:MOST_LINES]:
        style = {"info": "", "warning": "yellow", "error": "red"}[event.level]
        line(f"  {event.frame / scenario.rate_hz:9.2f} s  {event.name:17} {event.text}", style=style, indent=32)
    rest(len(events), MOST_LINES, "  and {} more events, in the log")
    coils = {f"{name} servo": list(channels) for name, channels in flight.coils_failed.items()}
    failed = (f"{name} channel {', '.join(map(str, numbers))}" for name, numbers in {**flight.failed, **coils}.items())
    lanes = (f"computer {name} at {at_s:.2f} s" for name, at_s in flight.lanes_failed.items())
    field("isolated", "; ".join([*lanes, *failed]) or "no channel")
    for one in (suspect for suspect in flight.suspects if suspect.slow_faults):
        field("suspect", f"{one.signal} channel {one.channel} {one.text()}", style="yellow")
    if below := scenario.gains.below:
        field("gains", f"below the requirement, accepted: {'; '.join(below)}", style="yellow")
    for note in flight.notes:
        field("note", note, style="yellow")
    if flight.not_executed:
        field("faults", f"not executed: {'; '.join(flight.not_executed)}", style="yellow")
    field("peaks", _peaks(flight))
    _timing(flight)
    if flight.unit is not None:
        _unit(flight)
    if flight.stream is not None:
        s = flight.stream
        trouble = f", {s.error}" if s.error else ""
        field("stream", f"{s.where}: {s.sent_frames} frames sent, {s.dropped_frames} dropped{trouble}")
    field("digest", flight.digest)
    field("log", str(flight.log), fold=False)


def _events(events: Iterable[Event]) -> Iterator[Event]:
    """Yield the events; more than FEW of one frame with the same text for several signals as one."""
    for _, of_frame in groupby(events, lambda event: event.frame):
        alike: dict[object, list[tuple[str, Event]]] = {}
        for i, event in enumerate(of_frame):
            signal, text = _said_of(event)
            alike.setdefault((event.name, text) if text else i, []).append((signal, event))
        for several in alike.values():
            if len(several) <= FEW:
                yield from (event for _, event in several)
                continue
            _, first = several[0]
            names = ", ".join(signal for signal, _ in several[:FEW])
            yield replace(first, text=f"{_said_of(first)[1]}: {len(several)} signals, {names} ...")


def _said_of(event: Event) -> tuple[str, str]:
    """Return the signal of an event, and its text about the signal or its channel; "" if there is none."""
    from rig.core.frame import DISCRETE_INDEX, INDEX

    if channel := _OF_CHANNEL.fullmatch(event.text):
        return channel[1], f"channel {channel[2]} {channel[3]}"
    signal, _, text = event.text.partition(": ")
    return (signal, text) if signal in INDEX or signal in DISCRETE_INDEX else ("", "")


def _timing(flight: Flight) -> None:
    speed = f"{flight.us_per_frame:.1f} us per frame, {flight.duration_s / flight.wall_s:.0f} x real time"
    field("run time", f"{flight.frames} frames, {speed}")
    if flight.jitter is not None:
        j = flight.jitter
        field("jitter", f"{_reply(j.median_us, j.p99_us, j.worst_us)}, {j.overruns} overruns")
    if flight.realtime:
        field("realtime", "; ".join(f"{name}: {granted}" for name, granted in flight.realtime.items()))


def _reply(median_us: float, p99_us: float, worst_us: float) -> str:
    return f"median {median_us:.0f} us, 99 % {p99_us:.0f} us, worst {worst_us:.0f} us"


def _unit(flight: Flight) -> None:
    """Print the exchanges with the unit under test, and its output."""
    unit = flight.unit or {}
    if "voter" in unit:
        _exchanges(unit["voter"], flight.scenario.rate_hz)
    _exchanges(unit, flight.scenario.rate_hz)
    reply = unit["reply"]
    field("replies", _reply(reply["median_us"], reply["p99_us"], reply["worst_us"]))
    for text in flight.printed.splitlines()[-MOST_LINES:]:
        field("printed", text)


def _exchanges(unit: dict[str, Any], rate_hz: float) -> None:
    names = ("missed", "late", "requests_lost", "replies_lost", "discarded", "refused", "not_finite", "restarts")
    wrong = counts(unit, names)
    if unit["dead_frame"] is not None:
        wrong.append(f"dead from {moment(unit['dead_frame'], rate_hz)} on")
    if unit["status"] != "ready" or unit["fault_word"]:
        wrong.append(f"last status {unit['status']}, fault word {unit['fault_word']:#010x}")
    text = ", ".join([f"{unit['answered']} frames answered", *wrong])
    field("unit", f"{unit['name']}: {text}", style="yellow" if wrong else "")


def _peaks(flight: Flight) -> str:
    p = flight.peaks
    return (
        f"angle of attack {degrees(p.angle_of_attack_min_rad):.1f} to {degrees(p.angle_of_attack_max_rad):.1f} deg, "
        f"load factor {p.load_factor_min:.2f} to {p.load_factor_max:.2f} g, "
        f"altitude off by {p.altitude_deviation_m:.1f} m, heading by {degrees(p.heading_deviation_rad):.2f} deg"
    )


def cost(
    scenario: ScenarioName = None,
    sets: Sets = None,
    repeats: Annotated[int, opt("N", "Pairs of flights, with and without the rig; the medians count.", min=1)] = 7,
    allow_code: AllowCodeOrSet = False,
    as_json: Json = False,
) -> None:
    """Measure the time of a frame with logging, and print its ratio to bare JSBSim in the same process."""
    from rig.flight.cost import bench as measure
    from rig.scenario.scenario import load

    with working("measuring", not as_json):
        result = measure(load(scenario, sets or (), allow_code=allow_code), repeats)
    emit(as_json, result.as_dict, lambda: _costs(result))


def _costs(result: Bench) -> None:
    table(result.stages_us.items(), (Column("stage", 0), Column("us per frame", 1, ".2f")))
    field("whole frame, log included", f"{result.frame_us:.2f} us", width=27)
    field("bare JSBSim run()", f"{result.bare_us:.2f} us", width=27)
    field("ratio", f"{result.ratio:.2f}  (median of {result.repeats} pairs)", width=27)
    field("log", f"{result.log_bytes_per_frame:.0f} bytes per frame", width=27)
