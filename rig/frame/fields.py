"""How log and viewer name what is in the frame: which message holds a field of FRAME, under which name.

Each field has one place; one that is not named here belongs to every signal and keeps its name.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Final

from rig.frame import (
    COMMANDS,
    DEMANDS,
    ESTIMATES,
    FLIGHT,
    FRAME,
    INERTIAL,
    SURFACES,
    End,
    Ilm,
    Law,
    Lie,
    Pattern,
    Resolver,
    Source,
    State,
    Trust,
)

# What the values of a u1 field mean.
ENUMS: Final[dict[str, type[IntEnum]]] = {
    "state": State,
    "discrete_state": State,
    "ilm": Ilm,
    "discrete_ilm": Ilm,
    "pattern": Pattern,
    "resolver": Resolver,
    "source": Source,
    "law": Law,
    "trust": Trust,
    "lie": Lie,
    "end": End,
}
FLAGS: Final = ("valid", "discrete_valid", "reference_usable", "common_mode")  # u1 fields that are 0 or 1
# Fields that were added to a message of earlier logs: they come last in it, so that the others keep their numbers.
LATER: Final = ("discrete_valid", "discrete_ilm", "second_reference", "common_mode")
# Fields with one named element each; the elements of others are numbered from 1.
ELEMENTS: Final = {
    "flight": FLIGHT,
    "demand": DEMANDS,
    "inertial": INERTIAL,
    "command": tuple(f"command_{name}" for name in COMMANDS),
    "estimate": tuple(f"estimate_{name}" for name in ESTIMATES),
    "surface": tuple(f"surface_{name}" for name in SURFACES),
    "actuator": tuple(f"actuator_{name}" for name in SURFACES),
}
_SHORT: Final = {"channels": "ch", "state": "st"}
_HOME: Final = {
    "flight": "rig.Flight",
    "end": "rig.Flight",
    "acting": "rig.Flight",
    "demand": "rig.Demand",
    "inertial": "rig.Inertial",
    "command": "rig.Control",
    "surface": "rig.Control",
    "actuator": "rig.Control",
    "estimate": "rig.Control",
    "law": "rig.Control",
    "trust": "rig.Control",
    "lie": "rig.Control",
}


def home(field: str) -> str:
    """The message that holds a field of FRAME."""
    if field.startswith("discrete_"):
        return "rig.Discrete"
    return _HOME.get(field, "rig.Signal")


@dataclass(frozen=True, slots=True)
class Place:
    """One number of a message: its name there, its field of FRAME, its index within the message's row of it."""

    name: str
    field: str
    index: tuple[int, ...]


@cache
def places(message: str) -> tuple[Place, ...]:
    """All that a message holds, in the order of FRAME, LATER last; the frame's number is not part of any."""
    fields = [field for field in FRAME.names or () if field != "frame" and home(field) == message]
    return tuple(place for field in sorted(fields, key=LATER.__contains__) for place in _places(field))


def _places(field: str) -> list[Place]:
    if field in ELEMENTS:
        return [Place(name, field, (i,)) for i, name in enumerate(ELEMENTS[field])]
    plain = field.removeprefix("discrete_")
    stem = _SHORT.get(plain, plain)
    rows = home(field) in ("rig.Signal", "rig.Discrete")
    shape = FRAME[field].shape[1:] if rows else FRAME[field].shape  # within the row of the signal
    if not shape:
        return [Place(stem, field, ())]
    return [Place(f"{stem}_{i + 1}", field, (i,)) for i in range(shape[0])]
