"""The designed numbers of one aircraft: gains.toml, which the design writes and the law flies with."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from rig.computer import gain_schedule
from rig.core.errors import RigError
from rig.core.files import write_text
from rig.core.settings import Settings, build, read_toml

# Of each of the back-up law's compensators: feedback of the estimates, then correction of the estimates.
BACKUP: Final = ("feedback_alpha", "feedback_pitch_rate_s", "integral_1_s", "observe_alpha", "observe_pitch_rate")


class Margin(Settings):
    """Stability margins at one actuator's command, all other loops closed.

    Increase and decrease are both positive numbers; a margin that is not found within 40 dB or 120 degrees is that.
    """

    gain_increase_db: float
    gain_decrease_db: float
    phase_deg: float
    crossover_rad_s: float


class Point(Settings):
    """One flight point: its trim, its gains and the margins that they leave.

    Surface commands fall with their errors: elevator = w - elevator_alpha (alpha - trim) - ..., w the
    integrator.  Gains carry the signs of the surfaces.
    """

    name: str
    dynamic_pressure_pa: float = Field(gt=0.0)
    trim_airspeed_m_s: float = Field(gt=0.0)
    trim_alpha_rad: float
    trim_theta_rad: float
    trim_elevator_rad: float
    trim_throttle: float
    elevator_alpha: float
    elevator_pitch_rate_s: float
    elevator_pitch_rate_integral: float
    aileron_roll_rate_s: float
    aileron_roll_rate_integral: float
    rudder_beta: float
    rudder_yaw_rate_s: float
    rudder_beta_integral_1_s: float
    rudder_sideslip_command: float
    throttle_airspeed_s_m: float
    throttle_airspeed_integral_1_m: float
    pitch_angle_1_s: float
    roll_angle_1_s: float
    path_pitch: float
    path_climb_angle: float
    path_altitude_1_s: float
    path_altitude_integral_1_s2: float
    heading_1_s: float
    heading_yaw_1_s: float
    max_roll_rate_rad_s: float = Field(gt=0.0)
    max_sideslip_rad: float = Field(gt=0.0)
    lift_slope_1_rad: float = Field(gt=0.0)  # load factor by angle of attack in a steady pull
    load_by_alpha_1_rad: float  # load factor where it is measured, at once
    load_by_pitch_rate_s: float
    load_by_elevator_1_rad: float
    alpha_rate_by_alpha_1_s: float  # from here on the model of the observers: short period,
    alpha_rate_by_pitch_rate: float
    alpha_rate_by_elevator_1_s: float
    pitch_acceleration_by_alpha_1_s2: float
    pitch_acceleration_by_pitch_rate_1_s: float
    pitch_acceleration_by_elevator_1_s2: float
    roll_acceleration_by_sideslip_1_s2: float  # roll and Dutch roll
    roll_acceleration_by_roll_rate_1_s: float
    roll_acceleration_by_aileron_1_s2: float
    yaw_acceleration_by_sideslip_1_s2: float
    yaw_acceleration_by_yaw_rate_1_s: float
    yaw_acceleration_by_rudder_1_s2: float
    backup_load_feedback_alpha: float  # from the load factor alone
    backup_load_feedback_pitch_rate_s: float
    backup_load_integral_1_s: float
    backup_load_observe_alpha: float  # rad/s per g
    backup_load_observe_pitch_rate: float
    backup_alpha_feedback_alpha: float  # from the angle of attack alone
    backup_alpha_feedback_pitch_rate_s: float
    backup_alpha_integral_1_s: float
    backup_alpha_observe_alpha: float
    backup_alpha_observe_pitch_rate: float
    stick_margins: dict[str, Margin] = Field(default_factory=dict)  # rate loops alone
    autopilot_margins: dict[str, Margin] = Field(default_factory=dict)  # altitude, heading, airspeed held
    lost_margins: dict[str, dict[str, Margin]] = Field(default_factory=dict)  # the same, without some signals


_NOT_FLOWN: Final = ("dynamic_pressure_pa", "trim_airspeed_m_s", "trim_theta_rad", "trim_elevator_rad", "trim_throttle")
# The order of the gain table's columns; laws.py numbers them alike.
COLUMNS: Final = tuple(
    name for name, field in Point.model_fields.items() if field.annotation is float and name not in _NOT_FLOWN
)


class Gains(Settings):
    """One aircraft's control law: points in the order of dynamic pressure, and what the stick may ask."""

    rate_hz: float = Field(gt=0.0)  # the frame rate that the margins hold for
    sensor_lag_s: float = Field(gt=0.0)
    max_load_factor: float = Field(gt=1.0)
    min_load_factor: float = Field(lt=1.0)
    max_alpha_rad: float = Field(gt=0.0)
    elevator_lag_s: float = Field(gt=0.0)
    aileron_lag_s: float = Field(gt=0.0)
    rudder_lag_s: float = Field(gt=0.0)
    below: list[str] = []  # loops that keep less than was required, accepted nevertheless
    points: list[Point] = Field(min_length=1)

    @model_validator(mode="after")
    def _sorted(self) -> Self:
        gain_schedule.check_rising(self.points)
        return self

    def table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return dynamic pressures (P,) [Pa] and the gains there (P, len(COLUMNS))."""
        return gain_schedule.table(self.points, COLUMNS)


def read(path: Path) -> Gains:
    """Read the gains.toml at ``path``; BadInput when it is missing or cannot be used."""
    return build(Gains, read_toml(path), str(path))


def write(gains: Gains, path: Path) -> None:
    """Write gains.toml: every number with the digits that give it back exactly; same design, same bytes."""
    write_text(path, render(gains))


def render(gains: Gains) -> str:
    """Return the text of gains.toml."""
    data = gains.model_dump()
    points, below = data.pop("points"), data.pop("below")
    lines = ["# Written by the design from aircraft.toml; do not edit.", "# Margins: dB, degrees, rad/s.", ""]
    lines += [f"{key} = {_number(value)}" for key, value in data.items()]
    if below:
        lines += ["# Below the requirement, accepted with rig aircraft check --accept:"]
        lines += ["below = [", *(f'    "{text}",' for text in below), "]"]
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
