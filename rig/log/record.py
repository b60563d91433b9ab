"""The message records of one frame as pieces: constant bytes, and values with their place in the frame.

All fields of our messages are written, doubles and small integers have a fixed width, and the varints of
time stamps are padded to one: so every frame's records are alike but for their values.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from rig.frame import FLAT, TIMING
from rig.log.schema import DOUBLE, FIXED32, FOXGLOVE, TOPICS, Field, Topic

WORLD: Final = "world"
AIRCRAFT: Final = "aircraft"
MESSAGE_OPCODE: Final = 5
HEAD: Final = struct.Struct("<BQHIQQ")  # opcode, length, channel id, sequence, log time, publish time

# What a row needs that is not in FLAT or TIMING.
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


WIRE: Final = {DOUBLE: 1, FIXED32: 5}  # protobuf wire types; all other kinds are varints of one byte, 0


def _size(pieces: Pieces) -> int:
    return sum(len(piece) if isinstance(piece, bytes) else piece.room for piece in pieces)


def tag(number: int, wire: int) -> bytes:
    """The tag of a protobuf field: its number and its wire type."""
    key = number << 3 | wire
    return bytes([key]) if key < 128 else bytes([key & 127 | 128, key >> 7])


def place(dtype: np.dtype[Any], name: str) -> tuple[np.dtype[Any], int]:
    """The dtype and the offset of a field of a structured dtype."""
    fields: Any = dtype.fields
    return fields[name][:2]


def _of(source: str, dtype: np.dtype[Any], name: str, index: int = 0, room: int | None = None) -> Value:
    """Element ``index`` (counted through all its axes) of a field of a structured dtype."""
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
    index = field.index if topic.item is None else (topic.item, *field.index)
    flat = int(np.ravel_multi_index(index, FLAT[field.source].shape)) if index else 0
    return _of("frame", FLAT, field.source, flat, 4 if field.kind == FIXED32 else None)


def _nested(number: int, pieces: Pieces) -> Pieces:
    return [tag(number, 2), bytes([_size(pieces)]), *pieces]


def _text(number: int, text: str) -> Pieces:
    return _nested(number, [text.encode()])


def _doubles(name: str, count: int) -> Pieces:
    return [piece for i in range(count) for piece in (tag(i + 1, 1), _derived(name, i))]


def _stamp(number: int) -> Pieces:
    """google.protobuf.Timestamp, both varints padded to five bytes."""
    seconds = [_derived("seconds", i) for i in range(5)]
    nanoseconds = [_derived("nanoseconds", i) for i in range(5)]
    return _nested(number, [tag(1, 0), *seconds, tag(2, 0), *nanoseconds])


def _numbers(name: str) -> dict[str, int]:
    return {field.name: field.number for field in FOXGLOVE[name].DESCRIPTOR.fields}


def _pose() -> Pieces:
    number = _numbers("foxglove.FrameTransform")
    return [
        *_stamp(number["timestamp"]),
        *_text(number["parent_frame_id"], WORLD),
        *_text(number["child_frame_id"], AIRCRAFT),
        *_nested(number["translation"], _doubles("translation", 3)),
        *_nested(number["rotation"], _doubles("rotation", 4)),
    ]


def _position() -> Pieces:
    number = _numbers("foxglove.LocationFix")
    pieces = [*_stamp(number["timestamp"]), *_text(number["frame_id"], AIRCRAFT)]
    for i, name in enumerate(("latitude", "longitude", "altitude")):
        pieces += [tag(number[name], 1), _derived("position", i)]
    return pieces


def frame_record(topic: Topic, fields: Sequence[Field]) -> Pieces:
    """The message record that a topic has in every frame; ``fields`` of its message, none of foxglove's."""
    payload = _payload(topic, fields)
    length = HEAD.size - 9 + _size(payload)
    opening = struct.pack("<BQH", MESSAGE_OPCODE, length, TOPICS.index(topic) + 1)
    times: Pieces = [_derived("log_time"), _derived("log_time")]
    return [opening, _derived("sequence"), *times, *payload]
