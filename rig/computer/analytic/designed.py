"""The designed numbers of one aircraft's references: what design/design_references.py writes to references.toml."""

from __future__ import annotations

from typing import Final, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from rig.computer import gain_schedule
from rig.core.settings import Settings


class Point(Settings):
    """One flight point: how the aircraft answers the air there, and the filters that left the least error.

    The surfaces are eliminated by the moments that they must have made:

        n_w = q_bar lift_slope (alpha - zero_lift_alpha) + V / g (1 - pitch_rate_gain) q - elevator_arm / g q_dot
        n_y = q_bar side_slope beta + (roll_arm p_dot + yaw_arm r_dot) / g

    n_w : load factor across the flight path; both at the centre of gravity
    Filters: on angle of attack, before it becomes a pitch rate; on attitudes, before they become rates; on
    body rates, before they become accelerations; on the inertial unit's rates, for the same purpose.
    """

    name: str
    dynamic_pressure_pa: float = Field(gt=0.0)
    lift_slope_1_pa: float = Field(gt=0.0)  # g per Pa and rad
    zero_lift_alpha_rad: float
    pitch_rate_gain: float = Field(gt=0.0)
    elevator_arm_m: float
    side_slope_1_pa: float = Field(lt=0.0)  # g per Pa and rad
    roll_arm_m: float
    yaw_arm_m: float
    alpha_filter_s: float = Field(gt=0.0)
    attitude_filter_s: float = Field(gt=0.0)
    acceleration_filter_s: float = Field(gt=0.0)
    unit_filter_s: float = Field(default=0.02, gt=0.0)  # files from before it was designed have none


# The order of the coefficient table's columns; references.py numbers them alike.
COLUMNS: Final = tuple(name for name in Point.model_fields if name not in ("name", "dynamic_pressure_pa"))
FILTERS: Final = COLUMNS[-4:]


class Error(Settings):
    """Reference less vote over all measured flights, unit of the signal."""

    rms: float = Field(ge=0.0)
    quantile_999: float = Field(ge=0.0)  # of its size: 99.9 % of frames are within
    worst: float = Field(ge=0.0)
    threshold: float = Field(gt=0.0)
    worst_in: str = ""  # the flight that left the worst: flight point, manoeuvres, turbulence, seed


class Designed(Settings):
    """One aircraft's references: coefficients by dynamic pressure, and the measured error of each source."""

    rate_hz: float = Field(gt=0.0)  # the frame rate of the measurement
    accelerometer_x_m: float  # from the centre of gravity: x forward, y right, z down
    accelerometer_y_m: float
    accelerometer_z_m: float
    points: list[Point] = Field(min_length=1)
    errors: dict[str, dict[str, Error]] = Field(default_factory=dict)  # by signal and source
    # The same as equivalent airspeed [m/s], for sources whose threshold grows with it (reference_monitor.py).
    airspeed_errors: dict[str, dict[str, Error]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _sorted(self) -> Self:
        gain_schedule.check_rising(self.points)
        return self

    def table(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return dynamic pressures (P,) [Pa] and the coefficients there (P, len(COLUMNS))."""
        return gain_schedule.table(self.points, COLUMNS)

    def error(self, signal: str, source: str) -> Error | None:
        """Return the measured error of a reference, None when it was not measured."""
        return self.errors.get(signal, {}).get(source)

    def airspeed_error(self, signal: str, source: str) -> Error | None:
        """Return the same as an equivalent airspeed, None for a source whose threshold is a constant."""
        return self.airspeed_errors.get(signal, {}).get(source)
