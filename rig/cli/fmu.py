"""``rig fmu``: the aircraft for another simulation tool."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from typer import Typer

from rig.cli import complete
from rig.cli.common import GROUP, Json, Sets, arg, emit, opt
from rig.cli.printing import field
from rig.cli.working import working

if TYPE_CHECKING:
    from rig.flight.aircraft_fmu.aircraft_archive import Built

_LABEL: Final = 12  # columns
fmu_app = Typer(**GROUP)


@fmu_app.command()
def build(
    scenario: Annotated[
        str,
        arg(
            "SCENARIO|AIRCRAFT",
            "Scenario file or bundled scenario; or a bundled aircraft or its folder, without faults.",
            autocompletion=complete.scenarios,
        ),
    ],
    out: Annotated[Path, opt("X.fmu", "File of the FMU, which must not exist.", show_default=False)],
    version: Annotated[Literal["2", "3"], opt("VERSION", "2 for FMI 2.0, 3 for FMI 3.0.")] = "2",
    sets: Sets = None,
    seed: Annotated[int | None, opt("N", "Seed of all random draws.", min=0, show_default="as in the scenario")] = None,
    as_json: Json = False,
) -> None:
    """Build an FMU for co-simulation: surfaces and throttle in, four channels of every signal and the truth out.

    The flight computer is outside: your controller reads the channels and commands the surfaces.
    """
    from rig.flight.aircraft_fmu.aircraft_archive import build as make

    with working("building", not as_json):
        built = make(scenario, out, version, sets or (), seed)
    emit(as_json, lambda: _data(built), lambda: _built(built))


def _data(built: Built) -> dict[str, object]:
    return {
        "file": str(built.file),
        "version": built.version,
        "inputs": built.scalars["input"],
        "outputs": built.scalars["output"],
        "parameters": built.parameters,
    }


def _built(built: Built) -> None:
    def number(value: float) -> str:
        return f"{value:g}" if isinstance(value, float) else f"{value}"

    for label, text in (
        ("FMU", f"{built.file}, FMI {built.version}.0, co-simulation"),
        ("inputs", f"{built.scalars['input']}: surfaces and throttle"),
        ("outputs", f"{built.scalars['output']}: channels, validity, monitors, truth and commands"),
        ("parameters", ", ".join(f"{name} = {number(value)}" for name, value in built.parameters.items())),
    ):
        field(label, text, width=_LABEL)
