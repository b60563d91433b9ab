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

from rig.cli.campaign import app as campaign_app
from rig.cli.common import GROUP, AllowCode, Json, Logs, UnitFile, emit
from rig.cli.faults import faults_app
from rig.cli.reliability import reliability_app
from rig.cli.replay import diff, export, info, replay
from rig.cli.score import score
from rig.cli.studies import study
from rig.cli.thresholds import thresholds
from rig.cli.unit import unit_app
from rig.cli.view import view, watch
from rig.cli.vote import vote
from rig.errors import BadInput, RigError
from rig.interrupt import end_cleanly
from rig.text import plain, shorten

app = typer.Typer(help="Fly redundant flight control against injected faults.", **GROUP)
scenario_app = typer.Typer(help="Look at scenario files.", **GROUP)
aircraft_app = typer.Typer(help="Look at aircraft and design their control laws.", **GROUP)
app.add_typer(scenario_app, name="scenario")
app.add_typer(aircraft_app, name="aircraft")
app.add_typer(campaign_app, name="campaign")
app.add_typer(faults_app, name="faults")
app.add_typer(study, name="study")
app.add_typer(unit_app, name="unit")
app.add_typer(reliability_app, name="reliability")

ScenarioName = Annotated[
    str | None, typer.Argument(help="A scenario file or the name of a bundled one.", show_default=False)
]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Override a key, e.g. redundancy.manager=mean; repeatable."),
]
Seed = Annotated[int | None, typer.Option(help="Seed of all random draws.", min=0, show_default=False)]


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


@app.command()
def fly(
    scenario: ScenarioName = None,
    sets: Sets = None,
    seed: Seed = None,
    out: Logs = Path("logs"),
    rerun: Annotated[str, typer.Option(help="off, save, serve, spawn, or rerun+http://127.0.0.1:PORT/proxy.")] = "off",
    realtime_factor: Annotated[
        float | None,
        typer.Option(help="Pace frames by the wall clock: 1 is real time.", min=0.001, show_default=False),
    ] = None,
    realtime: Annotated[
        bool, typer.Option("--realtime", help="Real time, and ask the system for a scheduling class, memory, a core.")
    ] = False,
    watch: Annotated[bool, typer.Option("--watch", help="Show the redundancy page while it flies.")] = False,
    unit: UnitFile = None,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Fly one scenario, log every frame, print what happened."""
    from rig.cli import show
    from rig.flight import fly as fly_scenario
    from rig.view.watch.keyboard import keyboard
    from rig.view.watch.live import watching

    if watch and as_json:
        raise BadInput("--watch: not with --json, which prints one object and nothing else")
    with watching(watch, realtime_factor) as page, show.progress(enabled=not (as_json or watch)) as progress:
        flight = fly_scenario(
            scenario,
            seed=seed,
            overrides=sets or (),
            out=out,
            rerun=rerun,
            realtime_factor=realtime_factor,
            progress=progress,
            viewer=show.Watching(),
            watch=page,
            allow_code=allow_code,
            unit=unit,
            realtime=realtime,
            live=keyboard(watch and (realtime or realtime_factor is not None)),
        )
    emit(as_json, flight.summary, lambda: show.flight(flight))


@app.command()
def recover(
    log: Annotated[Path, typer.Argument(help="A log that was cut off.")],
    out: Annotated[
        Path | None, typer.Option(help="Where to write the mended log.", show_default="<log>.recovered.mcap")
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


@app.command()
def bench(
    scenario: ScenarioName = None,
    sets: Sets = None,
    repeats: Annotated[int, typer.Option(help="Flights; the medians count.", min=1)] = 7,
    allow_code: AllowCode = False,
    as_json: Json = False,
) -> None:
    """Measure a frame, logging included, as a ratio to bare JSBSim in the same process."""
    from rig.bench import bench as measure
    from rig.cli import show
    from rig.scenario import load

    result = measure(load(scenario, sets or (), allow_code=allow_code), repeats)
    emit(as_json, result.as_dict, lambda: show.bench(result))


@app.command()
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


for command in (vote, thresholds, score, replay, diff, info, export, view, watch):
    app.command()(command)


@scenario_app.command("show")
def scenario_show(scenario: ScenarioName = None, sets: Sets = None, as_json: Json = False) -> None:
    """Print a scenario with every default written out, as TOML that can be flown."""
    from rig.scenario import load

    loaded = load(scenario, sets or ())
    emit(as_json, loaded.resolved, lambda: typer.echo(plain(loaded.to_toml(), keep="\n"), nl=False))


@scenario_app.command("list")
def scenario_list(as_json: Json = False) -> None:
    """List the bundled scenarios and their titles."""
    from rig.cli import show
    from rig.scenario import find, names
    from rig.settings import read_toml

    found = {name: str(read_toml(find(name)).get("title", "")) for name in names()}
    emit(as_json, found, lambda: show.scenarios(found))


@scenario_app.command("check")
def scenario_check(scenario: ScenarioName = None, sets: Sets = None) -> None:
    """Check a scenario without flying it."""
    from rig.scenario import find, load

    loaded = load(scenario, sets or ())
    manager = loaded.redundancy.manager
    code = f"; the class {manager} votes: not imported here, rig fly needs --allow-code" if ":" in manager else ""
    counts = f"{loaded.frames} frames of {loaded.aircraft}, {len(loaded.faults)} faults"
    typer.echo(plain(f"{find(scenario)}: good, {counts}{code}"))


@aircraft_app.command("list")
def aircraft_list(as_json: Json = False) -> None:
    """List the bundled aircraft and their flight points."""
    from rig.aircraft import names
    from rig.cli import show

    found = {name: show.flight_points(name) for name in names()}
    emit(as_json, found, lambda: show.aircraft(found))


@aircraft_app.command("show")
def aircraft_show(name: str, as_json: Json = False) -> None:
    """Print everything that is known of an aircraft."""
    import tomli_w

    from rig.aircraft import tables
    from rig.settings import refuse_what_is_no_setting

    found = tables(name)
    refuse_what_is_no_setting(found, f"aircraft {name}")
    emit(as_json, found, lambda: typer.echo(plain(tomli_w.dumps(found), keep="\n"), nl=False))


@aircraft_app.command("design")
def aircraft_design(
    name: str,
    out: Annotated[
        Path | None, typer.Option(help="Where to write the gains.", show_default="<aircraft>/gains.toml")
    ] = None,
    as_json: Json = False,
) -> None:
    """Design the control law at every flight point, then fly it to measure the references.

    Writes gains.toml with the margins, and beside it references.toml with the measured errors.
    """
    from rig.aircraft import folder
    from rig.cli import show
    from rig.computer.control.gains import write
    from rig.design import references as reference_design
    from rig.design.gains import design
    from rig.plant import airframe

    home = folder(name)
    if out is not None and not out.parent.is_dir():
        raise BadInput(f"--out {out}: no such folder")
    gains = design(airframe.read(home / "aircraft.toml"))
    target = out or home / "gains.toml"
    write(gains, target)
    references, beside = reference_design.design(name, gains), target.with_name("references.toml")
    reference_design.write(references, beside)
    written = {"file": str(target), "references_file": str(beside)}
    summary = {**written, **gains.model_dump(), "references": references.model_dump()}
    emit(as_json, summary, lambda: show.design(references, target, beside))


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
