"""The records between the rig and a unit under test; their fields follow from the frame's table.

Little-endian, IEEE 754, naturally aligned, every gap a separate field (``pad_...``), sizes a multiple of eight bytes.
All transports move the same bytes; docs/reference/icd.md has the tables.

Each version begins with the fields of the previous one at the same places, so that units built for an older version
still fly (INTERFACES).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from enum import IntEnum, IntFlag
from typing import Any, Final, NamedTuple

import numpy as np

from rig.computer.redundancy.discrete_config import DISCRETE_PARAMS
from rig.computer.redundancy.manager_params import PARAM_FIELDS, told
from rig.core.frame import CHANNELS, DISCRETES, SIGNALS, SURFACES, D, DecidedBy, Ilm, Law, Pattern, S, State
from rig.core.frame.fields import BASES, FIELD, FIELDS
from rig.core.renamed import in_layout

VERSION: Final = 5  # of the interface; a change of a field changes LAYOUT alone
TO_UNIT, FROM_UNIT = 0x49474952, 0x4F474952  # "RIGI", "RIGO" as little-endian words
PART_BYTES: Final = 1024  # of CONFIG in one message that must fit into an Ethernet frame
NAME_BYTES, TEXT_BYTES = 64, 192
MORE_THAN_HALF: Final = -1  # as box_signals of CONFIG: of the signals of the box


class Kind(IntEnum):
    """Kinds of messages."""

    HELLO = 1  # a session begins
    CONFIG = 2
    FRAME = 3
    END = 4  # the session is over; the next one begins as if it were the first
    READY = 5  # to HELLO and to the whole CONFIG
    REFUSED = 6  # to either, with a reason
    REPLY = 7


class Said(IntFlag):
    """Groups of an answer that the unit has filled."""

    VOTED = 1
    STATE = 2  # with level
    PATTERN = 4  # with rule, reference_usable, common_mode
    TREND = 8
    DISCRETES = 16  # their votes, states and levels
    SURFACE = 32


class Role(IntEnum):
    """Parts of the flight computer that a unit can replace."""

    REDUNDANCY = 0  # channels in, votes and states out
    FLIGHT_COMPUTER = 1  # surfaces out
    CONTROL_LAW = 2  # votes in, surfaces out


class Status(IntEnum):
    """Status that a unit reports; a unit without a report is ready."""

    READY = 0
    DEGRADED = 1
    FAILED = 2
    SELF_TEST = 3  # from here on its answers are not flown
    POWER_UP = 4


# What the rig gives to a control law: all that its own law reads, and which discretes are lost.
OF_LAW: Final = (
    *("autopilot_command", "inertial", "voted", "reference", "level", "reference_usable"),
    *("discrete_voted", "discrete_level"),
)
# Besides BUS: what the rig computes from the unit's last votes, NaN where there is none.
REFERENCES: Final = ("reference", "second_reference")
ANSWERS: Final[dict[str, Said]] = {
    "voted": Said.VOTED,
    "surface": Said.SURFACE,
    "state": Said.STATE,
    "level": Said.STATE,
    "pattern": Said.PATTERN,
    "decided_by": Said.PATTERN,
    "reference_usable": Said.PATTERN,
    "common_mode": Said.PATTERN,
    "trend_high": Said.TREND,
    "trend_low": Said.TREND,
    "discrete_voted": Said.DISCRETES,
    "discrete_state": Said.DISCRETES,
    "discrete_level": Said.DISCRETES,
    "law": Said.SURFACE,
}
ENUMS: Final[tuple[type[IntEnum] | type[IntFlag], ...]] = (
    Kind,
    Role,
    Said,
    Ilm,
    State,
    Pattern,
    DecidedBy,
    Law,
    Status,
)


# Values of enums that are newer than their enum, by the version that brought them.
_NEW_VALUES: Final = {
    ("DecidedBy", "SLOW"): 2,
    ("DecidedBy", "LANE"): 3,
    ("DecidedBy", "GIVEN_UP"): 3,
    ("Role", "CONTROL_LAW"): 4,
    ("DecidedBy", "SLOW_MEANS"): 5,
    ("DecidedBy", "SLOW_SQUARES"): 5,
    ("DecidedBy", "SLOW_HALVES"): 5,
}


def members(enum: type[IntEnum] | type[IntFlag], version: int = VERSION) -> list[IntEnum | IntFlag]:
    """Return the values of an enum that a unit of a version of the records may read or write."""
    return [member for member in enum if version >= _NEW_VALUES.get((enum.__name__, str(member.name)), 1)]


_Entry = tuple[str, Any, tuple[int, ...]]
_HEAD: Final[list[_Entry]] = [
    ("magic", "<u4", ()),
    ("version", "<u2", ()),
    ("kind", "<u2", ()),
    ("layout", "<u8", ()),
    ("session", "<u8", ()),
    ("frame", "<i8", ()),
    ("time_s", "<f8", ()),
]
_TAIL: Final[list[_Entry]] = [("length", "<u4", ()), ("crc", "<u4", ())]


def _of_frame(names: list[str]) -> list[_Entry]:
    """Return fields of the frame, the widest first."""
    return _widest_first([(name, f"<{BASES[FIELD[name].kind]}", FIELD[name].shape) for name in names])


def _widest_first(entries: list[_Entry]) -> list[_Entry]:
    return sorted(entries, key=lambda entry: -np.dtype(entry[1]).itemsize)


def _packed(entries: list[_Entry]) -> np.dtype[Any]:
    """Lay ``entries`` out in their order, gaps filled by ``pad_1``, ...; the size is a multiple of eight bytes."""
    packed: list[_Entry] = []
    end, pads = 0, 0
    for name, kind, shape in [*entries, ("", "<u8", ())]:  # the last one only closes the record
        dtype = np.dtype(kind)
        alignment = 8 if name == "length" or dtype.names is not None else 1 if dtype.kind == "S" else dtype.itemsize
        if gap := -end % alignment:
            pads += 1
            packed.append((f"pad_{pads}", "u1", (gap,)))
            end += gap
        if name:
            packed.append((name, dtype, shape))
            end += dtype.itemsize * int(np.prod(shape, dtype=int))
    return np.dtype(packed)


def _little(dtype: np.dtype[Any], names: Iterable[str]) -> np.dtype[Any]:
    """Return fields of a record of the rig's settings as a record of the interface, the widest first."""
    kinds = {name: place(dtype, name)[0] for name in names}
    return _packed(_widest_first([(name, kind.base.newbyteorder("<"), kind.shape) for name, kind in kinds.items()]))


