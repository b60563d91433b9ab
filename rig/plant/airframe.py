"""What an aircraft is: the ``[airframe]`` table of its ``aircraft.toml``.

The base model comes from the installed JSBSim; the table says what we change in it (centre of
gravity, actuators), where it flies, where its accelerometers sit and when it counts as lost.
"""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Self

from pydantic import Field, model_validator

from rig.errors import BadInput
from rig.settings import Settings, build, read_toml


class FlightPoint(Settings):
    """A place to begin: level flight in still air, trimmed, heading north."""

    name: str = Field(min_length=1)
    altitude_m: float = Field(ge=0.0, le=25_000.0)
    mach: float = Field(gt=0.0, le=3.0)


class Surface(Settings):
    """One control surface and its actuator: first-order lag, rate limit, position limits."""

    lag_s: float = Field(gt=0.0)
    rate_limit_rad_s: float = Field(gt=0.0)
    min_rad: float = Field(lt=0.0, ge=-1.0)  # JSBSim's trim searches within -1 to 1
    max_rad: float = Field(gt=0.0, le=1.0)
    position: str = Field(min_length=1)  # the property in which the base model's aerodynamics reads it


class Throttle(Settings):
    """All engines together: command 0 to 1, first-order lag and rate limit before the engine's own."""

    lag_s: float = Field(gt=0.0)
    rate_limit_1_s: float = Field(gt=0.0)
    full_position: float = Field(1.0, gt=0.0)  # 2.0 with afterburner: JSBSim counts it from 1 to 2


class Position(Settings):
    """A point of the aircraft from its centre of gravity: x forward, y right, z down."""

    x_m: float
    y_m: float
    z_m: float


class Limits(Settings):
    """Beyond these the aircraft has departed and the flight ends; load factor as the frame's truth."""

    angle_of_attack_min_rad: float = Field(lt=0.0, ge=-pi)
    angle_of_attack_max_rad: float = Field(gt=0.0, le=pi)
    sideslip_max_rad: float = Field(gt=0.0, le=pi)
    load_factor_min: float = Field(lt=1.0)
    load_factor_max: float = Field(gt=1.0)
    body_rate_max_rad_s: float = Field(gt=0.0)  # of any axis
    pitch_angle_max_rad: float | None = Field(None, gt=0.0, le=pi / 2)  # absent: any attitude will do
    roll_angle_max_rad: float | None = Field(None, gt=0.0, le=pi)


class Config(Settings):
    """The ``[airframe]`` table. Lengths in m, angles in rad, signs as JSBSim's ``fcs/*-pos-rad``."""

    base_model: str = Field(pattern=r"^[A-Za-z0-9_.-]+$")  # an aircraft of the installed JSBSim
    cg_x_shift_m: float = Field(0.0, ge=-2.0, le=2.0)  # aft is positive
    freeze_fuel: bool = True  # mass and centre of gravity stay; False burns and in the end runs dry
    flight_points: list[FlightPoint] = Field(min_length=1)  # the first is the default
    elevator: Surface
    aileron: Surface
    rudder: Surface
    throttle: Throttle
    accelerometer: Position
    limits: Limits
    properties: dict[str, float] = Field(default_factory=dict)  # read by the aerodynamics, held constant

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        names = [point.name for point in self.flight_points]
        if len(set(names)) != len(names):
            raise ValueError("flight points must have different names")
        return self

    @property
    def surface_limits(self) -> list[tuple[float, float]]:
        """Lowest and highest position of every actuator, in the order of frame.SURFACES."""
        surfaces = (self.elevator, self.aileron, self.rudder)
        return [*((surface.min_rad, surface.max_rad) for surface in surfaces), (0.0, 1.0)]

    def point(self, name: str | None = None) -> FlightPoint:
        """The flight point of that name, the first when None; BadInput when there is none."""
        for point in self.flight_points:
            if name is None or point.name == name:
                return point
        known = ", ".join(point.name for point in self.flight_points)
        raise BadInput(f"flight_point: {self.base_model} has no {name!r}; choose from {known}")


def read(path: Path) -> Config:
    """The ``[airframe]`` table of the aircraft.toml at ``path``; BadInput when it cannot be used."""
    data = read_toml(path)
    if "airframe" not in data:
        raise BadInput(f"{path}: airframe: table is missing")
    return build(Config, data["airframe"], f"{path}: airframe")
