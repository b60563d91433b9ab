"""The commands, thin: parse, call, print.

Exit code 0 when the work was done (a lost aircraft is a result), 2 for bad input, 1 for a failure of ours.
"""

from __future__ import annotations

import logging
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from rig.cli.aircraft import aircraft_app
from rig.cli.campaign import app as campaign_app
from rig.cli.common import GROUP, AllowCode, Json, Logs, ScenarioName, Sets, UnitFile, emit
from rig.cli.faults import faults_app
from rig.cli.reliability import reliability_app
from rig.cli.replay import diff, export, info, replay
from rig.cli.report import report
from rig.cli.scenario import scenario_app
from rig.cli.score import score
from rig.cli.studies import study
from rig.cli.thresholds import thresholds
from rig.cli.unit import unit_app
from rig.cli.view import view, watch
from rig.cli.vote import vote
from rig.cli.working import working
from rig.errors import BadInput, RigError
from rig.text import plain, shorten
from rig.util.interrupt import end_cleanly
from rig.util.progress import tell

EXAMPLE: Final = "Example: rig fly f16_singular_2_2_level, then: rig score LOG, rig view LOG. Names: rig scenario list."
FLY, LOOK, SCORE, RECORDED, MANY, REFERENCE = "Fly", "Look", "Score", "Recorded data", "Many flights", "Reference"
app = typer.Typer(help="Fly redundant flight control against injected faults.", epilog=EXAMPLE, **GROUP)
app.add_typer(scenario_app, name="scenario", rich_help_panel=FLY)
app.add_typer(aircraft_app, name="aircraft", rich_help_panel=FLY)
app.add_typer(campaign_app, name="campaign", rich_help_panel=MANY)
app.add_typer(faults_app, name="faults", rich_help_panel=REFERENCE)
app.add_typer(study, name="study", rich_help_panel=MANY)
app.add_typer(unit_app, name="unit", rich_help_panel=FLY)
app.add_typer(reliability_app, name="reliability", rich_help_panel=MANY)

Seed = Annotated[int | None, typer.Option(metavar="N", help="Seed of all random draws.", min=0, show_default=False)]

Rerun = Annotated[
    str, typer.Option(metavar="WHERE", help="off, save, serve, spawn, or rerun+http://127.0.0.1:PORT/proxy.")
]
Wait = Annotated[
    bool,
    typer.Option(
        "--wait/--no-wait", help="With serve: begin when a viewer is connected. It serves until Ctrl-C in any case."
    ),
]
Factor = Annotated[
    float | None,
    typer.Option(metavar="X", help="Pace frames by the wall clock: 1 is real time.", min=0.001, show_default=False),
]
Realtime = Annotated[
    bool, typer.Option("--realtime", help="Real time, and ask the system for a scheduling class, memory, a core.")
]
Watch = Annotated[bool, typer.Option("--watch", help="Show the redundancy page while it flies.")]


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"jsbsim-rig {version('jsbsim-rig')}")
        raise typer.Exit


