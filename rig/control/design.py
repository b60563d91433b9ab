"""The design: from an aircraft's linear models to its gains.toml.

Inner loops are linear-quadratic regulators with integral action; one number a plane, the wanted
crossover, sets their weights.  It starts at a share of the actuator's bandwidth; the attitude loop is
put a factor below it, and both come down until every margin holds.  The loops outside these follow by
separation of bandwidth.  What is checked is the whole sampled loop, with the law as it is coded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import Field

from rig.control import loops, reserve
from rig.control.gains import Gains, Margin, Point
from rig.control.loops import ACTUATORS, Law, Plane
from rig.control.margins import Loop, Margins, Matrix, holds, margins
from rig.control.reserve import Bandwidth, Sensor, regulator
from rig.errors import RigError
from rig.plant.airframe import Airframe, FlightPoint
from rig.plant.linear import Linear, linearise
from rig.settings import Settings


class Requirements(Settings):
    """What every loop must keep, and the ratios that the design starts from."""

    rate_hz: float = Field(default=100.0, gt=0.0)
    sensor_lag_s: float = Field(default=0.01, gt=0.0)
    gain_margin_db: float = Field(default=6.5, gt=0.0)  # a reserve of 0.5 dB on 6 dB
    phase_margin_deg: float = Field(default=46.0, gt=0.0)  # a reserve of 1 degree on 45
    actuator_share: float = Field(default=0.25, gt=0.0)  # of its bandwidth, the highest crossover tried
    rudder_share: float = Field(default=0.7, gt=0.0)  # rudder's crossover over the aileron's
    integral_share: float = Field(default=0.2, gt=0.0)  # integral weight over proportional weight and crossover
    sideslip_share: float = Field(default=0.03, ge=0.0)  # weight of the sideslip integral
    heading_share: float = Field(default=0.25, gt=0.0)  # heading over roll attitude
    yaw_share: float = Field(default=2.5, ge=0.0)  # heading hold by rudder over heading hold by bank
    airspeed_crossover_rad_s: float = Field(default=0.15, gt=0.0)
    envelope_share: float = Field(default=0.7, gt=0.0, lt=1.0)  # of the departure limits, what the stick may ask


Design = Gains
_LAWS: Final[tuple[Law, Law]] = ("stick", "autopilot")
_RATE_SHARES: Final = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)  # of the highest crossover
_QUICK: Final = 3  # so many of them count as quick
_ALPHA_SHARES: Final = (1.0, 0.7, 0.4)  # of the regulator's gain on alpha, in the longitudinal plane
_ALTITUDE_SHARES: Final = (0.5, 0.35)  # altitude loop's crossover over the attitude loop's
_ATTITUDE_SHARES: Final = (0.26, 0.22, 0.18, 0.15)  # attitude loop's crossover over the rate loop's

# Losses whose margins are written down: what is lost at once, no reference left.
LOSSES: Final[dict[Plane, tuple[tuple[str, ...], ...]]] = {
    "longitudinal": (
        ("pitch_rate",),
        ("angle_of_attack",),
        ("normal_load_factor",),
        ("angle_of_attack", "normal_load_factor"),
        ("pitch_angle",),
        ("static_pressure",),
        ("dynamic_pressure",),
        *reserve.LOST.values(),
    ),
    "lateral": (("roll_rate",), ("yaw_rate",), ("angle_of_sideslip",), ("roll_angle",), ("heading",)),
}
_LATERAL_GAINS: Final = (
    "aileron_roll_rate_s",
    "aileron_roll_rate_integral",
    "rudder_beta",
    "rudder_yaw_rate_s",
    "rudder_beta_integral_1_s",
    "rudder_sideslip_command",
    "roll_angle_1_s",
    "heading_1_s",
    "heading_yaw_1_s",
)
_NEARNESS: Final = (1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.4, 0.2)


@dataclass(frozen=True)
class _Bandwidth:
    """How fast one plane is to be: shares of the highest crossover, the rate loop's, the alpha gain, the attitude's."""

    rate: float
    attitude: float
    alpha: float
    altitude: float


@dataclass(frozen=True)
class _Case:
    """One flight point under design."""

    airframe: Airframe
    point: FlightPoint
    linear: Linear
    wanted: Requirements


def design(airframe: Airframe, wanted: Requirements | None = None) -> Design:
    """Gains for every flight point of ``airframe``; RigError when the margins cannot be had.

    Pure: the same aircraft and requirements give the same numbers.
    """
    wanted = wanted or Requirements()
    points = [_Case(airframe, point, linearise(airframe, point), wanted) for point in airframe.flight_points]
    points.sort(key=lambda case: case.linear.trim.dynamic_pressure_pa)
    return _gains(airframe, wanted, [_design_point(case) for case in points])


def _gains(airframe: Airframe, wanted: Requirements, points: list[Point]) -> Gains:
    share, limits = wanted.envelope_share, airframe.limits
    return Gains(
        rate_hz=wanted.rate_hz,
        sensor_lag_s=wanted.sensor_lag_s,
        max_load_factor=1.0 + share * (limits.load_factor_max - 1.0),
        min_load_factor=1.0 + share * (limits.load_factor_min - 1.0),
        max_alpha_rad=share * limits.angle_of_attack_max_rad,
        elevator_lag_s=airframe.elevator.lag_s,
        aileron_lag_s=airframe.aileron.lag_s,
        rudder_lag_s=airframe.rudder.lag_s,
        points=points,
    )


def _design_point(case: _Case) -> Point:
    """For each plane the first candidate whose margins hold; the planes do not depend on each other."""
    first = _candidates()[0]
    chosen = dict.fromkeys(ACTUATORS, first)
    for plane in _planes(case):
        for candidate in _candidates():
            chosen[plane] = candidate
            if _holds(case, _point(case, chosen), plane):
                break
        else:
            raise RigError(f"{case.airframe.base_model} {case.point.name}: no {plane} gains keep the margins")
    point = _point(case, chosen)
    for sensor in reserve.SENSORS:
        point = _backed_up(case, point, sensor)
    return _with_lost_margins(case, _with_margins(case, point))


def _backed_up(case: _Case, point: Point, sensor: Sensor) -> Point:
    """``point`` with the first compensator of ``sensor`` that keeps the margins, else the one that comes nearest."""
    best, nearest = 0.0, point
    for candidate in reserve.candidates():
        tried = point.model_copy(update=_compensator(case, sensor, candidate))
        backup = [_loop(case, tried, law, reserve.LOST[sensor]) for law in _LAWS]
        for share in _NEARNESS:
            if share <= best:
                break
            if all(_keeps(case, x, share) for x in backup):
                best, nearest = share, tried
        if best == 1.0:
            break
    return nearest


def _keeps(case: _Case, loop: Loop, share: float) -> bool:
    """Whether the elevator's margins are at least a ``share`` of what is wanted."""
    return holds(loop, 0, share * case.wanted.gain_margin_db, share * case.wanted.phase_margin_deg)


