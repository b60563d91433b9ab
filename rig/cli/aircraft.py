"""``rig aircraft``: list, show, make, check and design aircraft."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import degrees, radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from typer import Exit, Option, Typer, echo

from rig.cli import complete
from rig.cli.common import GROUP, Json, arg, emit, flag, opt, takes_options
from rig.cli.working import working
from rig.core.errors import BadInput
from rig.core.files import is_folder
from rig.core.outputs import require_apart, require_ending
from rig.core.text import plain, quoted

if TYPE_CHECKING:
    from rig.computer.analytic.designed import Designed
    from rig.computer.control.gains_file import Gains
    from rig.design.new_aircraft import Answers, NewAircraft

GAINS: Final = "gains.toml"
REFERENCES: Final = "references.toml"
aircraft_app = Typer(**GROUP)

Home = Annotated[
    str,
    arg(
        "NAME|DIR",
        "Name of a bundled aircraft, or path of an aircraft's folder.",
        autocompletion=complete.aircraft,
        show_default=True,
    ),
]


@aircraft_app.command("list")
def aircraft_list(
    folders: Annotated[list[Path] | None, arg("DIR...", "Additional aircraft folders to list.")] = None,
    as_json: Json = False,
) -> None:
    """List the bundled aircraft and those in the current folder, with their flight points."""
    from rig.cli import show_aircraft as show
    from rig.scenario.aircraft import names, own_names

    points = {name: show.flight_points(name) for name in (*names(), *map(str, folders or ()))}
    points |= {name: show.listed(name) for name in own_names() if name not in points}
    below = show.below(points)
    emit(as_json, points, lambda: show.aircraft(points, below))


@aircraft_app.command("show")
def aircraft_show(name: Home, as_json: Json = False) -> None:
    """Print all settings of an aircraft, as TOML."""
    import tomli_w

    from rig.core.settings import refuse_what_is_no_setting
    from rig.scenario.aircraft import refuse_bad, tables
    from rig.scenario.scenario import Scenario

    settings = tables(name)
    refuse_what_is_no_setting(settings, f"aircraft {name}")
    refuse_bad(name, Scenario)
    emit(as_json, settings, lambda: echo(plain(tomli_w.dumps(settings), keep="\n"), nl=False))


@dataclass(frozen=True, kw_only=True)
class NewOptions:
    """The options of ``rig aircraft new``."""

    name: Annotated[str, arg("NAME", "Name of the new aircraft and of its folder.", show_default=True)]
    base: Annotated[str, opt("MODEL", "Aircraft model of the installed JSBSim, e.g. c172x.", show_default=False)]
    out: Annotated[Path, opt("DIR", "Folder in which the new folder is made.")] = Path()
    point: Annotated[
        list[str] | None,
        opt("ALTITUDE_M:MACH", "Flight point. Repeatable. If not given, the command finds --points of them."),
    ] = None
    points: Annotated[int, opt("N", "Number of flight points to propose.", min=1, max=3)] = 2
    lag_s: Annotated[float | None, opt("S", "Lag of the actuators, s.", min=0.0001, max=1.0, show_default=False)] = None
    rate_limit_rad_s: Annotated[
        float | None, opt("RAD_S", "Rate limit of the actuators, rad/s.", min=0.01, max=20.0, show_default=False)
    ] = None
    sensor_class: Annotated[
        str | None, opt("CLASS", "Sensor class, e.g. 'tactical-grade MEMS'.", show_default=False)
    ] = None
    channels: Annotated[int, opt("N", "Channels of each signal.", min=2, max=4)] = 4
    design: Annotated[bool, Option(help="Design the control law too, which takes some minutes.")] = True
    as_json: Json = False


@aircraft_app.command("new")
@takes_options
def aircraft_new(options: NewOptions) -> None:
    """Make an aircraft from a JSBSim model: read its surfaces, limits and engines, and propose flight points.

    On a terminal the command asks for the figures that the model lacks (actuators, sensors). In a pipe it assumes them.
    The file marks each assumed figure.
    """
    from rig.cli import show_aircraft as show
    from rig.design.new_aircraft import target, write

    quiet = options.as_json
    folder = target(options.name, options.out)
    made = _proposed(options)
    write(made, folder)
    if not quiet:
        show.proposed(made, folder)
    written: dict[str, object] = {"folder": str(folder), "kind": made.kind}
    if options.design:
        from rig.design.first_design import designed

        with _removed_unless_done(folder):
            with working("gains, gain and phase margins, references", not quiet, steps=True):
                made, gains, measured = designed(made, folder)
            if made.left_out and not quiet:
                show.changed(made)
            written |= _written(gains, measured, folder / GAINS, quiet=quiet)
    written["airframe"] = made.airframe.model_dump(exclude_none=True)
    emit(quiet, written, lambda: show.next_steps(made, folder, designed=options.design))


def _proposed(options: NewOptions) -> NewAircraft:
    """Propose an aircraft; ask for missing figures on a terminal, assume them in a pipe."""
    from rig.design.new_aircraft import Answers, propose

    points = [_point(text) for text in options.point or ()]
    answers = Answers(options.lag_s, options.rate_limit_rad_s, options.sensor_class, options.channels)
    with working("trim", not options.as_json, steps=True):
        made = propose(options.name, options.base, answers, points, options.points)
    if sys.stdin.isatty() and not options.as_json:
        made = propose(options.name, options.base, _ask(answers, made.kind), points, options.points)
    return made


@contextmanager
def _removed_unless_done(folder: Path) -> Iterator[None]:
    """Remove a new folder when the block fails or is interrupted."""
    try:
        yield
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _point(text: str) -> tuple[float, float]:
    """Return altitude [m] and Mach number of ``--point``."""
    altitude, _, mach = text.partition(":")
    try:
        return float(altitude), float(mach)
    except ValueError:
        raise BadInput(f"--point {quoted(text)}: must be ALTITUDE_M:MACH, e.g. 1500:0.16") from None


def _ask(answers: Answers, kind: str) -> Answers:
    """Ask on a terminal for the figures that the model lacks; Enter takes the assumed figure."""
    from dataclasses import replace

    from rig.design.assumed_figures import FIGURES

    figures = FIGURES[kind]  # pyright: ignore[reportArgumentType]  # one of its keys
    echo(f"Enter takes the assumed figure of a {kind} aircraft: {figures.actuator_source}")
    lag_s, rate, sensors = answers.lag_s, answers.rate_limit_rad_s, answers.sensor_class
    if lag_s is None:
        lag_s = _prompt("lag of the actuators, s", figures.lag_s)
    if rate is None:
        rate_deg_s = _prompt("rate limit of the actuators, deg/s", round(degrees(figures.rate_limit_rad_s)))
        rate = None if rate_deg_s is None else radians(rate_deg_s)
    if sensors is None:
        entered = typer.prompt("sensor class, as in a data sheet", default="defaults")
        sensors = None if entered == "defaults" else entered
    return replace(answers, lag_s=lag_s, rate_limit_rad_s=rate, sensor_class=sensors)


def _prompt(text: str, assumed: float) -> float | None:
    """Return the number that a user enters; None for the ``assumed`` one."""
    entered = typer.prompt(text, default=assumed, type=float)
    return None if entered == assumed else entered


@aircraft_app.command("check")
def aircraft_check(
    name: Home,
    accept: Annotated[
        bool, flag("--accept", "Write the best gains found, even if they miss a requirement, and the references.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Check the model's properties, trim, and gain and phase margins at each flight point.

    The command writes nothing without --accept. Exit code 1: a check failed.
    """
    from rig.cli import show_aircraft as show
    from rig.design.aircraft_check import check
    from rig.scenario.aircraft import folder, refuse_bad
    from rig.scenario.scenario import Scenario
    from rig.world.plant import airframe

    home = folder(name)
    if accept:
        _require_apart(name, None)
    frame = airframe.read(home / "aircraft.toml")
    refuse_bad(name, Scenario, designed=False)
    with working("trim", not as_json, steps=True):
        checked = check(frame)
    result = {**checked.as_dict(), "accepted": accept}
    if not as_json:
        show.check(checked, name)
    if checked.gains is None:
        emit(as_json, result, lambda: None)
        raise Exit(1)
    if accept:
        result |= _measured(name, checked.gains, quiet=as_json)
    emit(as_json, result, lambda: show.accepted(home) if accept else None)
    if checked.below and not accept:
        raise Exit(1)