def place(dtype: np.dtype[Any], name: str) -> tuple[np.dtype[Any], int]:
    """Return the dtype of a field and its offset."""
    fields: Any = dtype.fields
    return fields[name][0], fields[name][1]


# Fields of CONFIG that hold our own settings, and which of them.
SETTINGS: Final[dict[str, tuple[str, ...]]] = {
    **{part: told(part) for part in ("signal", "slow_faults", "rules", "slow_tests")},
    "discrete": DISCRETE_PARAMS.names or (),
}
TIE_BREAKS: Final = 5  # that a unit may ask: it knows of no other computers


def _of_part(part: str) -> np.dtype[Any]:
    """Return the record of a part of a signal's settings, reserved fields included."""
    fields = [each for each in PARAM_FIELDS if each.part == part]
    shapes = {each.name: (TIE_BREAKS,) if each.name == "tie_break" else each.shape for each in fields}
    return _little(np.dtype([(each.name, each.base, shapes[each.name]) for each in fields]), shapes)


SIGNAL_CONFIG: Final = _of_part("signal")
SLOW_FAULTS_CONFIG: Final = _of_part("slow_faults")
RULES_CONFIG: Final = _of_part("rules")
SLOW_TESTS_CONFIG: Final = _of_part("slow_tests")
DISCRETE_CONFIG: Final = _little(DISCRETE_PARAMS, SETTINGS["discrete"])
HELLO: Final = _packed([*_HEAD, *_TAIL])  # END too
READY: Final = _packed([*_HEAD, ("text", f"S{TEXT_BYTES}", ()), *_TAIL])  # REFUSED too
_CONFIGURED: Final[list[_Entry]] = [
    *_HEAD,
    ("rate_hz", "<f8", ()),
    ("role", "<i8", ()),
    ("box_signals", "<i8", ()),
    ("box_persistence", "<i8", ()),
    ("trim_surface", "<f8", (len(SURFACES),)),
    ("surface_low", "<f8", (len(SURFACES),)),
    ("surface_high", "<f8", (len(SURFACES),)),
    ("signal", SIGNAL_CONFIG, (S,)),
    ("discrete", DISCRETE_CONFIG, (D,)),
    ("aircraft", f"S{NAME_BYTES}", ()),
    ("flight_point", f"S{NAME_BYTES}", ()),
]
_SINCE_2: Final[list[_Entry]] = [("slow_faults", SLOW_FAULTS_CONFIG, (S,))]
_SINCE_3: Final[list[_Entry]] = [*_SINCE_2, ("rules", RULES_CONFIG, (S,))]
CONFIG: Final = _packed([*_CONFIGURED, *_SINCE_3, ("slow_tests", SLOW_TESTS_CONFIG, (S,)), *_TAIL])
PART: Final = _packed(
    [*_HEAD, ("part", "<u4", ()), ("parts", "<u4", ()), ("bytes", "u1", (PART_BYTES,)), *_TAIL]
)  # of CONFIG
_ASKED: Final = [*_HEAD, *_of_frame([*REFERENCES, *(field.name for field in FIELDS if field.part == "bus")])]
_ANSWERED: Final = [*_HEAD, ("stepped", "<u8", ()), *_of_frame([*ANSWERS]), ("said", "u1", ())]
_OF_ITSELF: Final = [("fault_word", "<u4", ()), ("status", "<u2", ()), ("output_discretes", "u1", (8,))]
LAW_INPUT: Final = _packed([*_HEAD, *_of_frame([*OF_LAW]), *_TAIL])  # INPUT of a control law
INPUT: Final = _packed([*_ASKED, ("age_us", "<u2", (S, CHANNELS)), *_TAIL])
OUTPUT: Final = _packed([*_ANSWERED, *_OF_ITSELF, *_TAIL])
# The version in which a record, or a field of CONFIG, INPUT or OUTPUT, came; 1 where none is given.
SINCE: Final = {
    **{"age_us": 2, **{name: 2 for name, _, _ in _OF_ITSELF}, "slow_faults": 2},
    **{"rules": 3, "law_input": 4, "slow_tests": 5},
}
RECORDS: Final[dict[str, np.dtype[Any]]] = {
    "hello": HELLO,
    "ready": READY,
    "signal_config": SIGNAL_CONFIG,
    "discrete_config": DISCRETE_CONFIG,
    "slow_faults_config": SLOW_FAULTS_CONFIG,
    "rules_config": RULES_CONFIG,
    "slow_tests_config": SLOW_TESTS_CONFIG,
    "config": CONFIG,
    "config_part": PART,
    "input": INPUT,
    "law_input": LAW_INPUT,
    "output": OUTPUT,
}


