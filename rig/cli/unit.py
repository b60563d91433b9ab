"""``rig unit``: what goes between the rig and a unit under test, and whether a unit keeps to it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from rig.cli.common import GROUP, Json, emit
from rig.cli.working import working
from rig.errors import BadInput

unit_app = typer.Typer(help="Flight software under test: its records, its conformance.", **GROUP)


@unit_app.command()
def header(
    ada: Annotated[bool, typer.Option("--ada", help="Ada record clauses.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="The tables of docs/unit-records.md.")] = False,
    fmu: Annotated[
        Literal["2", "3"] | None, typer.Option(help="modelDescription.xml of an FMU by FMI 2.0 or 3.0.")
    ] = None,
) -> None:
    """Print the records as a C header, or in another form."""
    from rig.unit import ada as in_ada
    from rig.unit import description, fmu_description, header

    if ada + markdown + (fmu is not None) > 1:
        raise BadInput("--ada, --markdown, --fmu: one of them")
    if fmu is not None:
        typer.echo(fmu_description.description(fmu), nl=False)
        return
    text = in_ada.specification if ada else description.markdown if markdown else header.header
    typer.echo(text(), nl=False)


@unit_app.command()
def schema() -> None:
    """Print the JSON schema of unit files, for editors."""
    from rig.cli.schema import of_file

    typer.echo(of_file("unit"))


@unit_app.command()
def check(
    file: Annotated[Path, typer.Argument(metavar="UNIT", help="A unit file.", show_default=False)],
    seam: Annotated[bool, typer.Option("--seam", help="How it answers, not what it decides.")] = False,
    as_json: Json = False,
) -> None:
    """Test whether a unit keeps to the records and the requirement; exit code 1 when it fails one of them."""
    from rig.bench.unit_check import check as test
    from rig.cli import show_unit as show

    with working("testing the unit", not as_json):
        found = test(file, seam_only=seam)
    emit(as_json, found.as_dict, lambda: show.checked(found))
    if not found.passed:
        raise typer.Exit(1)