def _loop(case: _Case, point: Point, law: Law, lost: Sequence[str] = (), plane: Plane = "longitudinal") -> Loop:
    gains = _gains(case.airframe, case.wanted, [point])
    return loops.build(case.airframe, case.point, case.linear, gains, law, plane, lost)


def _compensator(case: _Case, sensor: Sensor, chosen: Bandwidth) -> dict[str, float]:
    a, b = case.linear.longitudinal_a[1:3, 1:3], case.linear.longitudinal_b[1:3, 0]
    return reserve.compensator(a, b, _short_period(case), sensor, chosen)


def _short_period(case: _Case) -> dict[str, float]:
    a, b = case.linear.longitudinal_a[1:3, 1:3], case.linear.longitudinal_b[1:3, 0]
    return reserve.short_period(a, b, case.linear.trim.airspeed_m_s, case.airframe.accelerometer.x_m)


def _candidates() -> list[_Bandwidth]:
    """Fast first: the attitude loop gives way before the rate loop loses more than a quarter."""
    quick, slow = _RATE_SHARES[:_QUICK], _RATE_SHARES[_QUICK:]
    tried = [_Bandwidth(*x) for x in product(quick, _ATTITUDE_SHARES, _ALPHA_SHARES, _ALTITUDE_SHARES)]
    tried.sort(key=lambda x: (-x.altitude, -x.attitude, -x.alpha, -x.rate))
    return tried + [_Bandwidth(rate, _ATTITUDE_SHARES[-1], 1.0, _ALTITUDE_SHARES[-1]) for rate in slow]


