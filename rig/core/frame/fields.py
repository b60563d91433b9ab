"""The one table of the frame's fields: writer, shape, meaning, and place in the log.

FRAME (row.py), the log's messages (rig/log/schema.py), its column names and the contents of the viewer follow from it.

Parts, by the writer of a field and its readers:

    truth      true values of plant and pilot; the computer never reads them
    bus        input of the computer: sensors, inertial unit, their faults, the pilot's commands
    fcc        output of the computer
    actuation  commands at the surfaces, and active faults
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Final, Literal

import numpy as np

from rig.core.frame.enums import DecidedBy, End, Ilm, Law, Pattern, SensorFault, Source, State, Trust, UnitStatus
from rig.core.frame.signals import AUTOPILOT_COMMANDS, CHANNELS, COMMANDS, ESTIMATES, FLIGHT, INERTIAL, SURFACES, D, S

MOST_FAULTS: Final = 64  # of one scenario
Part = Literal["truth", "bus", "fcc", "actuation"]
PARTS: Final[tuple[Part, ...]] = ("truth", "bus", "fcc", "actuation")
Kind = Literal["number", "single", "enum", "flag", "small", "byte", "count"]
BASES: Final[dict[Kind, str]] = {
    "number": "f8",
    "single": "f4",
    "enum": "u1",
    "flag": "u1",  # 0 or 1
    "small": "u1",  # below 128
    "byte": "u1",
    "count": "u4",
}
SIGNAL, DISCRETE, CONTROL, FLOWN = "rig.Signal", "rig.Discrete", "rig.Control", "rig.Flight"
_EACH, _SIGNALS, _DISCRETES = (S, CHANNELS), (S,), (D,)
_FORCES: Final = 3  # the last of INERTIAL and of FLIGHT, which came later


@dataclass(frozen=True, slots=True)
class Field:
    """One field of the frame; ``message`` and ``stem`` are its place in the log."""

    name: str
    part: Part
    shape: tuple[int, ...]
    kind: Kind = "number"
    enum: type[IntEnum] | None = None
    unit: str = ""  # "signal": that of the signal; elements have theirs in their names
    message: str = SIGNAL
    stem: str = ""  # name within the message where it is another one
    elements: tuple[str, ...] = ()  # names of its elements; others are numbered from 1
    since: int = 2  # version of the log's schema that brought it,
    newer: int = 0  # and how many of its last elements came with version 3


def _elements(prefix: str, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(prefix + name for name in names)


# In the order in which the first messages had them; memory has the widest of each part first (row.py).
FIELDS: Final = (
    Field("truth", "truth", _SIGNALS, unit="signal"),  # the sticks by the pilot
    Field("flight", "truth", (len(FLIGHT),), message=FLOWN, elements=FLIGHT, newer=_FORCES),
    Field(
        "autopilot_command",
        "bus",
        (len(AUTOPILOT_COMMANDS),),
        message="rig.AutopilotCommand",
        elements=AUTOPILOT_COMMANDS,
    ),
    Field("channels", "bus", _EACH, unit="signal", stem="ch"),
    Field("inertial", "bus", (len(INERTIAL),), message="rig.Inertial", elements=INERTIAL, newer=_FORCES),
    Field("voted", "fcc", _SIGNALS, unit="signal"),
    Field("reference", "fcc", _SIGNALS, unit="signal"),  # NaN where there is none
    Field("second_reference", "fcc", _SIGNALS, unit="signal", since=3),  # of other physics; NaN where there is none
    Field("command", "fcc", (len(COMMANDS),), message=CONTROL, elements=_elements("command_", COMMANDS)),
    # Zeros under another law than the fault-tolerant one.
    Field("estimate", "fcc", (len(ESTIMATES),), message=CONTROL, elements=_elements("estimate_", ESTIMATES)),
    Field("surface", "fcc", (len(SURFACES),), message=CONTROL, elements=_elements("surface_", SURFACES)),
    # What reaches the actuators: ``surface``, unless a fault is between.
    Field(
        "surface_command",
        "actuation",
        (len(SURFACES),),
        message=CONTROL,
        elements=_elements("surface_command_", SURFACES),
    ),
    Field("trend_high", "fcc", _SIGNALS, "byte"),
    Field("trend_low", "fcc", _SIGNALS, "byte"),
    Field("valid", "bus", _EACH, "flag"),  # 0: the sensor itself flags the sample
    Field("ilm", "bus", _EACH, "enum", Ilm),
    Field("state", "fcc", _EACH, "enum", State, stem="st"),
    Field("level", "fcc", _SIGNALS, "small"),
    Field("pattern", "fcc", _SIGNALS, "enum", Pattern),
    Field("decided_by", "fcc", _SIGNALS, "enum", DecidedBy),
    Field("reference_usable", "fcc", _SIGNALS, "flag"),
    Field("common_mode", "fcc", _SIGNALS, "flag", since=3),  # both references speak against all channels, which agree
    Field("source", "fcc", _SIGNALS, "enum", Source),
    Field("discrete_truth", "truth", _DISCRETES, "small", message=DISCRETE, stem="truth"),
    Field("discrete_channels", "bus", (D, CHANNELS), "small", message=DISCRETE, stem="ch"),
    Field("discrete_valid", "bus", (D, CHANNELS), "flag", message=DISCRETE, stem="valid", since=3),
    Field("discrete_ilm", "bus", (D, CHANNELS), "enum", Ilm, message=DISCRETE, stem="ilm", since=3),
    Field("discrete_voted", "fcc", _DISCRETES, "small", message=DISCRETE, stem="voted"),
    Field("discrete_state", "fcc", (D, CHANNELS), "enum", State, message=DISCRETE, stem="st"),
    Field("discrete_level", "fcc", _DISCRETES, "small", message=DISCRETE, stem="level"),
    # Bit i % 8 of byte i // 8: fault i of the scenario acted.
    Field("acting", "actuation", (MOST_FAULTS // 8,), "byte", message=FLOWN),
    Field("law", "fcc", (), "enum", Law, message=CONTROL),
    Field("trust", "fcc", (), "enum", Trust, message=CONTROL),
    Field("sensor_fault", "fcc", (), "enum", SensorFault, message=CONTROL),
    Field("end", "truth", (), "enum", End, message=FLOWN),
    # Channels that are commanded to be readmitted in this frame: bit 0 is channel 1.
    Field("reset", "bus", _SIGNALS, "small", since=4),
    Field("discrete_reset", "bus", _DISCRETES, "small", message=DISCRETE, stem="reset", since=4),
    Field("unit", "actuation", (), "enum", UnitStatus, message=CONTROL, since=4),
    Field("unit_age", "actuation", (), "count", message=CONTROL, since=4),  # frames since the unit's last answer
)
FIELD: Final = {field.name: field for field in FIELDS}


@dataclass(frozen=True, slots=True)
class Place:
    """One number of a message: its name there, its field of the frame, its index within the message's row."""

    name: str
    field: str
    index: tuple[int, ...]
    since: int


@cache
def places(message: str) -> tuple[Place, ...]:
    """Return the places of a message, later additions last; no message holds the frame's number."""
    of_message = [place for field in FIELDS if field.message == message for place in _places(field)]
    return tuple(sorted(of_message, key=lambda place: place.since))


def _places(field: Field) -> list[Place]:
    if field.elements:
        old = len(field.elements) - field.newer
        return [Place(name, field.name, (i,), field.since if i < old else 3) for i, name in enumerate(field.elements)]
    stem = field.stem or field.name
    shape = field.shape[1:] if field.message in (SIGNAL, DISCRETE) else field.shape  # within the row of the signal
    if not shape:
        return [Place(stem, field.name, (), field.since)]
    return [Place(f"{stem}_{i + 1}", field.name, (i,), field.since) for i in range(shape[0])]


def elements(field: Field) -> list[tuple[str, tuple[int, ...]]]:
    """Return name and index of every number of a field with its own message; without names they count from 1."""
    if not field.shape:
        return [(field.name, ())]
    names = field.elements or tuple(f"{field.name}_{i + 1}" for i in range(field.shape[0]))
    return list(zip(names, np.ndindex(field.shape), strict=True))