class Entry(NamedTuple):
    """A field of a record, as C, Ada, FMI and tables name it."""

    name: str
    base: np.dtype[Any]  # of an element
    record: str  # name of the record that an element is, or empty
    shape: tuple[int, ...]
    offset: int
    size: int  # bytes of all elements


def walk(dtype: np.dtype[Any]) -> Iterator[Entry]:
    """Yield the fields of a record in the order of their bytes."""
    for name in dtype.names or ():
        kind, offset = place(dtype, name)
        record = next((known for known, held in RECORDS.items() if held == kind.base), "")
        yield Entry(name, kind.base, record, kind.shape, offset, kind.itemsize)


def described(version: int = VERSION) -> str:
    """Return every name, type, shape and offset that both sides must share: LAYOUT is the hash of this text.

    It has the old form of a renamed name: the bytes are the same, and a unit built before the change still flies.
    """
    lines = [f"version {version}", *(signal.name for signal in (*SIGNALS, *DISCRETES))]
    records = RECORDS | _OLDER.get(version, {})
    for record, dtype in records.items():
        if SINCE.get(record.removesuffix("_config"), 1) > version:
            continue
        lines.append(f"{record} {dtype.itemsize}")
        lines += [f"  {e.offset} {e.name} {e.record or e.base.str} {e.shape}" for e in walk(dtype)]
    enums = (enum for enum in ENUMS if version > 1 or enum is not Status)
    lines += [f"{enum.__name__}.{member.name} {member.value}" for enum in enums for member in members(enum, version)]
    return in_layout("\n".join(lines))


