"""The requirements on every loop of a design, and the check that it meets them.

The check covers the whole sampled loop, with the control law as coded (loops.py, stability_margins.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from pydantic import Field

from rig.computer.control.gains_file import Gains, Margin, Point
from rig.core.settings import Settings
from rig.design import backup_design as backup
from rig.design import loops
from rig.design.loops import ACTUATORS, Law, Plane
from rig.design.stability_margins import Loop, holds, margins
from rig.world.plant.airframe import Airframe, FlightPoint
from rig.world.plant.linearise import Linear

LAWS: Final[tuple[Law, Law]] = ("stick", "autopilot")
# Losses whose stability margins are written: signals lost together, without a reference.
LOSSES: Final[dict[Plane, tuple[tuple[str, ...], ...]]] = {
    "longitudinal": (
        ("pitch_rate",),
        ("angle_of_attack",),
        ("normal_load_factor",),
        ("angle_of_attack", "normal_load_factor"),
        ("pitch_angle",),
        ("static_pressure",),
        ("dynamic_pressure",),
        *backup.LOST.values(),
    ),
    "lateral": (("roll_rate",), ("yaw_rate",), ("angle_of_sideslip",), ("roll_angle",), ("heading",)),
}


class Requirements(Settings):
    """The stability margins that every loop must keep, and the ratios from which the design starts."""

    rate_hz: float = Field(default=100.0, gt=0.0)
    sensor_lag_s: float = Field(default=0.01, gt=0.0)
    gain_margin_db: float = Field(default=6.5, gt=0.0)  # 0.5 dB more than 6 dB
    phase_margin_deg: float = Field(default=46.0, gt=0.0)  # 1 degree more than 45
    actuator_share: float = Field(default=0.25, gt=0.0)  # of its bandwidth, the highest crossover tried
    rudder_share: float = Field(default=0.7, gt=0.0)  # rudder's crossover over the aileron's
    integral_share: float = Field(default=0.2, gt=0.0)  # integral weight over proportional weight and crossover
    sideslip_share: float = Field(default=0.03, ge=0.0)  # weight of the sideslip integral
    heading_share: float = Field(default=0.25, gt=0.0)  # heading over roll attitude
    yaw_share: float = Field(default=2.5, ge=0.0)  # heading hold by rudder over heading hold by bank
    airspeed_crossover_rad_s: float = Field(default=0.15, gt=0.0)
    envelope_share: float = Field(default=0.7, gt=0.0, lt=1.0)  # of the departure limits, at the stick's stop


@dataclass(frozen=True)
class Case:
    """One flight point under design."""

    airframe: Airframe
    point: FlightPoint
    linear: Linear
    wanted: Requirements

    @property
    def planes(self) -> list[Plane]:
        """Return the planes to design: an aircraft without lateral motion has no lateral law."""
        return list(ACTUATORS) if self.linear.rolls else ["longitudinal"]

    def loop(self, point: Point, law: Law, plane: Plane, lost: Sequence[str] = ()) -> Loop:
        """Return the whole loop of one plane with the gains of ``point``, without the ``lost`` signals."""
        gains = whole(self.airframe, self.wanted, [point])
        return loops.build(self.airframe, self.point, self.linear, gains, law, plane, lost)

    def keeps(self, loop: Loop, actuator: int, share: float = 1.0) -> bool:
        """Return True if the stability margins at one actuator are at least a ``share`` of the required ones."""
        return holds(loop, actuator, share * self.wanted.gain_margin_db, share * self.wanted.phase_margin_deg)


def whole(airframe: Airframe, wanted: Requirements, points: list[Point], below: Sequence[str] = ()) -> Gains:
    """Return the gains of an aircraft from those of its flight points."""
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
        below=list(below),
        points=points,
    )


def met(case: Case, point: Point, plane: Plane) -> bool:
    """Return True if every loop of one plane keeps its stability margins, with stick and with autopilot."""
    for law in LAWS:
        loop = case.loop(point, law, plane)
        if not all(case.keeps(loop, i) for i, _ in _closed(law, plane)):
            return False
    return True


_NEARNESS: Final = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0)


def nearness(case: Case, point: Point, plane: Plane) -> float:
    """Return the share of the required stability margins that every loop of one plane keeps; 0 if one is unstable."""
    closed: list[tuple[Loop, Law]] = [(case.loop(point, law, plane), law) for law in LAWS]
    best = 0.0
    for share in _NEARNESS:
        if not all(case.keeps(loop, i, share) for loop, law in closed for i, _ in _closed(law, plane)):
            break
        best = share
    return best


def missed(case: Case, point: Point) -> list[str]:
    """Return the stability margins that ``point`` misses, as text with numbers; empty if all loops keep theirs."""
    lines = []
    for law, margins_of in (("stick", point.stick_margins), ("autopilot", point.autopilot_margins)):
        for actuator, margin in margins_of.items():
            lines += [f"{law} {actuator} {text}" for text in short_of(margin, case.wanted)]
    return lines


def short_of(margin: Margin, wanted: Requirements) -> list[str]:
    """Return the stability margins of one loop that are less than ``wanted``."""
    if not margin.phase_deg:
        return ["loop unstable"]
    gain, phase = wanted.gain_margin_db, wanted.phase_margin_deg
    checks = (
        ("gain up", margin.gain_increase_db, gain, "dB"),
        ("gain down", margin.gain_decrease_db, gain, "dB"),
        ("phase", margin.phase_deg, phase, "deg"),
    )
    return [f"{name} {value:.1f} of {least:g} {unit}" for name, value, least, unit in checks if value < least - 1e-3]


def with_margins(case: Case, point: Point) -> Point:
    """Return ``point`` with its stability margins, also those of the autopilot with signals lost."""
    by_law: dict[Law, dict[str, Margin]] = {law: {} for law in LAWS}
    lost_margins: dict[str, dict[str, Margin]] = {}
    for plane in case.planes:
        for law in LAWS:
            loop = case.loop(point, law, plane)
            by_law[law] |= {actuator: margins(loop, i) for i, actuator in _closed(law, plane)}
        for lost in LOSSES[plane]:
            loop = case.loop(point, "autopilot", plane, lost)
            numbers = (0,) if plane == "longitudinal" else (0, 1)  # elevator, aileron and rudder
            lost_margins["_and_".join(lost)] = {ACTUATORS[plane][i]: margins(loop, i) for i in numbers}
    kept = {"stick_margins": by_law["stick"], "autopilot_margins": by_law["autopilot"], "lost_margins": lost_margins}
    return point.model_copy(update=kept)


def _closed(law: Law, plane: Plane) -> Iterator[tuple[int, str]]:
    """Yield the actuators that the law moves by feedback: with the stick the pilot moves the throttle."""
    for i, actuator in enumerate(ACTUATORS[plane]):
        if not (law == "stick" and actuator == "throttle"):
            yield i, actuator
