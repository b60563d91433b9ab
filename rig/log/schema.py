"""Contents of the log: every topic and message, made from the tables of rig/core/frame/.

Each field of the frame has one place in one message, so a signal, a command or a field added there
appears in the log by itself.  The descriptors of the messages are embedded in the log; a viewer needs
no other file of the rig to read it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any, Final

from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Log_pb2 import Log as FoxgloveLog
from google.protobuf.descriptor_pb2 import (
    DescriptorProto,
    EnumDescriptorProto,
    EnumValueDescriptorProto,
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)
from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding

from rig.core.event import Severity
from rig.core.frame import (
    COMPUTER_FIELDS,
    COMPUTERS,
    DISCRETES,
    LINKS,
    MOVED,
    SERVO_FIELDS,
    SIGNALS,
    TIMING,
    RowPart,
    RowParts,
    UnitStatus,
)
from rig.core.frame.fields import FIELD, Kind, Place, elements, places
from rig.core.frame.fields import Field as FrameField
from rig.core.renamed import ENUMS, field_now
from rig.log.container import Opening

BY_TOPIC: Final = 5  # the first version whose chunks stand topic by topic
SCHEMA_VERSION: Final = 8  # history in docs/reference/log.md
MESSAGES_SINCE: Final = 4  # whose messages are the present ones
OLDEST: Final = 2  # that is still read

DOUBLE: Final = FieldDescriptorProto.TYPE_DOUBLE
FLOAT: Final = FieldDescriptorProto.TYPE_FLOAT
BOOL: Final = FieldDescriptorProto.TYPE_BOOL
UINT32: Final = FieldDescriptorProto.TYPE_UINT32  # one byte: only for what stays below 128
FIXED32: Final = FieldDescriptorProto.TYPE_FIXED32
ENUM: Final = FieldDescriptorProto.TYPE_ENUM

# How each kind of field is written; a fixed32 holds all of u1 and u4.
_ENUM_NAMES: Final[dict[type[IntEnum], str]] = {UnitStatus: "Unit"}  # others: the class's
_WRITTEN: Final[dict[Kind, Any]] = {
    "number": DOUBLE,
    "single": FLOAT,
    "enum": ENUM,
    "flag": BOOL,
    "small": UINT32,
    "byte": FIXED32,
    "count": FIXED32,
}


@dataclass(frozen=True, slots=True)
class Field:
    """One protobuf field and the element of FLAT or TIMING that it holds."""

    name: str
    kind: Any  # a FieldDescriptorProto.Type
    source: str
    index: tuple[int, ...] = ()  # within the source, after the topic's own row of it
    enum: type[IntEnum] | None = None


@dataclass(frozen=True, slots=True)
class Topic:
    """One MCAP channel; ``item`` is its row in the arrays of FLAT, None where there are no rows."""

    name: str
    message: str
    item: int | None = None

    def at(self, field: Field) -> tuple[int, ...]:
        """Return where the element of a field of its message is in the field's array of FLAT."""
        return field.index if self.item is None else (self.item, *field.index)


def _field(place: Place) -> Field:
    field = FIELD[place.field]
    return Field(place.name, _WRITTEN[field.kind], field.name, place.index, field.enum)


# The fields of each message; their numbers are their positions, from 1.
_OF_FRAME: Final = ("rig.Signal", "rig.Discrete", "rig.Control", "rig.AutopilotCommand", "rig.Inertial", "rig.Flight")
MESSAGES: Final = {
    **{name: tuple(map(_field, places(name))) for name in _OF_FRAME},
    "rig.Timing": tuple(Field(name, DOUBLE, name) for name in TIMING.names or ()),
}


def _own(fields: Iterable[FrameField]) -> Iterator[Field]:
    """Yield the numbers of the message of one surface or computer."""
    for field in fields:
        for name, index in elements(field):
            yield Field(name, _WRITTEN[field.kind], field.name, index, field.enum)


def _of_links(fields: Iterable[FrameField]) -> Iterator[Field]:
    """Yield the numbers of all links, by sender and receiver, which has them in its record."""
    for field in fields:
        for sender, receiver in LINKS:
            name = f"{field.stem}_{COMPUTERS[sender]}_{COMPUTERS[receiver]}"
            yield Field(name, _WRITTEN[field.kind], field.name, (receiver, sender), field.enum)


PART_MESSAGES: Final = {
    "rig.Actuator": tuple(_own(SERVO_FIELDS)),
    "rig.Computer": tuple(_own(field for field in COMPUTER_FIELDS if field.message == "rig.Computer")),
    "rig.Ccdl": tuple(_of_links(field for field in COMPUTER_FIELDS if field.message == "rig.Ccdl")),
}
FOXGLOVE: Final = {cls.DESCRIPTOR.full_name: cls for cls in (FrameTransform, LocationFix, FoxgloveLog)}

