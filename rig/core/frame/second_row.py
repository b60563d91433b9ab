"""The second row of a frame, of flights with servo actuators or several computers; others have none.

Its parts, by name:

    servo     a SERVO record for elevator, aileron and rudder: measurements and commands of their servo channels
    computer  a COMPUTER record for each of the lanes A to D: its decisions and commands

Measured numbers are the converters' output, in single precision; monitors, and a replay of a log, read them so.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from rig.core.frame.enums import ActuatorMonitor, DecidedBy, Health, LaneTest, LinkState, Pattern, State
from rig.core.frame.fields import BASES, Field
from rig.core.frame.signals import CHANNELS, SIGNALS, SURFACES, S

MOVED: Final = tuple(name.removesuffix("_rad") for name in SURFACES[:3])  # by servos; the throttle never is
SYSTEMS: Final = 2  # hydraulic
_EACH: Final = (CHANNELS,)
_MESSAGE: Final = "rig.Actuator"

# In the order of the message; what has no unit is a share: 1 is the full current, the spool's full opening, all flow.
SERVO_FIELDS: Final = (
    Field("asked", "actuation", _EACH, unit="rad", message=_MESSAGE),  # of each channel, by its computer
    Field("ram", "actuation", (), unit="rad", message=_MESSAGE),  # where it is at the end of the frame
    Field("lvdt", "actuation", _EACH, "single", unit="rad", message=_MESSAGE),  # its position sensors, at the beginning
    Field("current", "actuation", _EACH, "single", message=_MESSAGE),  # measured
    Field("spool", "actuation", (), "single", message=_MESSAGE),
    Field("spool_model", "actuation", _EACH, "single", message=_MESSAGE),  # moved by the channel's own current
    Field("ram_model", "actuation", _EACH, "single", unit="rad", message=_MESSAGE),  # moved by the channel's command
    Field("pressure", "actuation", (SYSTEMS,), "single", message=_MESSAGE),
    Field("open_coil", "actuation", _EACH, "flag", message=_MESSAGE),  # the monitor of the wire says so
    Field("valve", "actuation", _EACH, "flag", message=_MESSAGE),  # shut-off valve: 1 commanded to shut the channel off
    Field("valve_sensed", "actuation", _EACH, "flag", message=_MESSAGE),
    Field("valve_differs", "actuation", _EACH, "flag", message=_MESSAGE),  # for longer than it may
    Field("failed_by", "actuation", _EACH, "enum", ActuatorMonitor, message=_MESSAGE),
    Field("bypassed", "actuation", (), "flag", message=_MESSAGE),  # no channel or no pressure moves the ram
)
COMPUTERS: Final = ("A", "B", "C", "D")  # lane i has channel i
INTEGRATED: Final = ("elevator_rad", "aileron_rad", "rudder_rad", "throttle")
_BY_LANE: Final = (len(COMPUTERS),)
_COMPUTER, _CCDL = "rig.Computer", "rig.Ccdl"
_NAMES: Final = tuple(signal.name for signal in SIGNALS)


def _of_signals(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}_{name}" for name in _NAMES)


def _of_lanes(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}_{name}" for name in COMPUTERS)


def _of_surfaces(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}_{name}" for name in SURFACES)


COMPUTER_FIELDS: Final = (
    Field("voted", "fcc", (S,), unit="signal", message=_COMPUTER, elements=_of_signals("voted")),
    Field(
        "state",
        "fcc",
        (S, CHANNELS),
        "enum",
        State,
        message=_COMPUTER,
        elements=tuple(f"state_{name}_{c + 1}" for name in _NAMES for c in range(CHANNELS)),
    ),
    Field("level", "fcc", (S,), "small", message=_COMPUTER, elements=_of_signals("level")),
    Field("pattern", "fcc", (S,), "enum", Pattern, message=_COMPUTER, elements=_of_signals("pattern")),
    Field("decided_by", "fcc", (S,), "enum", DecidedBy, message=_COMPUTER, elements=_of_signals("decided_by")),
    Field("surface", "fcc", (len(SURFACES),), message=_COMPUTER, elements=_of_surfaces("surface")),
    Field(  # of the control law
        "integral",
        "fcc",
        (len(INTEGRATED),),
        message=_COMPUTER,
        elements=tuple(f"integral_{name}" for name in INTEGRATED),
    ),
    Field("clock_lead", "fcc", (), message=_COMPUTER),  # it samples so many frames before the plant's instant
    # By sender of what it receives; the log has those of all lanes in one message.
    Field("link", "fcc", _BY_LANE, "enum", LinkState, message=_CCDL, stem="state"),
    Field("silent", "fcc", _BY_LANE, "small", message=_CCDL, stem="age"),  # frames since a good message, to 127
    Field("outvoted", "fcc", _BY_LANE, "flag", message=_CCDL, stem="outvoted"),  # by relays
    # What it puts out behind the vote of all lanes' commands, as its converters give it, and how that vote was found.
    Field("output", "fcc", (len(SURFACES),), message=_COMPUTER, elements=_of_surfaces("output")),
    Field(
        "command_pattern",
        "fcc",
        (len(SURFACES),),
        "enum",
        Pattern,
        message=_COMPUTER,
        elements=_of_surfaces("command_pattern"),
    ),
    Field(
        "command_decided_by",
        "fcc",
        (len(SURFACES),),
        "enum",
        DecidedBy,
        message=_COMPUTER,
        elements=_of_surfaces("command_decided_by"),
    ),
    Field("health", "fcc", (), "enum", Health, message=_COMPUTER),
    Field("failed_for", "fcc", (), "enum", LaneTest, message=_COMPUTER),
    Field(
        "accuses", "fcc", _BY_LANE, "enum", LaneTest, message=_COMPUTER, elements=_of_lanes("accuses")
    ),  # and for what
    Field(
        "leads", "fcc", (), "flag", message=_COMPUTER
    ),  # its votes and commands are the frame's; no lane leads: the back-up's
)


def _record(fields: Sequence[Field]) -> np.dtype[Any]:
    """Return the record of some fields, the widest first."""
    described = [(f.name, BASES[f.kind], f.shape) for f in fields]
    return np.dtype(sorted(described, key=lambda f: -np.dtype(f[1]).itemsize), align=True)


LINKS: Final = tuple(permutations(range(len(COMPUTERS)), 2))  # sender, receiver
LINK: Final = np.dtype([("state", "u1"), ("age", "u1"), ("outvoted", "u1")])  # of one link; age : frames, to 127
SERVO: Final = _record(SERVO_FIELDS)
COMPUTER: Final = _record(COMPUTER_FIELDS)
RowPart = Literal["servo", "computer"]
RowParts = tuple[RowPart, ...]  # in the order of ROW_PARTS
SecondRows = NDArray[Any]  # (n,), frame and the parts that the flight has
ROW_PARTS: Final[dict[RowPart, np.dtype[Any]]] = {
    "servo": np.dtype((SERVO, (len(MOVED),))),
    "computer": np.dtype((COMPUTER, (len(COMPUTERS),))),
}


def parts_of(rows: SecondRows | None) -> RowParts:
    """Return the parts of second rows."""
    return () if rows is None else tuple(part for part in ROW_PARTS if part in (rows.dtype.names or ()))


def links(computer: NDArray[Any]) -> NDArray[Any]:
    """Return the links of rows (n, 4) of COMPUTER as (n, 4, 4) of LINK, receiver by sender: a copy."""
    found = np.empty((*computer.shape, len(COMPUTERS)), LINK)
    for name, field in zip(LINK.names or (), ("link", "silent", "outvoted"), strict=True):
        found[name] = computer[field]
    return found


def second_rows(frames: int, parts: RowParts = ("servo",), first_frame: int = 0) -> SecondRows:
    """Return blank rows with some parts, numbered from ``first_frame``."""
    rows = np.zeros(frames, np.dtype([("frame", "i8"), *((part, ROW_PARTS[part]) for part in parts)], align=True))
    rows["frame"] = np.arange(first_frame, first_frame + frames)
    return rows
