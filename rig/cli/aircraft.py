"""``rig aircraft``: parse, call, print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rig.cli import complete
from rig.cli.common import GROUP, Json, emit
from rig.cli.working import working
from rig.errors import BadInput
from rig.text import plain

aircraft_app = typer.Typer(help="Look at aircraft and design their control laws.", **GROUP)
AircraftName = Annotated[
    str,
    typer.Argument(
        metavar="NAME|DIR",
        help="A bundled aircraft, or a folder of one.",
        show_default=False,
        autocompletion=complete.aircraft,
    ),
]


@aircraft_app.command("list")
def aircraft_list(as_json: Json = False) -> None:
    """List the bundled aircraft and their flight points."""
    from rig.aircraft import names
    from rig.cli import show

    found = {name: show.flight_points(name) for name in names()}
    emit(as_json, found, lambda: show.aircraft(found))


@aircraft_app.command("show")
def aircraft_show(name: AircraftName, as_json: Json = False) -> None:
    """Print everything that is known of an aircraft."""
    import tomli_w

    from rig.aircraft import tables
    from rig.settings import refuse_what_is_no_setting

    found = tables(name)
    refuse_what_is_no_setting(found, f"aircraft {name}")
    emit(as_json, found, lambda: typer.echo(plain(tomli_w.dumps(found), keep="\n"), nl=False))


@aircraft_app.command("design")
def aircraft_design(
    name: AircraftName,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Where to write the gains.", show_default="<aircraft>/gains.toml"),
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
    target = out or home / "gains.toml"
    beside = target.with_name("references.toml")
    with working("designing the gains", not as_json):
        gains = design(airframe.read(home / "aircraft.toml"))
        write(gains, target)
        references = reference_design.design(name, gains)
    reference_design.write(references, beside)
    written = {"file": str(target), "references_file": str(beside)}
    summary = {**written, **gains.model_dump(), "references": references.model_dump()}
    emit(as_json, summary, lambda: show.design(references, target, beside))
