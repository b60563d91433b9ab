"""What the commands print for people: tables and a progress bar on a terminal, plain lines in a pipe."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeRemainingColumn

from rig.console import Screen, console, styled
from rig.frame import DISCRETES, SIGNALS

if TYPE_CHECKING:
    from rig.bench import Bench
    from rig.computer.analytic.designed import Designed
    from rig.flight import Flight
    from rig.flight import Progress as Report
    from rig.view.stream import Stream

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


@contextmanager
def progress(enabled: bool) -> Iterator[Report | None]:
    """How far a flight is, and the time left; nothing in a pipe."""
    share = TextColumn("{task.percentage:3.0f} %")
    with bar(enabled, TextColumn("flying"), BarColumn(), share, TimeRemainingColumn()) as shown:
        yield None if shown is None else _reporter(shown)


def _reporter(shown: Progress) -> Report:
    task = shown.add_task("flight")
    return lambda done, total: shown.update(task, completed=done, total=total)


class Watching:
    """Says where a stream can be watched, and keeps a served one open until Ctrl-C when somebody is there."""

    def opened(self, stream: Stream) -> None:
        """Print the address to open."""
        if stream.browser:
            print(f"watch at {stream.browser}", file=sys.stderr, flush=True)

    def flown(self, stream: Stream) -> None:
        """Hold the server on a terminal."""
        if not stream.browser or not sys.stdin.isatty():
            return
        stream.drain()
        print("flight over, still serving; Ctrl-C ends", file=sys.stderr, flush=True)
        with suppress(KeyboardInterrupt):
            signal.pause()


def flight(flown: Flight) -> None:
    """The verdict of one flight."""
    screen, scenario = console(), flown.scenario
    screen.print(styled((scenario.title or scenario.aircraft, "bold"), f"  seed {scenario.seed}"))
    for event in flown.events[:MOST_LINES]:
        style = {"info": "", "warning": "yellow", "error": "red"}[event.level]
        screen.print(f"  {event.frame / scenario.rate_hz:9.2f} s  {event.name:17} {event.text}", style=style)
    if len(flown.events) > MOST_LINES:
        screen.print(f"  and {len(flown.events) - MOST_LINES} more events, in the log")
    verdict = ("survived", "green") if flown.survived else ("lost", "red")
    reason = f": {flown.end_reason} ({flown.frames} frames, {flown.duration_s:g} s)"
    screen.print(styled("verdict  ", verdict, reason))
    failed = (f"{name} channel {', '.join(map(str, numbers))}" for name, numbers in flown.failed.items())
    screen.print(f"failed   {'; '.join(failed) or 'no channel'}")
    if below := scenario.gains.below:
        screen.print(f"gains    below the requirement, accepted: {'; '.join(below)}", style="yellow")
    if flown.not_executed:
        screen.print(f"faults   not executed: {'; '.join(flown.not_executed)}", style="yellow")
    screen.print(f"peaks    {_peaks(flown)}")
    screen.print(f"speed    {flown.us_per_frame:.1f} us a frame, {flown.duration_s / flown.wall_s:.0f} x real time")
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
        wrong.append(f"dead from frame {unit['dead_frame']} on")
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


def scenarios(found: dict[str, str]) -> None:
    """Bundled scenarios and their titles."""
    console().table(("scenario", "title"), found.items())


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
