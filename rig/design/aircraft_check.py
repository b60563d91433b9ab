"""Check an aircraft: the properties of its model, its trims, and the stability margins of its best design by loop."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from rig.computer.control.gains_file import Gains, Margin
from rig.core.errors import BadInput
from rig.core.text import nearest
from rig.design.design_gains import Designed, design_points
from rig.design.loop_requirements import Requirements, short_of, whole
from rig.world.plant.airframe import Airframe, Config, FlightPoint
from rig.world.plant.base_model import SURFACES, read
from rig.world.plant.linearise import Trim, trimmed


@dataclass(frozen=True)
class Property:
    """A property named in aircraft.toml, whether the model reads it, and the nearest name that the model reads."""

    key: str
    name: str
    read: bool
    nearest: list[str]


@dataclass(frozen=True)
class Trimmed:
    """A flight point with its trim, or the reason why there is none."""

    point: FlightPoint
    trim: Trim | None
    error: str


@dataclass(frozen=True)
class LoopMargin:
    """The stability margins of one loop, and the ones that are too small."""

    point: str
    law: str
    actuator: str
    margin: Margin
    missed: list[str]


@dataclass(frozen=True)
class Check:
    """The result of a check; ``gains`` only if every flight point trims and the model reads every property."""

    properties: list[Property]
    reads: list[str]
    trims: list[Trimmed]
    loops: list[LoopMargin]
    gains: Gains | None

    @property
    def below(self) -> list[str]:
        """Return the stability margins that the best design misses, a line for each loop."""
        return [] if self.gains is None else self.gains.below

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain data."""
        return {
            "properties": [asdict(item) for item in self.properties],
            "reads": self.reads,
            "trims": [
                {**item.point.model_dump(), "trim": item.trim and asdict(item.trim), "error": item.error or None}
                for item in self.trims
            ],
            "loops": [{**asdict(item), "margin": item.margin.model_dump()} for item in self.loops],
            "below": self.below,
        }


def check(airframe: Airframe, wanted: Requirements | None = None) -> Check:
    """Check everything that a design of ``airframe`` needs, then design it.  Some seconds a flight point."""
    wanted = wanted or Requirements()
    properties, reads = _properties(airframe)
    if not all(item.read for item in properties):
        return Check(properties, reads, [], [], None)
    trims = [_trim(airframe, point) for point in airframe.flight_points]
    if any(item.error for item in trims):
        return Check(properties, reads, trims, [], None)
    designed = design_points(airframe, wanted)
    below = [f"{item.point.name}: {line}" for item in designed for line in item.below]
    gains = whole(airframe, wanted, [item.point for item in designed], below)
    return Check(properties, reads, trims, [loop for item in designed for loop in _loops(item, wanted)], gains)


def _properties(airframe: Airframe) -> tuple[list[Property], list[str]]:
    """Return the positions named by the surfaces, compared with the model's; none for a linear aircraft."""
    if not isinstance(airframe, Config):
        return [], []
    reads = read(airframe.base_model).reads
    named = [(f"airframe.{name}.position", getattr(airframe, name).position) for name in SURFACES]
    properties = [Property(key, name, name in reads, nearest(name, reads)) for key, name in named]
    return properties, reads


def _trim(airframe: Airframe, point: FlightPoint) -> Trimmed:
    if not isinstance(airframe, Config):
        return Trimmed(point, None, "")
    try:
        return Trimmed(point, trimmed(airframe, point), "")
    except BadInput as error:
        return Trimmed(point, None, str(error))


def _loops(designed: Designed, wanted: Requirements) -> list[LoopMargin]:
    point = designed.point
    return [
        LoopMargin(point.name, law, actuator, margin, short_of(margin, wanted))
        for law, margins in (("stick", point.stick_margins), ("autopilot", point.autopilot_margins))
        for actuator, margin in margins.items()
    ]