@app.callback()
def _common(
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Show JSBSim's and our log messages.")] = False,
    _: Annotated[
        bool, typer.Option("--version", help="Print the version and end.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    logging.basicConfig(level=logging.DEBUG if verbose else logging.ERROR, format="%(name)s: %(message)s")
    if not verbose:  # what matters in JSBSim's messages becomes our one line
        logging.getLogger("rig.jsbsim").setLevel(logging.CRITICAL + 1)
    for noisy in ("numba", "asyncio", "matplotlib"):
        logging.getLogger(noisy).setLevel(logging.WARNING)


@app.command(rich_help_panel=FLY)
def fly(
    scenario: ScenarioName = None,
    sets: Sets = None,
    seed: Seed = None,
    out: Logs = Path("logs"),
    rerun: Rerun = "off",
    wait: Wait = True,
    realtime_factor: Factor = None,
    realtime: Realtime = False,
    watch: Watch = False,
    unit: UnitFile = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Fly one scenario, log every frame, print what happened."""
    from rig.assess.of_log import FlightConclusion
    from rig.cli import show
    from rig.flight.assembly import fly as fly_scenario
    from rig.view.watch.keyboard import keyboard
    from rig.view.watch.live import watching

    flying = lambda done, total: tell("flying", done, total)  # noqa: E731 # for the progress display
    if watch and as_json:
        raise BadInput("--watch: not with --json, which prints one object and nothing else")
    outcome = FlightConclusion()
    with watching(watch, realtime_factor) as page, working("starting", not (as_json or watch)):
        flight = fly_scenario(
            scenario,
            seed=seed,
            overrides=sets or (),
            out=out,
            rerun=rerun,
            realtime_factor=realtime_factor,
            progress=None if watch else flying,
            viewer=show.Watching(wait),
            watch=page,
            allow_code=allow_code,
            unit=unit,
            realtime=realtime,
            live=keyboard(watch and (realtime or realtime_factor is not None)),
            outcome=outcome,
        )
        said = outcome.sentences(flight.log, flight.frames)
    show.emit_flight(as_json, flight, said)


def recover(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A log that was cut off.", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Where to write the mended log.", show_default="<log>.recovered.mcap"),
    ] = None,
    as_json: Json = False,
) -> None:
    """Mend a log that was cut off: keep every whole chunk, write a new summary."""
    from dataclasses import asdict

    from rig.log import recover as mend

    target = out or log.with_suffix(".recovered.mcap")
    found = mend(log, target)
    holds = f"{found.frames} frames, the last at {found.last_time_s:g} s"
    if found.complete:
        text, kept = f"{log}: whole, nothing to mend: {holds}", log
    else:
        text, kept = f"{target}: {holds}; {found.damage}, {found.lost_bytes} bytes lost", target
    emit(as_json, {"log": str(kept), **asdict(found)}, lambda: typer.echo(plain(text)))


def bench(
    scenario: ScenarioName = None,
    sets: Sets = None,
    repeats: Annotated[int, typer.Option(metavar="N", help="Flights; the medians count.", min=1)] = 7,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Measure a frame, logging included, as a ratio to bare JSBSim in the same process."""
    from rig.cli import show
    from rig.flight.frame_cost import bench as measure
    from rig.scenario import load

    with working("measuring", not as_json):
        result = measure(load(scenario, sets or (), allow_code=allow_code), repeats)
    emit(as_json, result.as_dict, lambda: show.bench(result))


def signals(
    markdown: Annotated[bool, typer.Option("--markdown", help="As the table in docs/signals.md.")] = False,
    as_json: Json = False,
) -> None:
    """List every signal and discrete with symbol, unit, range and redundancy."""
    from dataclasses import asdict

    from rig.cli import show
    from rig.frame import DISCRETES, SIGNALS

    data = {"signals": list(map(asdict, SIGNALS)), "discretes": list(map(asdict, DISCRETES))}
    text = show.signals_markdown if markdown else show.signals
    emit(as_json, data, text)


_PANELS: Final = {
    LOOK: (view, report, watch, info),
    SCORE: (score, replay, diff),
    RECORDED: (vote, thresholds, export, recover),
    REFERENCE: (signals, bench),
}
for panel, commands in _PANELS.items():
    for command in commands:
        app.command(rich_help_panel=panel)(command)


MOST_OF_A_WORD: Final = 400  # characters of a wrong command line that are repeated
_UsageError: Any = typer.BadParameter.__mro__[1]  # click's own; where click is, differs between versions of typer


def main() -> None:
    """The ``rig`` command: errors as one line on stderr and an exit code."""
    end_cleanly()
    try:
        sys.exit(_command())
    except BadInput as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(2)
    except RigError as error:
        typer.echo(f"failed: {error}", err=True)
        sys.exit(1)


def _command() -> int:
    """Run what the command line says; its exit code."""
    try:
        return app(standalone_mode=False) or 0
    except typer.Abort:
        return 1
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # a group without a command: its help
            error.show()
            return error.exit_code
        at = error.ctx.command_path if error.ctx else "rig"
        raise BadInput(f"{shorten(error.format_message(), MOST_OF_A_WORD)}; see: {at} --help") from None


if __name__ == "__main__":
    main()
