"""The airframe of an aircraft: the ``[airframe]`` table of its ``aircraft.toml``.

``plant`` is the model of its motion.  "jsbsim" (the default): the base model comes from the installed JSBSim; the
table has the changes to it (centre of gravity, actuators).  "linear": matrices of its small motions
about level flight.  Both give flight points, places of the accelerometers and limits beyond which it counts as lost.
"""

from __future__ import annotations

import re
from math import pi
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self, get_args

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from rig.core.errors import BadInput
from rig.core.settings import Settings, build, read_toml
from rig.core.text import choices, quoted
from rig.world.plant.imperial import METRES_PER_FOOT

SHORTEST_LAG_S: Final = 1e-4  # of an actuator: well below the shortest step
# The names that JSBSim's property tree takes: parts of letters, digits, _ . - with an index if need be.
_PROPERTY: Final = re.compile(r"[A-Za-z_][\w.-]*(\[\d{1,4}\])?(/[A-Za-z_][\w.-]*(\[\d{1,4}\])?)*", re.ASCII)


class FlightPoint(Settings):
    """A place to begin: level flight in still air, trimmed, heading north."""

    name: str = Field(min_length=1)
    altitude_m: float = Field(ge=0.0, le=25_000.0)
    mach: float = Field(gt=0.0, le=3.0)


def flight_point_at(altitude_m: float, mach: float) -> FlightPoint:
    """Return a flight point named as the bundled ones, by its altitude in feet: 20000ft_m06."""
    name = f"{round(altitude_m / METRES_PER_FOOT)}ft_m{f'{mach:g}'.replace('.', '')}"
    return FlightPoint(name=name, altitude_m=round(altitude_m, 1), mach=mach)


class Actuator(Settings):
    """One control surface's actuator: first-order lag, rate limit, position limits."""

    lag_s: float = Field(ge=SHORTEST_LAG_S, le=1e3)
    rate_limit_rad_s: float = Field(gt=0.0, le=1e6)
    min_rad: float = Field(lt=0.0, ge=-1.0)  # JSBSim's trim searches within -1 to 1
    max_rad: float = Field(gt=0.0, le=1.0)


class Surface(Actuator):
    """One control surface of a JSBSim aircraft."""

    position: str = Field(min_length=1)  # the property in which the base model's aerodynamics reads it


class Throttle(Settings):
    """All engines together: command 0 to 1, first-order lag and rate limit before the engine's own."""

    lag_s: float = Field(ge=SHORTEST_LAG_S, le=1e3)
    rate_limit_1_s: float = Field(gt=0.0, le=1e6)
    full_position: float = Field(1.0, gt=0.0, le=1e3)  # 2.0 with afterburner: JSBSim counts it from 1 to 2


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


class Shared(Settings):
    """Settings of both kinds of aircraft. Lengths in m, angles in rad, signs as JSBSim's ``fcs/*-pos-rad``."""

    base_model: str = Field(pattern=r"^[A-Za-z0-9_.-]+$")  # an aircraft of the installed JSBSim; else any name
    flight_points: list[FlightPoint] = Field(min_length=1)  # the first is the default
    throttle: Throttle
    accelerometer: Position
    limits: Limits

    @model_validator(mode="after")
    def _names_are_unique(self) -> Self:
        names = [point.name for point in self.flight_points]
        if len(set(names)) != len(names):
            raise ValueError("flight points must have different names")
        return self

    def point(self, name: str | None = None) -> FlightPoint:
        """Return the flight point of that name, the first when None; BadInput when there is none."""
        for point in self.flight_points:
            if name is None or point.name == name:
                return point
        allowed = choices(str(name), (point.name for point in self.flight_points), "rig aircraft list")
        page = "docs/how-to/add-an-aircraft.md"
        raise BadInput(f"flight_point: {self.base_model} has no {quoted(name)}; {allowed}; to add one: {page}")

    @property
    def surface_limits(self) -> list[tuple[float, float]]:
        """Lowest and highest position of every actuator, in the order of frame.SURFACES."""
        surfaces: list[Actuator] = [getattr(self, name) for name in ("elevator", "aileron", "rudder")]
        return [*((surface.min_rad, surface.max_rad) for surface in surfaces), (0.0, 1.0)]


