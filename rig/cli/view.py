"""``rig view`` and ``rig watch``: flights and votes in Rerun, and flights in the terminal."""

from __future__ import annotations

import gc
import signal
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

from typer import echo

from rig.cli import complete
from rig.cli.common import Json, LogFile, arg, emit, flag, opt, takes_options
from rig.cli.requirements_option import Requirements
from rig.core.errors import BadInput, BadLog
from rig.core.outputs import require_apart
from rig.core.text import plain

if TYPE_CHECKING:
    from rig.log import Log
    from rig.show.viewer.opened import Contents


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """The options of ``rig view``."""

    logs: Annotated[
        list[Path],
        arg("LOG...", "Logs of flights, drawn over each other; or one output of rig vote, or one recording."),
    ]
    save: Annotated[Path | None, opt("FILE.rrd", "File for a recording with the layout.")] = None
    serve: Annotated[bool, flag("--serve", "Serve to a browser on this machine until Ctrl-C.")] = False
    screenshot: Annotated[Path | None, opt("FILE.png", "File for a picture, 1920 x 1080. Needs no display.")] = None
    time_s: Annotated[
        float | None, opt("S", "Time of the cursor in the picture, s.", "--time", show_default="last event")
    ] = None
    tab: Annotated[str, opt("NAME", "Tab that is shown first.", autocompletion=complete.tabs)] = "overview"
    requirements: Requirements = None
    config: Annotated[
        Path | None, opt("FILE", "Configuration with which the recording is voted first, TOML, as for rig vote.")
    ] = None
    preset: Annotated[
        str | None,
        opt("NAME", "Preset with which the log of another system is voted first.", show_default="by its format"),
    ] = None
    map_tiles: Annotated[bool, flag("--map", "Show a map. The viewer loads its tiles from OpenStreetMap.")] = False
    as_json: Json = False


@takes_options
def view(options: ViewOptions) -> None:
    """Show flights or votes in Rerun: in a window, or by --save, --serve or --screenshot."""
    save, screenshot = options.save, options.screenshot
    if sum((save is not None, options.serve, screenshot is not None)) > 1:
        raise BadInput("--save, --serve, --screenshot: only one of them at a time")
    if options.time_s is not None and screenshot is None:
        raise BadInput("--time: needs --screenshot")
    require_apart({"--save": save, "--screenshot": screenshot}, [*options.logs, options.config])
    if save is None and not options.serve and screenshot is None:
        _require_display()
    gc.disable()  # which saves 0.15 s of opening ten minutes
    try:
        _view(options)
    finally:
        gc.enable()


def _view(options: ViewOptions) -> None:
    """Read the logs, and show, serve or write them."""
    began = perf_counter()
    from rig.show.viewer import opened

    shown = _opened(options)
    data: dict[str, Any] = {"logs": [str(log) for log in options.logs], "frames": shown.frames}
    count = f"{shown.frames} {shown.counted}"
    if options.serve:
        _serve(shown, data, options.as_json)
        return
    if options.save is not None:
        opened.save(shown, options.save)
        data["saved"] = str(options.save)
        where = f"{options.save}; open it with: rerun {options.save}"
    elif options.screenshot is not None:
        from rig.show.viewer.screenshot import screenshot as shoot

        shot = shoot(shown, options.screenshot, options.time_s)
        data |= {"picture": str(options.screenshot), "views": list(shot.views), "complaints": list(shot.complaints)}
        where = f"{options.screenshot}"
    else:
        with opened.window(shown) as process, suppress(KeyboardInterrupt):
            data["seconds"] = perf_counter() - began
            _emit(data, options.as_json, f"{count}; close the window, or Ctrl-C, to end")
            process.wait()
        return
    data["seconds"] = perf_counter() - began
    _emit(data, options.as_json, f"{count} in {data['seconds']:.1f} s: {where}")


def _opened(options: ViewOptions) -> Contents:
    """Read the logs of flights, with their violations, or the votes on a recording."""
    from rig.cli.view_votes import are_votes, opened_votes

    if are_votes(options.logs, options.config, options.preset):
        given = {"--requirements": options.requirements, "--map": options.map_tiles}
        for name in (name for name, value in given.items() if value):
            raise BadInput(f"{options.logs[0]}: {name} is for logs of flights, not for votes on a recording")
        return opened_votes(options.logs, options.config, options.preset, options.tab)
    from rig.show.viewer import opened
    from rig.show.viewer.blueprint import require_tab

    require_tab(options.tab)
    flights = opened.read(options.logs, options.tab, options.map_tiles)
    for path, log in zip(options.logs, flights.logs, strict=True):
        _add_violations(path, log, options.requirements or [])
    return flights


def _add_violations(path: Path, log: Log, names: list[str]) -> None:
    """Add an event for each violation of the requirements of ``names`` and of the scenario, if its files exist.

    The viewer flies nothing: ``rig score`` measures requirements on the fault-free baseline.
    """
    from rig.log import scenario_of

    named = scenario_of(log.metadata, path).get("requirements") or []
    if not names and not named:
        return
    from rig.verdict.requirements.along import events
    from rig.verdict.requirements.measure import check_log
    from rig.verdict.requirements.requirement import load_requirements

    required = load_requirements(names)
    with suppress(BadInput):
        required = load_requirements([*names, *named])
    violations = events(check_log(path, [each for each in required if not each.names_baseline]), log.rate_hz)
    log.events[:] = sorted([*log.events, *violations], key=lambda event: event.frame)


def _require_display() -> None:
    from rig.show.viewer import viewer

    try:
        viewer.require_display("rig view")
    except BadInput as error:
        raise BadInput(f"{error}; use --serve, --save or --screenshot") from None


def _serve(shown: Any, data: dict[str, Any], as_json: bool) -> None:
    """Serve until Ctrl-C or a request to end."""
    from rig.core.interrupt import TERMINATIONS
    from rig.show.viewer.opened import serve

    began, over = perf_counter(), threading.Event()
    with suppress(ValueError):  # not the main thread: its caller ends it
        for number in TERMINATIONS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, lambda *_: over.set())
    sink = serve(shown)
    try:
        data |= {"browser": sink.browser, "address": sink.where, "seconds": perf_counter() - began}
        _emit(data, as_json, f"watch at {sink.browser}; Ctrl-C ends it")
        with suppress(KeyboardInterrupt):
            over.wait()
    finally:
        sink.close()


def _emit(data: dict[str, Any], as_json: bool, text: str) -> None:
    emit(as_json, data, lambda: echo(plain(text)))


def watch(
    log: LogFile,
    speed: Annotated[float, opt("X", "Speed, times real time.", min=0.01, max=1000.0)] = 1.0,
    from_s: Annotated[float, opt("S", "Start time in the log, s.", "--from", min=0.0)] = 0.0,
) -> None:
    """Play a log back in the terminal: channels, votes and events. Ctrl-C ends it."""
    from rig.core.console import console
    from rig.log import read_log
    from rig.show.terminal.live import play

    flight = read_log(log)
    if not len(flight.rows):
        raise BadLog(f"{log}: has no frame")
    play(flight, log.stem, console(), speed, from_s)
