"""``rig unit``: the interface of a unit under test, and the test of a unit against it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Exit, Typer, echo

from rig.cli.catalogue import of_file
from rig.cli.common import GROUP, Json, arg, emit, flag, opt
from rig.cli.printing import line, table
from rig.cli.working import working
from rig.core.column import Column
from rig.core.errors import BadInput

if TYPE_CHECKING:
    from rig.bench.unit_check import Checked

unit_app = Typer(**GROUP)


@unit_app.command()
def header(
    ada: Annotated[bool, flag("--ada", "Print Ada record clauses.")] = False,
    markdown: Annotated[bool, flag("--markdown", "Print tables in Markdown.")] = False,
    fmu: Annotated[
        Literal["2", "3"] | None,
        opt("VERSION", "Print the modelDescription.xml of an FMU: 2 for FMI 2.0, 3 for FMI 3.0."),
    ] = None,
) -> None:
    """Print the interface records (ICD) as a C header, or in another form."""
    from rig.unit import fmu_description, header

    if ada + markdown + (fmu is not None) > 1:
        raise BadInput("--ada, --markdown, --fmu: only one of them at a time")
    if fmu is not None:
        echo(fmu_description.description(fmu), nl=False)
        return
    text = header.ada if ada else header.markdown if markdown else header.header
    echo(text(), nl=False)


@unit_app.command()
def schema() -> None:
    """Print the JSON schema of unit files, for an editor."""
    echo(of_file("unit"))


@unit_app.command()
def check(
    file: Annotated[Path, arg("UNIT", "Unit file.")],
    interface: Annotated[bool, flag("--interface", "Test only the interface, not the voting decisions.")] = False,
    longest: Annotated[bool, flag("--long", "Use long sessions of 70,000 frames instead of 5,000.")] = False,
    as_json: Json = False,
) -> None:
    """Test a unit against the interface and the voting rules, and print a line per requirement.

    Exit code 1: a test failed.
    """
    from rig.bench.unit_check import check as test

    with working("testing the unit", not as_json):
        result = test(file, interface_only=interface, longest=longest)
    emit(as_json, result.as_dict, lambda: _checked(result))
    if not result.passed:
        raise Exit(1)


def _checked(result: Checked) -> None:
    """Print one line per requirement, and the grade."""
    verdict = Column("", lambda requirement: "passed" if requirement.passed else "FAILED")
    table(result.requirements, (Column("part"), verdict, Column("requirement", "name"), Column("", "detail")))
    missed = sum(not requirement.passed for requirement in result.requirements)
    style = "red" if result.grade == "failed" else "green"
    line(f"{result.unit}: ", (result.grade, style), f", {len(result.requirements)} requirements, {missed} not met")
