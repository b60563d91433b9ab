"""Write the folder of a new aircraft for ``rig aircraft new``: aircraft.toml with the source of every value."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import degrees
from pathlib import Path
from typing import Any, Final

import tomli_w

from rig.core.errors import BadInput, PointFault
from rig.core.files import is_folder, reported, write_text
from rig.core.frame import CHANNELS, SIGNALS
from rig.core.settings import build
from rig.core.text import choices, quoted
from rig.design.assumed_figures import FIGURES, REVOLUTIONS, STOP_RAD, limits
from rig.design.propose import Found, airframe_table, flight_points, found_at, limits_at
from rig.scenario.aircraft import names, sensor_classes
from rig.world.plant.airframe import Config, FlightPoint, flight_point_at
from rig.world.plant.base_model import SURFACES, BaseModel, Kind, read, unit_of
from rig.world.sensors.classes import kind as kind_of_signal

_NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,60}")
_NORMALISED: Final = (
    "The equations read this position as a share of full deflection (norm), not in rad: min_rad, max_rad and "
    f"rate_limit_rad_s are norm and norm/s here, the assumed rate of a full deflection of {STOP_RAD:g} rad."
)
WIDTH: Final = 118  # of a comment line
ASSUMED: Final = "assumed"
_SCENARIO: Final = """\
title = "{name} pitch-rate hardover"
aircraft = "../{name}"  # from this file's folder
flight_point = "{first}"  # of {points}
duration_s = 60.0
seed = 1

# The autopilot holds altitude, heading and airspeed; one gyro runs to its stop.
[[faults]]
kind = "hardover"
signal = "pitch_rate"
channels = [3]
start_s = 20.0
"""


@dataclass(frozen=True)
class Answers:
    """Values that no JSBSim model gives; None: the assumed value of the aircraft's kind."""

    lag_s: float | None = None  # of every surface's actuator
    rate_limit_rad_s: float | None = None
    sensor_class: str | None = None  # for the signals that it measures
    channels: int = CHANNELS  # of every signal


@dataclass(frozen=True)
class NewAircraft:
    """A proposed aircraft, not yet written."""

    name: str
    base: BaseModel
    kind: Kind
    table: dict[str, Any]  # [airframe], flight points included
    found: list[Found]
    answers: Answers
    most: int  # number of flight points asked for
    given: bool = False  # whether the user gave them
    left_out: tuple[PointFault, ...] = ()  # of points that were proposed and are unsuitable

    @property
    def airframe(self) -> Config:
        """Return the checked ``[airframe]`` table."""
        return build(Config, self.table, f"aircraft {self.name}")


def target(name: str, out: Path) -> Path:
    """Return the folder to make.  BadInput: not a name, the name of a bundled aircraft, or an existing folder."""
    if not _NAME.fullmatch(name):
        raise BadInput(f"aircraft new {quoted(name)}: allowed: letters, digits, _ . - (not . or - at the start)")
    if name in names():
        raise BadInput(f"aircraft new {name}: a bundled aircraft has this name; choose another")
    if not is_folder(out):
        raise BadInput(f"--out {out}: no such folder")
    folder = out / name
    if os.path.lexists(folder):
        raise BadInput(f"{folder}: exists already; choose another name, or another folder with --out")
    return folder


def propose(name: str, base_model: str, answers: Answers, points: list[tuple[float, float]], most: int) -> NewAircraft:
    """Propose a whole new aircraft.  BadInput: the model cannot be flown, or does not trim.

    points : altitude [m] and Mach number of the user's flight points; empty: ``most`` are proposed
    """
    chosen, classes = answers.sensor_class, sensor_classes()
    if chosen is not None and chosen not in classes:
        known = choices(chosen, classes, "docs/reference/sensors-and-redundancy.md")
        raise BadInput(f"--sensor-class: unknown class {quoted(chosen)}, {known}")
    base = read(base_model)
    table, kind = airframe_table(base)
    for surface in SURFACES:
        own = {"lag_s": answers.lag_s, "rate_limit_rad_s": answers.rate_limit_rad_s}
        table[surface] |= {key: value for key, value in own.items() if value is not None}
    found = _own_points(table, base, points) if points else flight_points(table, base, most)
    made = at_points(NewAircraft(name, base, kind, table, [], answers, most, bool(points)), found)
    _ = made.airframe
    return made


def at_points(new: NewAircraft, found: list[Found], left_out: tuple[PointFault, ...] = ()) -> NewAircraft:
    """Return a proposal with these flight points."""
    points = [item.point.model_dump() for item in found]
    table = {**new.table, "flight_points": points, "limits": limits_at(limits(new.kind), found)}
    return replace(new, table=table, found=found, left_out=left_out)


def _own_points(table: dict[str, Any], base: BaseModel, points: list[tuple[float, float]]) -> list[Found]:
    made = []
    for altitude_m, mach in points:
        data = {"name": "any", "altitude_m": altitude_m, "mach": mach}
        build(FlightPoint, data, f"--point {altitude_m:g}:{mach:g}")
        made.append(flight_point_at(altitude_m, mach))
    dumped = [point.model_dump() for point in made]
    airframe = build(Config, {**table, "flight_points": dumped}, f"base model {base.name}")
    return [found_at(airframe, point) for point in made]


def write(new: NewAircraft, folder: Path) -> None:
    """Make the folder with aircraft.toml and a first scenario.  BadInput or RigError: it cannot be written."""
    with reported(folder, BadInput):
        folder.mkdir()
    rewrite(new, folder)


