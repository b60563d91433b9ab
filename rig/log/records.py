"""The record of each topic: the constant bytes of its message, and which value of which source goes where."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from rig.core.frame import FLAT, ROW_PARTS, TIMING
from rig.log.schema import ALL_TOPICS, DOUBLE, FIXED32, FLOAT, PART_OF, POSE_TOPICS, Field, Topic

WORLD: Final = "world"
AIRCRAFT: Final = "aircraft"
MESSAGE_OPCODE: Final = 5
HEAD: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel id, sequence, log time, publish time

TIMES: Final = np.dtype([("log_time", "<u8")])
# What a pose and a position need.
DERIVED: Final = np.dtype(
    [
        ("log_time", "<u8"),
        ("sequence", "<u4"),
        ("seconds", "u1", (5,)),  # varints
        ("nanoseconds", "u1", (5,)),
        ("translation", "<f8", (3,)),
        ("rotation", "<f8", (4,)),  # x, y, z, w
        ("position", "<f8", (3,)),  # latitude and longitude in degrees, altitude in m
    ],
    align=True,
)


@dataclass(frozen=True, slots=True)
class Value:
    """``width`` bytes of a source, moved into ``room`` bytes of the row (the rest stay zero)."""

    source: str
    offset: int
    width: int
    room: int


Pieces = list[bytes | Value]
Marked = tuple[bytes, list[Value]]  # what stands in a message where values belong, and the values

WIRE: Final = {DOUBLE: 1, FIXED32: 5, FLOAT: 5}  # protobuf wire types; all other kinds are varints of one byte, 0


def size_of(pieces: Pieces) -> int:
    """Return how many bytes the pieces have together."""
    return sum(len(piece) if isinstance(piece, bytes) else piece.room for piece in pieces)


def tag(number: int, wire: int) -> bytes:
    """Return the tag of a protobuf field: its number and its wire type."""
    key = number << 3 | wire
    return bytes([key]) if key < 128 else bytes([key & 127 | 128, key >> 7])


def place(dtype: np.dtype[Any], name: str) -> tuple[np.dtype[Any], int]:
    """Return the dtype and the offset of a field of a structured dtype."""
    fields: Any = dtype.fields
    return fields[name][:2]


def _of(source: str, dtype: np.dtype[Any], name: str, index: int = 0, room: int | None = None) -> Value:
    """Return element ``index`` (counted through all its axes) of a field of a structured dtype."""
    column, offset = place(dtype, name)
    width = column.base.itemsize
    return Value(source, offset + index * width, width, room or width)


def _derived(name: str, index: int = 0) -> Value:
    return _of("derived", DERIVED, name, index)


def _payload(topic: Topic, fields: Sequence[Field]) -> Pieces:
    if topic.name == "/pose":
        return _pose()
    if topic.name == "/position":
        return _position()
    pieces: Pieces = []
    for number, field in enumerate(fields, 1):
        pieces += [tag(number, WIRE.get(field.kind, 0)), _element(topic, field)]
    return pieces


def _element(topic: Topic, field: Field) -> Value:
    if topic.message == "rig.Timing":
        return _of("timing", TIMING, field.source)
    if (part := PART_OF.get(topic)) is not None:
        of = ROW_PARTS[part].base
        item, *at = topic.at(field)
        shape = place(of, field.source)[0].shape
        value = _of(part, of, field.source, int(np.ravel_multi_index(at, shape)) if shape else 0)
        return Value(part, item * of.itemsize + value.offset, value.width, value.room)
    index = topic.at(field)
    flat = int(np.ravel_multi_index(index, FLAT[field.source].shape)) if index else 0
    return _of("frame", FLAT, field.source, flat, 4 if field.kind == FIXED32 else None)


def _doubles(name: str) -> list[Marked]:
    """Return the elements of a field of DERIVED, for the numbers 1, 2, 3, ... in a message."""
    return [(struct.pack("<d", i + 1.0), [_derived(name, i)]) for i in range(DERIVED[name].shape[0])]


def _cut(message: Message, marks: Sequence[Marked]) -> Pieces:
    """Return a message as protobuf writes it, with values in the places of its marks, which stand in this order."""
    pieces: Pieces = []
    rest = message.SerializeToString()
    for mark, values in marks:
        before, _, rest = rest.partition(mark)
        pieces += [before, *values]
    return [*pieces, rest]


_STAMP: Final = Timestamp(seconds=1 << 34, nanos=1 << 30)  # both varints have five bytes
_STAMPED: Final[list[Marked]] = [
    (b"\x80\x80\x80\x80\x40", [_derived("seconds", i) for i in range(5)]),
    (b"\x80\x80\x80\x80\x04", [_derived("nanoseconds", i) for i in range(5)]),
]


def _pose() -> Pieces:
    frames = {"parent_frame_id": WORLD, "child_frame_id": AIRCRAFT}
    place, turn = Vector3(x=1, y=2, z=3), Quaternion(x=1, y=2, z=3, w=4)
    message = FrameTransform(timestamp=_STAMP, **frames, translation=place, rotation=turn)
    return _cut(message, [*_STAMPED, *_doubles("translation"), *_doubles("rotation")])


def _position() -> Pieces:
    """Return two parts, the time first as in all logs: protobuf would put it last, and reads any order."""
    when = _cut(LocationFix(timestamp=_STAMP, frame_id=AIRCRAFT), _STAMPED)
    return [*when, *_cut(LocationFix(latitude=1, longitude=2, altitude=3), _doubles("position"))]


def record(topic: Topic, fields: Sequence[Field]) -> Pieces:
    """Return the message record of a topic; ``fields`` of its message, none of foxglove's."""
    payload = _payload(topic, fields)
    opening = struct.pack("<BQH", MESSAGE_OPCODE, HEAD.size - 9 + size_of(payload), ALL_TOPICS.index(topic) + 1)
    posed = topic in POSE_TOPICS
    sequence = _derived("sequence") if posed else Value("frame", 0, 4, 4)  # the first field, which is the number
    time = _derived("log_time") if posed else _of("times", TIMES, "log_time")
    return [opening, sequence, time, time, *payload]
