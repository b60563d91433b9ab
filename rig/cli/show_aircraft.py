"""What ``rig aircraft`` prints for people."""

from __future__ import annotations

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

from rig.aircraft import folder, own_tables
from rig.design.new_aircraft import SCENARIO
from rig.errors import BadInput
from rig.plant.airframe import parse
from rig.settings import read_toml
from rig.util.console import console, styled
from rig.util.files import is_file

if TYPE_CHECKING:
    from rig.design.check import Check
    from rig.design.new_aircraft import NewAircraft
    from rig.plant.linearise import Trim

_TRIM_HEADS = ("flight point", "altitude, m", "Mach", "speed, m/s", "alpha, deg", "elevator, rad", "throttle")


def flight_points(name: str) -> list[str]:
    """The names of an aircraft's flight points, the default first; BadInput when its file cannot be used."""
    airframe = parse(own_tables(name).get("airframe", {}), f"aircraft {name}")
    return [point.name for point in airframe.flight_points]


def listed(name: str) -> list[str]:
    """The same of a folder that nobody named: where the file cannot be used, why."""
    try:
        return flight_points(name)
    except BadInput as error:
        return [f"cannot be used: {error}"]


def below(name: str) -> list[str]:
    """What an aircraft's gains keep less than was required, as its file says; nothing before it is designed."""
    path = folder(name) / "gains.toml"
    found = read_toml(path).get("below", []) if is_file(path) else []
    return [str(line) for line in found] if isinstance(found, list) else []


def aircraft(found: dict[str, list[str]], below: dict[str, list[str]]) -> None:
    """Aircraft and flight points, and which fly below the requirement."""
    heads = ("aircraft", "flight points (the first is the default)")
    console().table(heads, ((name, ", ".join(points)) for name, points in found.items()))
    for name, lines in below.items():
        console().print(f"{name}: gains below the requirement, accepted: {'; '.join(lines)}", style="yellow")


def proposed(made: NewAircraft, home: Path) -> None:
    """What was found in the base model, and the flight points."""
    screen, base = console(), made.base
    screen.print(styled((f"{made.name} from JSBSim's {base.name}", "bold"), f"  a {made.kind} aircraft"))
    surfaces = ", ".join(base.positions.values())
    screen.print(f"surfaces {surfaces}")
    screen.print(f"engines  {base.engines} {base.engine}")
    screen.table(
        _TRIM_HEADS, [_row(one.point.name, one.point.altitude_m, one.point.mach, one.trim) for one in made.found]
    )
    screen.print(f"written  {home / 'aircraft.toml'}; figures marked 'assumed' are of no data of this aircraft")


def _row(name: str, altitude_m: float, mach: float, trim: Trim) -> tuple[str, ...]:
    numbers = (f"{trim.airspeed_m_s:.1f}", f"{degrees(trim.alpha_rad):.1f}", f"{trim.elevator_rad:+.3f}")
    return (name, f"{altitude_m:g}", f"{mach:g}", *numbers, f"{trim.throttle:.2f}")


def next_steps(made: NewAircraft, home: Path, *, designed: bool) -> None:
    """The next commands for this aircraft."""
    screen = console()
    if designed:
        fly_it(home)
        others = [one.point.name for one in made.found[1:]]
        screen.print("".join(f"         with --set flight_point={name}\n" for name in others), end="")
    else:
        screen.print(f"next     rig aircraft check {home} --accept", soft_wrap=True)


def fly_it(home: Path) -> None:
    """The command that flies the first scenario of an aircraft, when it has one."""
    if is_file(home / SCENARIO):
        console().print(f"next     rig fly {home / SCENARIO}", soft_wrap=True)


def check(found: Check, name: str) -> None:
    """Properties, trims, margins, and what fails."""
    screen = console()
    for one in found.properties:
        near = "" if one.read else f" is not read by the model; nearest: {', '.join(one.nearest)}"
        screen.print(f"{one.key:27} {one.name}{near}", style="" if one.read else "red")
    if found.reads:
        screen.print(f"the model reads: {', '.join(found.reads)}")
    for one in found.trims:
        if one.error:
            screen.print(one.error, style="red")
    trims = [_row(x.point.name, x.point.altitude_m, x.point.mach, x.trim) for x in found.trims if x.trim is not None]
    if trims:
        screen.table(_TRIM_HEADS, trims)
    heads = ("flight point", "law", "actuator", "gain up, dB", "gain down, dB", "phase, deg", "crossover, rad/s", "")
    rows = []
    for one in found.loops:
        m = one.margin
        numbers = (m.gain_increase_db, m.gain_decrease_db, m.phase_deg)
        said = "; ".join(one.missed) or "kept"
        rows.append(
            (one.point, one.law, one.actuator, *(f"{x:.1f}" for x in numbers), f"{m.crossover_rad_s:.2f}", said)
        )
    if rows:
        screen.table(heads, rows)
    _conclusion(found, name)


def _conclusion(found: Check, name: str) -> None:
    screen = console()
    if found.gains is None:
        screen.print("not designed: a property or a trim is missing", style="red")
    elif found.below:
        screen.print(
            f"below the requirement: {len(found.below)} margins; these are the best gains found", style="yellow"
        )
        screen.print(f"to fly with them nevertheless: rig aircraft check {name} --accept", soft_wrap=True)
    else:
        screen.print("every margin is kept", style="green")


def accepted(home: Path) -> None:
    """Where the gains and references are."""
    console().print(f"written  {home / 'gains.toml'}, {home / 'references.toml'}", soft_wrap=True)
    fly_it(home)