# One message of each in every frame, in the order of their bytes.  Channel ids count from 1.
FRAME_TOPICS: Final = (
    *(Topic(signal.topic, "rig.Signal", i) for i, signal in enumerate(SIGNALS)),
    *(Topic(discrete.topic, "rig.Discrete", i) for i, discrete in enumerate(DISCRETES)),
    Topic("/control", "rig.Control"),
    Topic("/autopilot_command", "rig.AutopilotCommand"),
    Topic("/inertial", "rig.Inertial"),
    Topic("/flight", "rig.Flight"),
    Topic("/timing", "rig.Timing"),
)
# Drawn, never read back: one of each every POSE_EVERY frames of a chunk.
POSE_TOPICS: Final = (Topic("/pose", "foxglove.FrameTransform"), Topic("/position", "foxglove.LocationFix"))
POSE_EVERY: Final = 4
TOPICS_OF_ROWS: Final = tuple(topic for topic in FRAME_TOPICS if topic.message in _OF_FRAME)
EVENTS: Final = Topic("/events", "foxglove.Log")
TOPICS: Final = (*FRAME_TOPICS, *POSE_TOPICS, EVENTS)
# In the log of a flight with servo actuators, or several computers, too: one message of each in every frame.
PART_TOPICS: Final[dict[RowPart, tuple[Topic, ...]]] = {
    "servo": tuple(Topic(f"/actuator/{name}", "rig.Actuator", i) for i, name in enumerate(MOVED)),
    "computer": (
        *(Topic(f"/computer/{name}", "rig.Computer", i) for i, name in enumerate(COMPUTERS)),
        Topic("/ccdl", "rig.Ccdl"),  # of all computers: the first of an index is the receiver
    ),
}
PART_OF: Final[dict[Topic, RowPart]] = {topic: part for part, topics in PART_TOPICS.items() for topic in topics}
ALL_TOPICS: Final = (*TOPICS, *PART_OF)
RIG: Final = "rig"  # names of the metadata records
RESULT: Final = "result"
EVENT_CHANNEL: Final = TOPICS.index(EVENTS) + 1
LEVELS: Final[dict[Severity, Any]] = {
    "info": FoxgloveLog.INFO,
    "warning": FoxgloveLog.WARNING,
    "error": FoxgloveLog.ERROR,
}


@cache
def descriptors(name: str) -> FileDescriptorSet:
    """Return the descriptor of a message with all that it depends on, as the log embeds it."""
    if name in MESSAGES or name in PART_MESSAGES:
        return FileDescriptorSet(file=[_file(name, {**MESSAGES, **PART_MESSAGES}[name])])
    files: dict[str, FileDescriptorProto] = {}

    def collect(file: Any) -> None:
        for dependency in file.dependencies:
            collect(dependency)
        proto = FileDescriptorProto()
        file.CopyToProto(proto)
        files.setdefault(file.name, proto)

    collect(FOXGLOVE[name].DESCRIPTOR.file)
    return FileDescriptorSet(file=list(files.values()))


def older(described: FileDescriptorSet, known: Iterable[Field]) -> tuple[Field, ...] | None:
    """Return the fields of a message of an earlier version, by their numbers; None if one of them no longer exists.

    Names of then are those of now by core/renamed.py.  An enum of then may have fewer members, but none of another
    number.  known : the fields of the message today
    """
    (message,) = described.file[0].message_type
    ours = {field.name: field for field in known}
    enums = {ENUMS.get(e.name, e.name): {(v.name, v.number) for v in e.enum_type[0].value} for e in message.nested_type}
    fields: list[Field] = []
    for number, theirs in enumerate(message.field, 1):
        field = ours.get(theirs.name) or ours.get(field_now(theirs.name))
        if field is None or (theirs.number, theirs.type) != (number, field.kind):
            return None
        if field.enum and not enums[_enum_name(field.enum)] <= {(m.name, m.value) for m in field.enum}:
            return None
        fields.append(field)
    return tuple(fields)


def _file(message: str, fields: Iterable[Field]) -> FileDescriptorProto:
    package, short = message.split(".")
    enums = dict.fromkeys(field.enum for field in fields if field.enum)
    described = DescriptorProto(name=short, nested_type=[_enum(e) for e in enums])
    for number, field in enumerate(fields, 1):
        described.field.append(
            FieldDescriptorProto(
                name=field.name,
                number=number,
                label=FieldDescriptorProto.LABEL_OPTIONAL,
                type=field.kind,
                type_name=f".{message}.{_enum_name(field.enum)}.Value" if field.enum else None,
            )
        )
    name = f"{package}/{short}.proto"
    return FileDescriptorProto(name=name, package=package, syntax="proto3", message_type=[described])


def _enum(enum: type[IntEnum]) -> DescriptorProto:
    """Return an enum in its own scope, so that names need no prefix: a viewer shows OK, SUSPECT, FAILED."""
    values = [EnumValueDescriptorProto(name=member.name, number=member.value) for member in enum]
    return DescriptorProto(name=_enum_name(enum), enum_type=[EnumDescriptorProto(name="Value", value=values)])


def _enum_name(enum: type[IntEnum]) -> str:
    return _ENUM_NAMES.get(enum, enum.__name__)


@cache
def topics(parts: RowParts = ()) -> tuple[Topic, ...]:
    """Return the topics of a log with these parts of the second row."""
    return (*TOPICS, *(topic for part in parts for topic in PART_TOPICS[part]))


@cache
def opening(parts: RowParts = ()) -> Opening:
    """Return schema and channel records, the same in every file with these parts of the second row."""
    schemas = [
        Schema(i, descriptors(name).SerializeToString(), SchemaEncoding.Protobuf, name)
        for i, name in enumerate(_schema_names(parts), 1)
    ]
    return Opening.of(schemas, channels(parts))


def _schema_names(parts: RowParts) -> list[str]:
    return list(dict.fromkeys(topic.message for topic in topics(parts)))


def channels(parts: RowParts = ()) -> list[Channel]:
    """Return the channel records, ids by the place in ALL_TOPICS, from 1; a signal's has its unit, symbol and range."""
    metadata = {
        signal.topic: {
            "unit": signal.unit,
            "symbol": signal.symbol,
            "group": signal.group,
            "low": repr(signal.low),
            "high": repr(signal.high),
        }
        for signal in SIGNALS
    }
    schema_ids = {name: i for i, name in enumerate(_schema_names(parts), 1)}
    return [
        Channel(
            ALL_TOPICS.index(topic) + 1,
            topic.name,
            MessageEncoding.Protobuf,
            metadata.get(topic.name, {}),
            schema_ids[topic.message],
        )
        for topic in topics(parts)
    ]
