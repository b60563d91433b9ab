"""What the commands print for people: tables and a progress bar on a terminal, plain lines in a pipe."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rich.progress import Progress, ProgressColumn

from rig.cli.common import emit
from rig.frame import DISCRETES, SIGNALS
from rig.units.quantities import moment
from rig.util.console import Screen, console, styled
from rig.util.progress import tell

if TYPE_CHECKING:
    from rig.computer.analytic.designed import Designed
    from rig.flight.assembly import Flight
    from rig.flight.frame_cost import Bench
    from rig.util.interrupt import Stop
    from rig.view.stream import Stream

LOOK_S: Final = 0.1  # between two looks for a viewer, or for Ctrl-C
MOST_LINES = 40  # of events on the terminal; all of them are in the log


@contextmanager
def bar(enabled: bool, *columns: ProgressColumn) -> Iterator[Progress | None]:
    """A progress bar on standard error while it is a terminal; None in a pipe or when not enabled."""
    screen = Screen(stderr=True)
    if not enabled or not screen.is_terminal:
        yield None
        return
    with Progress(*columns, console=screen, transient=True) as shown:
        yield shown


class Watching:
    """Says where a stream can be watched; a served one waits for a viewer, and stays open until Ctrl-C."""

    def __init__(self, wait: bool = True) -> None:
        self._wait = wait

    def opened(self, stream: Stream, stop: Stop) -> None:
        """Print the address to open, and wait until a viewer is connected; Ctrl-C gives the flight up."""
        if not stream.browser:
            return
        waiting = "; the flight begins when a viewer is connected (--no-wait: at once)" if self._wait else ""
        print(f"watch at {stream.browser}{waiting}", file=sys.stderr, flush=True)
        tell("waiting for a viewer")
        while self._wait and not stop.requested and not stream.watched:
            time.sleep(LOOK_S)

    def flown(self, stream: Stream, stop: Stop) -> None:
        """Hold the server until Ctrl-C, which may have come in flight."""
        if not stream.browser or stop.requested:
            return
        stream.drain()
        print("flight over, still serving; Ctrl-C ends", file=sys.stderr, flush=True)
        tell("serving")
        while not stop.requested:
            time.sleep(LOOK_S)


def emit_flight(as_json: bool, flown: Flight, said: list[str]) -> None:
    """The summary of one flight with what its conclusion ``said`` and the next commands, for people or as JSON."""
    from rig.assess.conclusion import next_commands

    follow = next_commands(flown.log)
    emit(as_json, lambda: {**flown.summary(), "conclusion": said, "next": follow}, lambda: _concluded(flown, said))


def _concluded(flown: Flight, said: list[str]) -> None:
    flight(flown)
    conclusion(said)
    next_steps(flown.log)


def conclusion(said: Sequence[str]) -> None:
    """The sentences of a conclusion, the first MOST_LINES and the last."""
    screen = console()
    screen.print("conclusion", style="bold")
    left = len(said) - MOST_LINES
    for line in said if left <= 0 else [*said[: MOST_LINES - 1], f"and {left} more, with --json", said[-1]]:
        screen.print(f"  {line}", soft_wrap=True)


_NEXT: Final = ("against the truth", "in Rerun", "run the manager over the log again")


def next_steps(log: Path) -> None:
    """The commands that show more of a log."""
    from rig.assess.conclusion import next_commands

    for i, (command, what) in enumerate(zip(next_commands(log), _NEXT, strict=True)):
        console().print(f"{'next' if i == 0 else '':9}{command}   # {what}", soft_wrap=True)


def flight(flown: Flight) -> None:
    """The verdict of one flight."""
    screen, scenario = console(), flown.scenario
    about = [f"seed {scenario.seed}", f"manager {scenario.redundancy.manager}", *flown.overrides]
    screen.print(styled((scenario.title or scenario.aircraft, "bold"), f"  {', '.join(about)}"), soft_wrap=True)
    for event in flown.events[:MOST_LINES]:
        style = {"info": "", "warning": "yellow", "error": "red"}[event.level]
        screen.print(f"  {event.frame / scenario.rate_hz:9.2f} s  {event.name:17} {event.text}", style=style)
    if len(flown.events) > MOST_LINES:
        screen.print(f"  and {len(flown.events) - MOST_LINES} more events, in the log")
    verdict = ("survived", "green") if flown.survived else ("lost", "red")
    reason = f": {flown.end_reason} ({flown.frames} frames, {flown.duration_s:g} s)"
    screen.print(styled("result   ", verdict, reason))
    failed = (f"{name} channel {', '.join(map(str, numbers))}" for name, numbers in flown.failed.items())
    screen.print(f"failed   {'; '.join(failed) or 'no channel'}")
    if below := scenario.gains.below:
        screen.print(f"gains    below the requirement, accepted: {'; '.join(below)}", style="yellow")
    if flown.not_executed:
        screen.print(f"faults   not executed: {'; '.join(flown.not_executed)}", style="yellow")
    screen.print(f"peaks    {_peaks(flown)}")
    screen.print(f"run time {flown.us_per_frame:.1f} us per frame, {flown.duration_s / flown.wall_s:.0f} x real time")
    if flown.jitter is not None:
        j = flown.jitter
        screen.print(
            f"jitter   median {j.median_us:.0f} us, 99 % {j.p99_us:.0f} us, worst {j.worst_us:.0f} us, "
            f"{j.overruns} overruns"
        )
    if flown.realtime:
        screen.print(f"realtime {'; '.join(f'{name}: {got}' for name, got in flown.realtime.items())}")
    if flown.unit is not None:
        _unit(flown)
    if flown.stream is not None:
        s = flown.stream
        trouble = f", {s.error}" if s.error else ""
        screen.print(f"stream   {s.where}: {s.sent_frames} frames sent, {s.dropped_frames} dropped{trouble}")
    screen.print(f"digest   {flown.digest}")
    screen.print(f"log      {flown.log}", soft_wrap=True)


def _unit(flown: Flight) -> None:
    """What became of the exchanges with the unit under test, and what it printed."""
    screen, unit = console(), flown.unit or {}
    told = ("missed", "late", "requests_lost", "replies_lost", "discarded", "refused", "not_finite", "restarts")
    wrong = [f"{unit[name]} {name.replace('_', ' ')}" for name in told if unit[name]]
    if unit["dead_frame"] is not None:
        wrong.append(f"dead from {moment(unit['dead_frame'], flown.scenario.rate_hz)} on")
    text = ", ".join([f"{unit['answered']} frames answered", *wrong])
    screen.print(f"unit     {unit['name']}: {text}", style="yellow" if wrong else "")
    reply = unit["reply"]
    screen.print(
        f"replies  median {reply['median_us']:.0f} us, 99 % {reply['p99_us']:.0f} us, worst {reply['worst_us']:.0f} us"
    )
    for line in flown.printed.splitlines()[-MOST_LINES:]:
        screen.print(f"printed  {line}")


def _peaks(flown: Flight) -> str:
    p = flown.peaks
    return (
        f"angle of attack {degrees(p.angle_of_attack_min_rad):.1f} to {degrees(p.angle_of_attack_max_rad):.1f} deg, "
        f"load factor {p.load_factor_min:.2f} to {p.load_factor_max:.2f} g, "
        f"altitude off by {p.altitude_deviation_m:.1f} m, heading by {degrees(p.heading_deviation_rad):.2f} deg"
    )


def scenarios(rows: Sequence[tuple[str, str, str]]) -> None:
    """Bundled scenarios: name, aircraft, title."""
    console().table(("scenario", "aircraft", "title"), rows)


SIGNAL_COLUMNS = ("signal", "symbol", "unit", "range", "channels", "group", "topic")


def signal_rows() -> list[tuple[str, ...]]:
    """The table of the frame, a row a signal, discretes last."""
    rows = []
    for s in SIGNALS:
        span = f"{s.low:.6g} to {s.high:.6g}" + (", wraps" if s.wraps else "")
        rows.append((s.name, s.symbol, s.unit, span, str(s.channels), s.group, s.topic))
    for d in DISCRETES:
        rows.append((d.name, "", "0 or 1", f"fail-safe {d.fail_safe}", str(d.channels), "discretes", d.topic))
    return rows


def signals() -> None:
    """Every signal and discrete."""
    console().table(SIGNAL_COLUMNS, signal_rows())


def signals_markdown() -> None:
    """The same as a Markdown table."""
    for row in (SIGNAL_COLUMNS, ["---"] * len(SIGNAL_COLUMNS), *signal_rows()):
        print(f"| {' | '.join(row)} |")


def bench(result: Bench) -> None:
    """What a frame costs, stage by stage."""
    screen = console()
    screen.table(("stage", "us a frame"), ((name, f"{cost:.2f}") for name, cost in result.stages_us.items()))
    screen.print(f"whole frame, log included  {result.frame_us:.2f} us")
    screen.print(f"bare JSBSim run()          {result.bare_us:.2f} us")
    screen.print(f"ratio                      {result.ratio:.2f}  (median of {result.repeats} pairs)")
    screen.print(f"log                        {result.log_bytes_per_frame:.0f} bytes a frame")


def design(references: Designed, target: Path, beside: Path) -> None:
    """The errors that the references were measured to have."""
    screen = console()
    rows = [
        (name, source, *(f"{number:.3g}" for number in (e.rms, e.quantile_999, e.worst, e.threshold)))
        for name, sources in references.errors.items()
        for source, e in sources.items()
    ]
    screen.table(("signal", "reference from", "RMS", "99.9 %", "worst", "threshold"), rows)
    screen.print(f"gains and margins written to {target}", soft_wrap=True)
    screen.print(f"references written to {beside}", soft_wrap=True)
