"""Printing of ``rig aircraft``."""

from __future__ import annotations

from collections.abc import Iterable
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from rig.cli.printing import field, line, table
from rig.core.column import Column, columns
from rig.core.errors import BadInput
from rig.core.files import is_file
from rig.core.settings import read_toml
from rig.design.new_aircraft import scenario_file
from rig.scenario.aircraft import folder, own_tables
from rig.world.plant.airframe import parse
from rig.world.plant.base_model import unit_of

if TYPE_CHECKING:
    from rig.computer.analytic.designed import Designed
    from rig.design.aircraft_check import Check
    from rig.design.new_aircraft import NewAircraft

_SEEN = (
    *(Column("flight point", "point.name"), Column("altitude", "point.altitude_m", "g", "m", worth=5)),
    *(Column("Mach", "point.mach", "g", worth=5), Column("speed", "trim.airspeed_m_s", ".1f", "m/s")),
    Column("alpha", lambda each: degrees(each.trim.alpha_rad), ".1f", "deg"),
)
_MARGINS = (
    *(Column("flight point", "point"), Column("law"), Column("actuator")),
    Column("gain up", "margin.gain_increase_db", ".1f", "dB", worth=7),
    Column("gain down", "margin.gain_decrease_db", ".1f", "dB", worth=7),
    Column("phase", "margin.phase_deg", ".1f", "deg", worth=8),
    Column("crossover", "margin.crossover_rad_s", ".2f", "rad/s", worth=5),
    Column("", lambda loop: "; ".join(loop.missed) or "met"),
)
_REFERENCES = (
    *columns("signal", "reference from"),
    Column("RMS", lambda row: row[2].rms, ".3g", worth=6),
    Column("99.9 %", lambda row: row[2].quantile_999, ".3g", worth=5),
    *(Column("worst", lambda row: row[2].worst, ".3g"), Column("threshold", lambda row: row[2].threshold, ".3g")),
)


def _trims(unit: str) -> tuple[Column, ...]:
    """Return the columns of trims, the elevator's position in rad or norm."""
    return (*_SEEN, Column("elevator", "trim.elevator_rad", "+.3f", unit), Column("throttle", "trim.throttle", ".2f"))


def flight_points(name: str) -> list[str]:
    """Return the names of an aircraft's flight points, the default first; BadInput when its file cannot be used."""
    airframe = parse(own_tables(name).get("airframe", {}), f"aircraft {name}")
    return [point.name for point in airframe.flight_points]


def listed(name: str) -> list[str]:
    """Return the same for a folder that the user did not name; the reason if its file cannot be used."""
    try:
        return flight_points(name)
    except BadInput as error:
        return [f"cannot be used: {error}"]


def below(names: Iterable[str]) -> dict[str, list[str]]:
    """Return which requirements the gains of each aircraft miss, by their files; only of designed aircraft."""
    files = {name: folder(name) / "gains.toml" for name in names}
    lines = {name: read_toml(path).get("below") for name, path in files.items() if is_file(path)}
    return {name: list(map(str, texts)) for name, texts in lines.items() if texts and isinstance(texts, list)}


def aircraft(points: dict[str, list[str]], below: dict[str, list[str]]) -> None:
    """Print aircraft and flight points, and the gains that miss a requirement."""
    names = Column("flight points (the first is the default)", lambda item: ", ".join(item[1]))
    table(points.items(), (Column("aircraft", 0), names))
    for name, texts in below.items():
        line(f"{name}: gains below the requirement, accepted: {'; '.join(texts)}", style="yellow")


def proposed(made: NewAircraft, home: Path) -> None:
    """Print what the base model has, and the flight points."""
    base = made.base
    line((f"{made.name} from JSBSim's {base.name}", "bold"), f"  a {made.kind} aircraft")
    field("surfaces", ", ".join(base.positions.values()))
    field("engines", f"{base.engines} {base.engine}")
    table(made.found, _trims(unit_of(base.positions["elevator"])))
    field("written", f"{home / 'aircraft.toml'}; values marked 'assumed' are defaults, not data of this aircraft")


def changed(made: NewAircraft) -> None:
    """Print the flight points that others replaced."""
    for fault in made.left_out:
        line(f"left out: {fault}", style="yellow")
    table(made.found, _trims(unit_of(made.base.positions["elevator"])))


def next_steps(made: NewAircraft, home: Path, *, designed: bool) -> None:
    """Print the next commands for this aircraft."""
    if not designed:
        field("next", f"rig aircraft check {home} --accept")
        return
    _fly_it(home)
    for point in made.found[1:]:
        field("", f"with --set flight_point={point.point.name}")


def _fly_it(home: Path) -> None:
    """Print the command that flies the first scenario of an aircraft, if it has one."""
    if is_file(scenario_file(home)):
        field("next", f"rig fly {scenario_file(home)}")


def check(checked: Check, name: str) -> None:
    """Print properties, trims, gain and phase margins, and the failures."""
    for item in checked.properties:
        near = "" if item.read else f" is not read by the model; nearest: {', '.join(item.nearest)}"
        field(item.key, f" {item.name}{near}", style="" if item.read else "red", width=27)
    if checked.reads:
        line(f"the model reads: {', '.join(checked.reads)}")
    for point in checked.trims:
        if point.error:
            line(point.error, style="red")
    position = next((item.name for item in checked.properties if "elevator" in item.key), "")
    table([point for point in checked.trims if point.trim is not None], _trims(unit_of(position)))
    table(checked.loops, _MARGINS)
    if checked.gains is None:
        line("not designed: a property or a trim is missing", style="red")
    elif checked.below:
        line(
            f"{len(checked.below)} gain or phase margins below the requirement; these are the best gains found",
            style="yellow",
        )
        line(f"to accept them: rig aircraft check {name} --accept")
    else:
        line("every gain and phase margin meets the requirement", style="green")


def accepted(home: Path) -> None:
    """Print where the gains and references are."""
    field("written", f"{home / 'gains.toml'}, {home / 'references.toml'}")
    _fly_it(home)


def design(references: Designed, target: Path, beside: Path) -> None:
    """Print the measured errors of the references."""
    errors = [(name, source, e) for name, sources in references.errors.items() for source, e in sources.items()]
    table(errors, _REFERENCES)
    line(f"gains with their gain and phase margins written to {target}")
    line(f"references written to {beside}")