def _planes(case: _Case) -> list[Plane]:
    """What is designed: an aircraft that only moves up and down has no lateral law."""
    return list(ACTUATORS) if case.linear.rolls else ["longitudinal"]


def _ceiling(case: _Case, plane: Plane) -> float:
    """The highest rate-loop crossover that is tried [rad/s]."""
    lag = getattr(case.airframe, ACTUATORS[plane][0]).lag_s
    return case.wanted.actuator_share / lag


def _holds(case: _Case, point: Point, plane: Plane) -> bool:
    gains = _gains(case.airframe, case.wanted, [point])
    for law in _LAWS:
        loop = loops.build(case.airframe, case.point, case.linear, gains, law, plane)
        for i, actuator in enumerate(ACTUATORS[plane]):
            if law == "stick" and actuator == "throttle":
                continue
            if not holds(loop, i, case.wanted.gain_margin_db, case.wanted.phase_margin_deg):
                return False
    return True


def _with_margins(case: _Case, point: Point) -> Point:
    gains = _gains(case.airframe, case.wanted, [point])
    found: dict[Law, dict[str, Margin]] = {law: {} for law in _LAWS}
    for law in _LAWS:
        for plane in _planes(case):
            loop = loops.build(case.airframe, case.point, case.linear, gains, law, plane)
            for i, actuator in enumerate(ACTUATORS[plane]):
                if law == "stick" and actuator == "throttle":
                    continue
                found[law][actuator] = _margin(margins(loop, i))
    return point.model_copy(update={"stick_margins": found["stick"], "autopilot_margins": found["autopilot"]})


def _with_lost_margins(case: _Case, point: Point) -> Point:
    """The margins of the autopilot at elevator, aileron and rudder while some signals are lost for good."""
    found: dict[str, dict[str, Margin]] = {}
    for plane in _planes(case):
        for lost in LOSSES[plane]:
            loop = _loop(case, point, "autopilot", lost, plane)
            numbers = (0,) if plane == "longitudinal" else (0, 1)
            found["_and_".join(lost)] = {ACTUATORS[plane][i]: _margin(margins(loop, i)) for i in numbers}
    return point.model_copy(update={"lost_margins": found})


def _margin(m: Margins) -> Margin:
    return Margin(
        gain_increase_db=m.gain_increase_db,
        gain_decrease_db=m.gain_decrease_db,
        phase_deg=m.phase_deg,
        crossover_rad_s=m.crossover_rad_s,
    )


def longitudinal_gain(linear: Linear, crossover: float, integral_share: float) -> Matrix:
    """(1, 3) elevator gain on alpha, q and the integral of the q error.

    Weights: q 1, its integral (share * crossover)^2, elevator (M_elevator / crossover)^2; with these
    the ideal loop crosses near ``crossover`` [rad/s].
    """
    a, b = np.zeros((3, 3)), np.zeros((3, 1))
    a[:2, :2] = linear.longitudinal_a[1:3, 1:3]
    a[2, 1] = 1.0
    b[:2, 0] = linear.longitudinal_b[1:3, 0]
    q = np.diag([0.0, 1.0, (integral_share * crossover) ** 2])
    return regulator(a, b, q, np.array([[(b[1, 0] / crossover) ** 2]]))


