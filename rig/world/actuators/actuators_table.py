"""The ``[actuators]`` table: model of the servos of elevator, aileron and rudder, its tolerances and its monitors.

With ``model = "lag"`` JSBSim's lag and rate limit move a surface and nothing in them can fail.  With "servo" four
coils, one spool, one ram and two hydraulic systems do (servo.py), and computer/servo_monitors.py watches every channel
of them.
Tolerances and thresholds: docs/reference/computers-and-actuators.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Literal

from pydantic import Field, ValidationInfo, field_validator

from rig.core.settings import Settings
from rig.world.plant.airframe import Actuator, Airframe, LinearConfig

LEAST_LAG: Final = 4.0  # times the spool's frequency: below, the loop over spool and ram overshoots


class Limit(Settings):
    """Threshold and persistence of a monitor of one channel."""

    threshold: float = Field(gt=0)
    persistence_s: float = Field(gt=0)  # at least one frame


class Continuity(Settings):
    """The monitor of a coil's wire."""

    persistence_s: float = Field(default=0.02, gt=0)
    coverage: float = Field(default=0.95, ge=0, le=1)  # chance that it sees an open coil, drawn once a fault


class Agreement(Settings):
    """The monitor of a valve's switch."""

    persistence_s: float = Field(default=0.05, gt=0)


class Config(Settings):
    """Settings of the servos of the three surfaces; fractions are of the stroke, from stop to stop."""

    model: Literal["lag", "servo"] = "lag"
    monitors: bool = True  # False: no shut-off valve is opened
    spool_rad_s: float = Field(default=500.0, gt=0, le=5000)  # natural frequency of the spool
    spool_damping: float = Field(default=0.7, gt=0, le=2)
    bypass_s: float = Field(default=0.5, gt=0)  # time constant towards bypass_rad, when no channel holds the ram
    bypass_rad: float = Field(default=0.0, ge=-1, le=1)
    lvdt_bias_tolerance: float = Field(default=0.0025, ge=0)  # of the stroke; drawn once a flight, as all tolerances
    lvdt_scale_tolerance: float = Field(default=0.005, ge=0, lt=1)
    lvdt_noise_std: float = Field(default=0.0005, ge=0)  # of the stroke, a frame
    coil_tolerance: float = Field(default=0.03, ge=0, lt=1)
    rate_tolerance: float = Field(default=0.05, ge=0, lt=1)
    spool_tolerance: float = Field(default=0.10, ge=0, lt=1)  # of frequency and damping
    current: Limit = Limit(threshold=0.25, persistence_s=0.05)  # asked and measured; 1 is the full current
    continuity: Continuity = Continuity()
    spool: Limit = Limit(threshold=0.35, persistence_s=0.1)  # own current through the valve's model, and the spool
    position: Limit = Limit(threshold=0.03, persistence_s=0.05)  # sensors of the ram with each other, of the stroke
    ram: Limit = Limit(threshold=0.08, persistence_s=0.1)  # the ram's model and its sensor, of the stroke
    valve: Agreement = Agreement()  # shut-off valve: commanded and sensed; an event only

    @field_validator("current", "spool", "position", "ram", mode="before")
    @classmethod
    def _over_its_own(cls, given: Any, info: ValidationInfo) -> Any:
        """Lay what is given of a limit over its own defaults: one key of it may stand alone."""
        own: Limit = cls.model_fields[info.field_name or ""].default
        return {**own.model_dump(), **given} if isinstance(given, Mapping) else given


def refuse_unfit(config: Config, airframe: Airframe) -> None:
    """Raise ValueError if the airframe cannot have the servos of ``config``."""
    if config.model == "lag":
        return
    if isinstance(airframe, LinearConfig):
        raise ValueError('actuators.model: a linear aircraft has no servos; allowed: "lag"')  # noqa: TRY004
    for name in ("elevator", "aileron", "rudder"):
        surface: Actuator = getattr(airframe, name)
        product = surface.lag_s * config.spool_rad_s
        if product < LEAST_LAG:
            raise ValueError(
                f"actuators.spool_rad_s: {config.spool_rad_s:g} rad/s times the {name}'s lag of {surface.lag_s:g} s is "
                f"{product:.3g}, allowed: at least {LEAST_LAG:g}, which is {LEAST_LAG / surface.lag_s:.3g} rad/s"
            )
