"""Propose an aircraft from a model of JSBSim: its ``[airframe]`` table and flight points that trim."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, Final

from rig.design.assumed import FIGURES, STOP_RAD, held, limits
from rig.errors import BadInput
from rig.plant.airframe import Config, FlightPoint, flight_point_at
from rig.plant.base_model import SURFACES, BaseModel, Kind
from rig.plant.linearise import Trim, trimmed
from rig.plant.loading import mass_kg, undeclared
from rig.settings import build
from rig.units.atmosphere import density, speed_of_sound
from rig.units.constants import GRAVITY

ALTITUDES_M: Final[dict[str, tuple[float, ...]]] = {"propeller": (1524.0, 2438.4), "jet": (3048.0, 6096.0, 9144.0)}
LIFT_COEFFICIENTS: Final = (0.2, 0.25, 0.3, 0.35, 0.42, 0.5, 0.6, 0.75)  # slow to fast the other way round
_CRUISE_LIFT: Final = 0.42  # nearest to it is the first flight point
_SLOWER: Final = 0.72  # dynamic pressure of the second over that of the first
_LEAST_APART: Final = 0.9  # nearer points have no schedule between them
_FASTEST: Final = 0.85  # Mach number tried


@dataclass(frozen=True)
class Found:
    """A flight point that trims, with a reserve to fly on."""

    point: FlightPoint
    trim: Trim
    lift: float  # lift coefficient that it was sought at


def airframe_table(base: BaseModel) -> tuple[dict[str, Any], Kind]:
    """Return the ``[airframe]`` table without flight points, and the kind whose figures it has."""
    table = _table(base, "transport")
    probe = build(Config, {**table, "flight_points": [_ANYWHERE]}, f"base model {base.name}")
    properties = dict.fromkeys(undeclared(probe), 0.0)
    kind = base.kind(mass_kg(probe.model_copy(update={"properties": properties}), FlightPoint(**_ANYWHERE)))
    return {**_table(base, kind), **({"properties": properties} if properties else {})}, kind


_ANYWHERE: Final[dict[str, Any]] = {"name": "any", "altitude_m": 1500.0, "mach": 0.3}


def _table(base: BaseModel, kind: Kind) -> dict[str, Any]:
    figures = FIGURES[kind]
    table: dict[str, Any] = {"base_model": base.name}
    for surface in SURFACES:
        low, high = base.stops.get(surface, (-STOP_RAD, STOP_RAD))
        table[surface] = {
            "lag_s": figures.lag_s,
            "rate_limit_rad_s": figures.rate_limit_rad_s,
            "min_rad": round(low, 4),
            "max_rad": round(high, 4),
            "position": base.positions[surface],
        }
    table["throttle"] = {"lag_s": figures.throttle_lag_s, "rate_limit_1_s": figures.throttle_rate_1_s}
    if base.augmented:
        table["throttle"]["full_position"] = 2.0
    table["accelerometer"] = {"x_m": 0.5, "y_m": 0.0, "z_m": 0.0}
    table["limits"] = limits(kind)
    levers = held(base.engines, base.engine, base.blade_angles_deg)
    return {**table, **({"held": levers} if levers else {})}


def flight_points(table: dict[str, Any], base: BaseModel, most: int = 2) -> list[Found]:
    """Return up to ``most`` flight points that trim, cruise first; BadInput when none does.

    At each altitude speeds are tried by their lift coefficient; a point counts when throttle, elevator and angle of
    attack keep a reserve.  The second is the one whose dynamic pressure is nearest to 0.72 of the first's.
    """
    airframe = build(Config, {**table, "flight_points": [_ANYWHERE]}, f"base model {base.name}")
    weight = mass_kg(airframe, FlightPoint(**_ANYWHERE)) * GRAVITY
    tried: list[FlightPoint] = []
    flyable: list[Found] = []
    for altitude_m in ALTITUDES_M["propeller" if base.propeller else "jet"]:
        for lift in LIFT_COEFFICIENTS:
            point = _point(altitude_m, sqrt(2.0 * weight / (base.wing_area_m2 * lift)))
            if point.mach > _FASTEST or point in tried:
                continue
            tried.append(point)
            flyable += _flyable(airframe, point, lift)
    if not flyable:
        machs = [point.mach for point in tried] or [0.0]
        where = f"{len(tried)} points up to {max(point.altitude_m for point in tried):.0f} m" if tried else "no point"
        tail = f"at Mach {min(machs):g} to {max(machs):g}; try one of your own with --point ALTITUDE_M:MACH"
        raise BadInput(f"{base.name}: no level trim with a reserve of throttle and elevator at {where} {tail}")
    return _spread(flyable, most)


def _point(altitude_m: float, root_speed: float) -> FlightPoint:
    """Return the flight point at which this much sqrt(2 W / (S CL)) is flown, Mach to two digits."""
    mach = round(root_speed / sqrt(density(altitude_m)) / speed_of_sound(altitude_m), 2)
    return flight_point_at(altitude_m, max(mach, 0.01))


def _flyable(airframe: Config, point: FlightPoint, lift: float) -> list[Found]:
    try:
        trim = trimmed(airframe, point)
    except BadInput:
        return []
    limit, surface = airframe.limits, airframe.elevator
    spare = min(trim.elevator_rad - surface.min_rad, surface.max_rad - trim.elevator_rad)
    kept = (
        0.1 <= trim.throttle <= 0.88,
        0.5 * limit.angle_of_attack_min_rad < trim.alpha_rad < 0.5 * limit.angle_of_attack_max_rad,
        spare > 0.1 * (surface.max_rad - surface.min_rad),
    )
    return [Found(point, trim, lift)] if all(kept) else []


def _spread(flyable: list[Found], most: int) -> list[Found]:
    """Return the cruise point and slower ones well apart in dynamic pressure, other altitudes first."""
    chosen = [min(flyable, key=lambda item: (abs(item.lift - _CRUISE_LIFT), -item.point.altitude_m))]
    while len(chosen) < most:
        pressures = [item.trim.dynamic_pressure_pa for item in chosen]
        altitudes = [item.point.altitude_m for item in chosen]
        apart = [item for item in flyable if all(_apart(item.trim.dynamic_pressure_pa, other) for other in pressures)]
        if not apart:
            break
        wanted = _SLOWER * pressures[-1]
        chosen.append(
            min(apart, key=lambda x: (x.point.altitude_m in altitudes, abs(x.trim.dynamic_pressure_pa - wanted)))
        )
    return chosen


def _apart(pressure: float, other: float) -> bool:
    return min(pressure, other) / max(pressure, other) < _LEAST_APART