def _layout(version: int) -> int:
    return int.from_bytes(hashlib.sha256(described(version).encode()).digest()[:8], "little")


class Interface(NamedTuple):
    """A supported version of the records: the first bytes of the present one, with a separate tail."""

    version: int
    layout: int
    config_bytes: int
    input_bytes: int
    output_bytes: int
    known_bytes: int  # of OUTPUT that are its fields


_CONFIG_1, _INPUT_1, _OUTPUT_1 = (_packed([*entries, *_TAIL]) for entries in (_CONFIGURED, _ASKED, _ANSWERED))
_OLDER: Final[dict[int, dict[str, np.dtype[Any]]]] = {
    1: {"config": _CONFIG_1, "input": _INPUT_1, "output": _OUTPUT_1},
    2: {"config": _packed([*_CONFIGURED, *_SINCE_2, *_TAIL])},
    **{version: {"config": _packed([*_CONFIGURED, *_SINCE_3, *_TAIL])} for version in (3, 4)},
}


def _interface(version: int) -> Interface:
    records = RECORDS | _OLDER.get(version, {})
    config, asked, answer = (records[name].itemsize for name in ("config", "input", "output"))
    unknown = [place(OUTPUT, name)[1] for name in OUTPUT.names or () if SINCE.get(name, 1) > version]
    return Interface(version, _layout(version), config, asked, answer, min(unknown, default=answer))


INTERFACE: Final = _interface(VERSION)
LAYOUT: Final = INTERFACE.layout
OLD_INTERFACES: Final = tuple(_interface(version) for version in range(VERSION - 1, 0, -1))  # the newest first
INTERFACES: Final = {(interface.version, interface.layout): interface for interface in (INTERFACE, *OLD_INTERFACES)}


def blank(
    dtype: np.dtype[Any], magic: int, kind: Kind, session: int = 0, interface: Interface = INTERFACE
) -> np.ndarray[Any, Any]:
    """Return a record (1,) of a session with only its head and length, at their places in ``interface``."""
    record = np.zeros(1, dtype)
    record["magic"], record["version"], record["kind"] = magic, interface.version, kind
    record["layout"], record["session"] = interface.layout, session
    size = size_of(dtype, interface)
    record.view("u1")[size - 8 : size - 4] = np.frombuffer((size - 8).to_bytes(4, "little"), "u1")
    return record


def size_of(dtype: np.dtype[Any], interface: Interface) -> int:
    """Return the bytes of a record in a version."""
    sizes = {CONFIG: interface.config_bytes, INPUT: interface.input_bytes, OUTPUT: interface.output_bytes}
    return sizes.get(dtype, dtype.itemsize)


def role_of(name: str) -> Role:
    """Return the role of its name in a unit file: ``control-law``."""
    return Role[name.replace("-", "_").upper()]


def input_of(role: Role) -> np.dtype[Any]:
    """Return the record that a unit of a role reads in every frame."""
    return LAW_INPUT if role is Role.CONTROL_LAW else INPUT