class Config(Shared):
    """The ``[airframe]`` table of an aircraft that JSBSim flies."""

    plant: Literal["jsbsim"] = "jsbsim"
    cg_x_shift_m: float = Field(0.0, ge=-2.0, le=2.0)  # aft is positive
    freeze_fuel: bool = True  # mass and centre of gravity stay; False burns and in the end runs dry
    elevator: Surface
    aileron: Surface
    rudder: Surface
    properties: dict[str, float] = Field(default_factory=dict)  # read by the aerodynamics, held constant
    held: dict[str, float] = Field(default_factory=dict)  # JSBSim's own, set before the trim: mixture, propeller, flaps

    @field_validator("properties", "held")
    @classmethod
    def _nameable(cls, properties: dict[str, float]) -> dict[str, float]:
        for name in properties:
            if not _PROPERTY.fullmatch(name):
                raise ValueError(f"{quoted(name)} is not a property's name: parts of letters, digits, _ . - between /")
        return properties


Output = Literal[
    "true_airspeed_m_s",
    "angle_of_attack",
    "pitch_rate",
    "pitch_angle",
    "angle_of_sideslip",
    "roll_rate",
    "yaw_rate",
    "roll_angle",
]
OUTPUTS: Final[tuple[Output, ...]] = get_args(Output)
LONGITUDINAL: Final = OUTPUTS[:4]  # a linear model must have these; others rest at zero
Input = Literal["elevator_rad", "aileron_rad", "rudder_rad", "throttle"]


class Trim(Settings):
    """Level flight, about which a linear model moves; aileron and rudder are at zero."""

    pitch_angle_rad: float = Field(gt=-0.5, lt=0.5)  # and angle of attack
    elevator_rad: float
    throttle: float = Field(ge=0.0, le=1.0)


class Model(Settings):
    """dx/dt = A x + B u, y = C x: deviations from trim, SI units and rad.

    B's inputs are surface positions, signs as in frame.SURFACES; y in the order of ``outputs``.
    """

    A: list[list[float]] = Field(min_length=1)
    B: list[list[float]]
    C: list[list[float]]
    inputs: list[Input] = Field(min_length=1)
    outputs: list[Output]
    initial: list[float]  # x of the first frame
    # What the aircraft's A and B are over those above, which alone the designs know.
    a_factor: float = Field(1.0, gt=0.0)
    b_factor: float = Field(1.0, gt=0.0)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        n, m, p = len(self.A), len(self.inputs), len(self.outputs)
        for name, rows, columns in (("A", n, n), ("B", n, m), ("C", p, n)):
            matrix = getattr(self, name)
            if len(matrix) != rows or any(len(row) != columns for row in matrix):
                raise ValueError(f"matrix {name} must have {rows} rows of {columns} numbers")
        if len(self.initial) != n:
            raise ValueError(f"initial must have {n} numbers, one a state")
        for name, given in (("inputs", self.inputs), ("outputs", self.outputs)):
            if len(set(given)) != len(given):
                raise ValueError(f"{name} must have different names")
        missing = [name for name in LONGITUDINAL if name not in self.outputs]
        if missing:
            raise ValueError(f"outputs must hold {', '.join(LONGITUDINAL)}; missing: {', '.join(missing)}")
        return self


class LinearConfig(Shared):
    """The ``[airframe]`` table of an aircraft that is linear: one model, so one flight point."""

    plant: Literal["linear"]
    flight_points: list[FlightPoint] = Field(min_length=1, max_length=1)
    elevator: Actuator
    aileron: Actuator
    rudder: Actuator
    trim: Trim
    model: Model

    @model_validator(mode="after")
    def _trim_is_within_the_stops(self) -> Self:
        if not self.elevator.min_rad <= self.trim.elevator_rad <= self.elevator.max_rad:
            raise ValueError(f"trim.elevator_rad ({self.trim.elevator_rad:g}) is beyond the elevator's stops")
        return self


def _plant(data: Any) -> str:
    """Return the kind of aircraft that a table, or a model made of one, is."""
    plant = data.get("plant", "jsbsim") if isinstance(data, dict) else getattr(data, "plant", "")
    return plant if isinstance(plant, str) else ""


Airframe = Config | LinearConfig
# The same as a field of another model: the table's ``plant`` chooses.
AirframeField = Annotated[
    Annotated[Config, Tag("jsbsim")] | Annotated[LinearConfig, Tag("linear")],
    Discriminator(_plant, custom_error_type="plant", custom_error_message='plant must be "jsbsim" or "linear"'),
]


def parse(data: dict[str, Any], source: str) -> Airframe:
    """Return an ``[airframe]`` table as an aircraft of its kind; BadInput names ``source`` and the key."""
    return build(_Table, {"airframe": data}, source).airframe


class _Table(Settings):
    airframe: AirframeField


def read(path: Path) -> Airframe:
    """Return the ``[airframe]`` table of the aircraft.toml at ``path``; BadInput when it cannot be used."""
    data = read_toml(path)
    if "airframe" not in data:
        raise BadInput(f"{path}: airframe: table is missing")
    return parse(data["airframe"], str(path))
