"""Propose an aircraft from a JSBSim model: its ``[airframe]`` table and flight points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any, Final

from rig.core.errors import BadInput
from rig.core.progress import tell
from rig.core.settings import build
from rig.core.units.atmosphere import density, speed_of_sound
from rig.core.units.constants import GRAVITY
from rig.design.assumed_figures import FIGURES, STOP_RAD, held, limits
from rig.world.plant.airframe import Config, FlightPoint, flight_point_at
from rig.world.plant.base_model import SURFACES, BaseModel, Kind
from rig.world.plant.level import alpha_held
from rig.world.plant.linearise import Trim, trim_of
from rig.world.plant.loading import NoTrim, load, mass_kg, undeclared

ALTITUDES_M: Final[dict[str, tuple[float, ...]]] = {"propeller": (1524.0, 2438.4), "jet": (3048.0, 6096.0, 9144.0)}
LIFT_COEFFICIENTS: Final = (0.2, 0.25, 0.3, 0.35, 0.42, 0.5, 0.6, 0.75)  # slow to fast the other way round
_CRUISE_LIFT: Final = 0.42  # nearest to it is the first flight point
# The most lift coefficient in the pull-up of the healthy flights: of the first flight point, of any other.
_PULL_LIFT, _MOST_PULL_LIFT = 1.0, 1.25
_PULL: Final = 0.3 * 0.7  # its share of the load factor beyond 1 g that counts as lost: of the stick, of the envelope
_SLOWER: Final = 0.72  # dynamic pressure of the second over that of the first
_LEAST_APART: Final = 0.9  # nearer points have no schedule between them
_FASTEST: Final = 0.85  # Mach number tried
_HELD: Final = 0.7  # of the angle of attack from which full elevator no longer pitches down: the limit
_ANY_STEP_S: Final = 0.01  # JSBSim's step; nothing flies
_THROTTLES: Final = (0.1, 0.88)  # between which there is a reserve


@dataclass(frozen=True)
class Found:
    """A point that trims, with a reserve for manoeuvres."""

    point: FlightPoint
    trim: Trim
    alpha_held_rad: float  # up to which full elevator pitches the nose down; inf: to the limit


def found_at(airframe: Config, point: FlightPoint) -> Found:
    """Return a flight point with its trim and the range that its elevator holds.  NoTrim: there is none."""
    fdm = load(airframe, point, _ANY_STEP_S)
    return Found(point, trim_of(fdm, airframe), alpha_held(fdm, airframe))


def limits_at(given: dict[str, Any], found: list[Found]) -> dict[str, Any]:
    """Return limits with an angle of attack from which the elevator still pitches down, at every flight point."""
    held = _HELD * min((each.alpha_held_rad for each in found), default=inf)
    return {**given, "angle_of_attack_max_rad": min(given["angle_of_attack_max_rad"], round(held, 3))}


def airframe_table(base: BaseModel) -> tuple[dict[str, Any], Kind]:
    """Return the ``[airframe]`` table without flight points, and the kind whose values it has."""
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
        unit = STOP_RAD if base.normalised(surface) else 1.0  # rad in one unit of the position
        low, high = base.stops.get(surface, (-STOP_RAD / unit, STOP_RAD / unit))
        table[surface] = {
            "lag_s": figures.lag_s,
            "rate_limit_rad_s": round(figures.rate_limit_rad_s / unit, 3),
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


def flight_points(table: dict[str, Any], base: BaseModel, most: int = 2, without: Collection[str] = ()) -> list[Found]:
    """Return up to ``most`` points that trim, cruise first.  BadInput, with the reasons: none does.

    At each altitude speeds are tried by their lift coefficient.  A point counts if throttle, elevator and angle of
    attack keep a reserve.  The second is the point whose dynamic pressure is nearest to 0.72 of the first's.

    without : names of points that are known to be unsuitable
    """
    airframe = build(Config, {**table, "flight_points": [_ANYWHERE]}, f"base model {base.name}")
    search = _Search(airframe, [each for each in _candidates(airframe, base) if each.point.name not in without])
    chosen: list[Found] = []
    while len(chosen) < most and (found := search.first(chosen)):
        chosen.append(found)
    if not chosen:
        raise BadInput(f"{base.name}: {search.why_none()}")
    return chosen


def _candidates(airframe: Config, base: BaseModel) -> list[_Candidate]:
    """Return the points to try: each altitude at each lift coefficient, Mach to two digits, none too fast."""
    weight = mass_kg(airframe, FlightPoint(**_ANYWHERE)) * GRAVITY
    most_lift = _MOST_PULL_LIFT / _pull_load_factor(airframe)
    made: dict[str, _Candidate] = {}
    for altitude_m in ALTITUDES_M["propeller" if base.propeller else "jet"]:
        for lift in (each for each in LIFT_COEFFICIENTS if each <= most_lift):
            speed = sqrt(2.0 * weight / (base.wing_area_m2 * lift * density(altitude_m)))
            point = flight_point_at(altitude_m, max(round(speed / speed_of_sound(altitude_m), 2), 0.01))
            if point.mach <= _FASTEST:
                made.setdefault(point.name, _Candidate(point, lift))
    return list(made.values())


def _pull_load_factor(airframe: Config) -> float:
    """Return the load factor [g] of the pull-up in which the references are measured."""
    return 1.0 + _PULL * (airframe.limits.load_factor_max - 1.0)


@dataclass(frozen=True)
class _Candidate:
    """A point to try; ``lift`` is the lift coefficient of the attempt."""

    point: FlightPoint
    lift: float

    @property
    def pressure_pa(self) -> float:
        """Return the dynamic pressure at the point."""
        return 0.5 * density(self.point.altitude_m) * (self.point.mach * speed_of_sound(self.point.altitude_m)) ** 2


class _Search:
    """The points to try in order of worth, each once, and the reasons why some are unsuitable."""

    def __init__(self, airframe: Config, candidates: list[_Candidate]) -> None:
        self._airframe, self._candidates = airframe, candidates
        self._cruise_lift = min(_CRUISE_LIFT, _PULL_LIFT / _pull_load_factor(airframe))
        self._found: dict[str, Found | str] = {}

    def first(self, chosen: list[Found]) -> Found | None:
        """Return the best point beside the chosen ones: the first is cruise, others are slower and well apart."""
        apart = [c for c in self._candidates if all(_apart(c.pressure_pa, f.trim.dynamic_pressure_pa) for f in chosen)]
        for candidate in sorted(apart, key=lambda each: self._worth(each, chosen)):
            tell(f"trimming {candidate.point.name}", len(self._found), len(self._candidates))
            found = self._found.setdefault(candidate.point.name, _try(self._airframe, candidate))
            if isinstance(found, Found):
                return found
        return None

    def _worth(self, candidate: _Candidate, chosen: list[Found]) -> tuple[float, float]:
        """Return the priority of a point: cruise lift, high; after the first, another altitude and less pressure."""
        if not chosen:
            return abs(candidate.lift - self._cruise_lift), -candidate.point.altitude_m
        wanted = _SLOWER * chosen[-1].trim.dynamic_pressure_pa
        return candidate.point.altitude_m in {f.point.altitude_m for f in chosen}, abs(candidate.pressure_pa - wanted)

    def why_none(self) -> str:
        """Return the reasons why no point is suitable, the most frequent first, and a remedy, in one line."""
        if not self._candidates:
            return f"flies faster than Mach {_FASTEST:g} at every lift coefficient; give a --point ALTITUDE_M:MACH"
        counted = Counter(str(reason) for reason in self._found.values()).most_common()
        points = [each.point for each in self._candidates]
        machs = [point.mach for point in points]
        reasons = "; ".join(f"{reason} in {count} of {len(points)} points" for reason, count in counted)
        where = f"{min(p.altitude_m for p in points):.0f} to {max(p.altitude_m for p in points):.0f} m"
        tail = f"({where}, Mach {min(machs):g} to {max(machs):g}); try your point with --point ALTITUDE_M:MACH"
        return f"no level trim: {reasons} {tail}"


def _try(airframe: Config, candidate: _Candidate) -> Found | str:
    """Return the trimmed point, or the missing reserve."""
    try:
        found = found_at(airframe, candidate.point)
    except NoTrim as error:
        return error.limit
    return _lacks(airframe, found) or found


def _lacks(airframe: Config, found: Found) -> str:
    """Return the reserve that a trim lacks for manoeuvres; empty: none."""
    limit, surface, trim = airframe.limits, airframe.elevator, found.trim
    spare = min(trim.elevator_rad - surface.min_rad, surface.max_rad - trim.elevator_rad)
    if not _THROTTLES[0] <= trim.throttle <= _THROTTLES[1]:
        return f"throttle beyond {_THROTTLES[0]:g} to {_THROTTLES[1]:g}"
    if not 0.5 * limit.angle_of_attack_min_rad < trim.alpha_rad < 0.5 * limit.angle_of_attack_max_rad:
        return "angle of attack beyond half of its limit"
    if trim.alpha_rad > 0.5 * _HELD * found.alpha_held_rad:
        return "elevator too weak to pitch the nose down from twice the angle of attack"
    if spare <= 0.1 * (surface.max_rad - surface.min_rad):
        return "elevator within a tenth of its stop"
    return ""


def _apart(pressure: float, other: float) -> bool:
    return min(pressure, other) / max(pressure, other) < _LEAST_APART