def path_gain(linear: Linear, pitch: float, crossover: float) -> Matrix:
    """(1, 4) gains of the pitch attitude command on theta, climb angle, altitude / V and its integral.

    The attitude loop counts as a lag of 1 / ``pitch``, the path follows the nose at -Z_alpha.
    Weights: altitude / V 1, its integral (crossover / 8)^2, attitude command 1 / crossover^2.
    """
    follow = -linear.longitudinal_a[1, 1]
    a, b = np.zeros((4, 4)), np.array([[pitch], [0.0], [0.0], [0.0]])
    a[0, 0] = -pitch
    a[1, 0], a[1, 1] = follow, -follow
    a[2, 1] = a[3, 2] = 1.0
    q = np.diag([0.0, 0.0, 1.0, (crossover / 8.0) ** 2])
    return regulator(a, b, q, np.array([[1.0 / crossover**2]]))


def roll_gain(linear: Linear, crossover: float, integral_share: float) -> Matrix:
    """(1, 2) aileron gain on p and the integral of the p error, for the roll mode alone.

    Weights: p 1, its integral (share * crossover)^2, aileron (L_aileron / crossover)^2.
    """
    a = np.array([[linear.lateral_a[1, 1], 0.0], [1.0, 0.0]])
    b = np.array([[linear.lateral_b[1, 0]], [0.0]])
    q = np.diag([1.0, (integral_share * crossover) ** 2])
    return regulator(a, b, q, np.array([[(b[0, 0] / crossover) ** 2]]))


def yaw_gain(linear: Linear, crossover: float, sideslip_share: float) -> Matrix:
    """(1, 3) rudder gain on beta, r and the integral of the beta error, for the Dutch roll alone.

    Weights: r 1, integral of beta (share * crossover^2)^2, rudder (N_rudder / crossover)^2.  One
    regulator for both surfaces would cross-feed roll into the rudder: with the large and changing
    dihedral effect of a fighter that costs the Dutch roll its damping, and turbulence its heading.
    """
    a = np.zeros((3, 3))
    a[:2, :2] = linear.lateral_a[np.ix_((0, 2), (0, 2))]
    a[2, 0] = 1.0
    b = np.array([[linear.lateral_b[0, 1]], [linear.lateral_b[2, 1]], [0.0]])
    q = np.diag([0.0, 1.0, (sideslip_share * crossover**2) ** 2])
    return regulator(a, b, q, np.array([[(b[1, 0] / crossover) ** 2]]))


def _point(case: _Case, chosen: dict[Plane, _Bandwidth]) -> Point:
    """All gains of one flight point."""
    crossover = {plane: chosen[plane].rate * _ceiling(case, plane) for plane in ACTUATORS}
    wanted, linear, trim = case.wanted, case.linear, case.linear.trim
    elevator = longitudinal_gain(linear, crossover["longitudinal"], wanted.integral_share)[0]
    pitch = chosen["longitudinal"].attitude * crossover["longitudinal"]
    path = path_gain(linear, pitch, chosen["longitudinal"].altitude * pitch)[0]
    throttle = wanted.airspeed_crossover_rad_s / linear.longitudinal_b[0, 1]
    return Point(
        name=case.point.name,
        dynamic_pressure_pa=trim.dynamic_pressure_pa,
        trim_airspeed_m_s=trim.airspeed_m_s,
        trim_alpha_rad=trim.alpha_rad,
        trim_theta_rad=trim.theta_rad,
        trim_elevator_rad=trim.elevator_rad,
        trim_throttle=trim.throttle,
        elevator_alpha=chosen["longitudinal"].alpha * elevator[0],
        elevator_pitch_rate_s=elevator[1],
        elevator_pitch_rate_integral=elevator[2],
        throttle_airspeed_s_m=throttle,
        throttle_airspeed_integral_1_m=throttle * wanted.airspeed_crossover_rad_s / 5.0,
        pitch_angle_1_s=pitch,
        path_pitch=path[0],
        path_climb_angle=path[1],
        path_altitude_1_s=path[2],
        path_altitude_integral_1_s2=path[3],
        **_lateral(case, crossover["lateral"], chosen["lateral"].attitude * crossover["lateral"]),
        **_model(case),
    )