def rewrite(new: NewAircraft, folder: Path) -> None:
    """Write the files of a proposal into an existing folder."""
    write_text(folder / "aircraft.toml", render(new))
    write_text(scenario_file(folder), scenario(new))


def scenario_file(folder: Path) -> Path:
    """Return the file of an aircraft's first scenario; the log takes its name, so it contains the aircraft's."""
    return folder / f"{folder.resolve().name}_hardover.toml"


def scenario(new: NewAircraft) -> str:
    """Return the text of a first scenario: the gyro fault of the default scenario, on this aircraft."""
    points = ", ".join(found.point.name for found in new.found)
    return _SCENARIO.format(name=new.name, first=new.found[0].point.name, points=points)


def render(new: NewAircraft) -> str:
    """Return the text of aircraft.toml: every assumed value is marked, with its source."""
    blocks = [_head(new), *(_surface(new, surface) for surface in SURFACES), *_rest(new), *_sensors(new)]
    return "\n".join(blocks)


def _head(new: NewAircraft) -> str:
    points, unit = [], unit_of(new.base.positions["elevator"])
    for found in new.found:
        trim, point = found.trim, found.point
        surfaces = f"elevator {trim.elevator_rad:+.3f} {unit}, throttle {trim.throttle:.2f}"
        points.append(
            f"    # trim: {trim.airspeed_m_s:.0f} m/s, {trim.dynamic_pressure_pa / 1e3:.1f} kPa, angle of attack "
            f"{degrees(trim.alpha_rad):.1f} deg, {surfaces}\n"
            f'    {{ name = "{point.name}", altitude_m = {point.altitude_m!r}, mach = {point.mach!r} }},'
        )
    intro = (
        f"{new.name}: made by rig aircraft new from JSBSim's {new.base.name}, which is read from the installed "
        f"package at run time; {new.base.engines} {new.base.engine} engine{'s' if new.base.engines > 1 else ''}. "
        f"Values marked '{ASSUMED}' are defaults, not data of this aircraft; replace them by known values."
    )
    list_text = "\n".join(points)
    return (
        f"{_comment(intro)}\n[airframe]\n"
        f'base_model = "{new.base.name}"\n\n# The aircraft trims here with a reserve of throttle and elevator.\n'
        f"flight_points = [\n{list_text}\n]\n"
    )


def _surface(new: NewAircraft, surface: str) -> str:
    figures, own, base = FIGURES[new.kind], new.answers, new.base
    given = own.lag_s is not None and own.rate_limit_rad_s is not None
    source = "Lag and rate limit as given." if given else f"Lag and rate limit {ASSUMED}: {figures.actuator_source}."
    stops = "Stops: of the base model." if surface in base.stops else f"Stops {ASSUMED}: the model gives none."
    unit = f" {_NORMALISED}" if base.normalised(surface) else ""
    return f"{_comment(f'{source} {stops}{unit}')}\n{_table(f'airframe.{surface}', new.table[surface])}"


def _rest(new: NewAircraft) -> Iterator[str]:
    figures = FIGURES[new.kind]
    source = f"{ASSUMED}. The lag is that of the servo alone; the engine adds its own."
    yield f"{_comment(source)}\n{_table('airframe.throttle', new.table['throttle'])}"
    source = f"{ASSUMED}: close to the centre of gravity."
    yield f"{_comment(source)}\n{_table('airframe.accelerometer', new.table['accelerometer'])}"
    source = f"{ASSUMED}; beyond them the aircraft counts as lost. Loads: {figures.limits_source}; angles beyond stall."
    if new.table["limits"] != limits(new.kind):
        source += " Angle of attack: 0.7 of the value from which full elevator no longer pitches the nose down."
    yield f"{_comment(source)}\n{_table('airframe.limits', new.table['limits'])}"
    if "held" in new.table:
        source = (
            f"{ASSUMED}: mixture for best power near 1500 m; the governor of a constant-speed propeller at "
            f"{REVOLUTIONS:g} of the range from its lowest to its highest revolutions."
        )
        yield f"{_comment(source)}\n{_table('airframe.held', new.table['held'])}"
    if "properties" in new.table:
        source = "The equations read these properties. The replaced flight control moved them; now they stay fixed."
        yield f"{_comment(source)}\n{_table('airframe.properties', new.table['properties'])}"


def _sensors(new: NewAircraft) -> Iterator[str]:
    """Return the sensors that differ from aircraft/defaults.toml."""
    tables: dict[str, dict[str, Any]] = {}
    chosen = new.answers.sensor_class
    kinds = sensor_classes()[chosen].kinds if chosen else []
    for signal in SIGNALS:
        table: dict[str, Any] = {}
        if kind_of_signal(signal.name) in kinds:
            table["class"] = chosen
        if new.answers.channels != CHANNELS:
            table["channels"] = new.answers.channels
        if table:
            tables[signal.name] = table
    if not tables:
        yield _comment(f"Sensors {ASSUMED}: the quadruplex set of aircraft/defaults.toml, which cites its sources.")
    else:
        yield _comment("Sensors as given; all other values from aircraft/defaults.toml, which cites their sources.")
        yield tomli_w.dumps({"sensors": tables})


def _table(name: str, data: dict[str, Any]) -> str:
    return f"[{name}]\n{tomli_w.dumps(data)}"


def _comment(text: str) -> str:
    """Return ``text`` as comment lines."""
    return textwrap.fill(text, WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)