@aircraft_app.command("design")
def aircraft_design(
    name: Home,
    out: Annotated[Path | None, opt("FILE", "File for the gains.", show_default="<aircraft>/gains.toml")] = None,
    as_json: Json = False,
) -> None:
    """Design the control law at each flight point, then measure the errors of the references in flight.

    Writes gains.toml with the gain and phase margins, and beside it references.toml with the measured errors.
    """
    from rig.design.design_gains import design
    from rig.scenario.aircraft import folder
    from rig.world.plant import airframe

    if out is not None and not is_folder(out.parent):
        raise BadInput(f"--out {out}: no such folder")
    _require_apart(name, out)
    with working("gains, gain and phase margins", not as_json, steps=True):
        gains = design(airframe.read(folder(name) / "aircraft.toml"), accept=False)
    emit(as_json, _measured(name, gains, out, quiet=as_json), lambda: None)


def _require_apart(name: str, out: Path | None) -> None:
    """Raise BadInput if gains or references would replace a file of the aircraft, or one another."""
    from rig.scenario.aircraft import folder

    home = folder(name)
    target = out or home / GAINS
    made_from = (path for path in home.rglob("*") if path.name not in (GAINS, REFERENCES))
    require_apart({"--out": target, "the references": target.with_name(REFERENCES)}, made_from)
    require_ending("--out", out, "a file of gains", ".toml")


def _measured(name: str, gains: Gains, out: Path | None = None, *, quiet: bool) -> dict[str, object]:
    """Fly the gains to measure the references, write both; return them as plain data."""
    from rig.design import design_references as references
    from rig.scenario.aircraft import folder

    with working("references, from over 72 healthy flights per flight point", not quiet, steps=True):
        measured = references.design(name, gains)
    return _written(gains, measured, out or folder(name) / GAINS, quiet=quiet)


def _written(gains: Gains, measured: Designed, target: Path, *, quiet: bool) -> dict[str, object]:
    """Write the gains, and beside them the references; return both as plain data."""
    from rig.cli import show_aircraft as show
    from rig.computer.control.gains_file import write
    from rig.design import design_references as references

    write(gains, target)
    beside = target.with_name(REFERENCES)
    references.write(measured, beside)
    if not quiet:
        show.design(measured, target, beside)
    written = {"file": str(target), "references_file": str(beside)}
    return {**written, **gains.model_dump(), "references": measured.model_dump()}