def _lateral(case: _Case, crossover: float, roll: float) -> dict[str, float]:
    """The gains on aileron and rudder, zero where these move nothing; ``roll`` the attitude loop's crossover."""
    wanted, linear = case.wanted, case.linear
    limits = {"max_roll_rate_rad_s": _max_roll_rate(case), "max_sideslip_rad": _max_sideslip(case)}
    if not linear.rolls:
        return dict.fromkeys(_LATERAL_GAINS, 0.0) | limits
    aileron = roll_gain(linear, crossover, wanted.integral_share)[0]
    rudder = yaw_gain(linear, wanted.rudder_share * crossover, wanted.sideslip_share)[0]
    command = -linear.lateral_a[2, 0] / linear.lateral_b[2, 1]
    turn = wanted.heading_share * roll
    gains = (*aileron, *rudder, command, roll, turn, wanted.yaw_share * turn)
    return dict(zip(_LATERAL_GAINS, map(float, gains), strict=True)) | limits


def _model(case: _Case) -> dict[str, Any]:
    """What the observers know of the aircraft; the back-up law's compensators are designed when the rest is."""
    return {
        **_short_period(case),
        **reserve.roll_and_yaw(case.linear.lateral_a, case.linear.lateral_b),
        **reserve.NONE,
    }


def _max_roll_rate(case: _Case) -> float:
    """Six tenths of the steady roll rate at full aileron, within the envelope's share."""
    a, b = case.linear.lateral_a, case.linear.lateral_b
    full = min(case.airframe.aileron.max_rad, -case.airframe.aileron.min_rad)
    reach = 0.6 * full * abs(b[1, 0] / a[1, 1]) if case.linear.rolls else math.inf
    return min(reach, case.wanted.envelope_share * case.airframe.limits.body_rate_max_rad_s)


def _max_sideslip(case: _Case) -> float:
    """Three tenths of the steady sideslip at full rudder, within half of the envelope's share."""
    a, b = case.linear.lateral_a, case.linear.lateral_b
    full = min(case.airframe.rudder.max_rad, -case.airframe.rudder.min_rad)
    reach = 0.3 * full * abs(b[2, 1] / a[2, 0]) if case.linear.rolls else math.inf
    return min(reach, 0.5 * case.wanted.envelope_share * case.airframe.limits.sideslip_max_rad)


def write(designed: Design, path: Path) -> None:
    """gains.toml: every number with the digits that give it back exactly; same design, same bytes."""
    path.write_text(render(designed), encoding="utf-8", newline="\n")


def render(designed: Design) -> str:
    """The text of gains.toml."""
    data = designed.model_dump()
    points = data.pop("points")
    lines = ["# Written by the design from aircraft.toml; do not edit.", "# Margins: dB, degrees, rad/s.", ""]
    lines += [f"{key} = {_number(value)}" for key, value in data.items()]
    for point in points:
        lines += ["", "[[points]]"]
        lines += [f"{key} = {_value(value)}" for key, value in point.items()]
    return "\n".join(lines) + "\n"


def _value(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(item)}" for key, item in value.items()) + " }"
    return _number(value)


def _number(value: object) -> str:
    number = float(value)  # pyright: ignore[reportArgumentType]  # the model holds numbers only
    if not math.isfinite(number):
        raise RigError("design: a gain is not finite")
    return repr(number)
