"""Where every byte of a chunk lies, and the way from there to frames; packing.py goes the other way.

All fields of our messages are written, doubles and small integers have a fixed width, and the varints of time stamps
are padded to one: so the message records of a frame always have the same length and the same constant bytes (opcodes,
lengths, channel ids, protobuf tags): the ``TEMPLATE``.  What changes is moved between the frame and the
template by ``MOVES``, tables of byte offsets.  A chunk is a run of such rows, then the records of its events.

No kernels here: a log is read before they would be loaded.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

import numpy as np
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from numpy.typing import NDArray

from rig.frame import FLAT, TIMING, Block, Ilm, State
from rig.frame.fields import FIELD
from rig.log.container import Run
from rig.log.schema import DOUBLE, EVENT_CHANNEL, FIXED32, FRAME_TOPICS, MESSAGES, TOPICS, Field, Topic

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
Marked = tuple[bytes, list[Value]]  # what stands in a message where values belong, and the values

WIRE: Final = {DOUBLE: 1, FIXED32: 5}  # protobuf wire types; all other kinds are varints of one byte, 0


def _size(pieces: Pieces) -> int:
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
    index = field.index if topic.item is None else (topic.item, *field.index)
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


def frame_record(topic: Topic, fields: Sequence[Field]) -> Pieces:
    """Return the message record that a topic has in every frame; ``fields`` of its message, none of foxglove's."""
    payload = _payload(topic, fields)
    length = HEAD.size - 9 + _size(payload)
    opening = struct.pack("<BQH", MESSAGE_OPCODE, length, TOPICS.index(topic) + 1)
    times: Pieces = [_derived("log_time"), _derived("log_time")]
    return [opening, _derived("sequence"), *times, *payload]


Moves = tuple[NDArray[np.uint64], NDArray[np.uint64]]  # of eight bytes, of one byte: rows (in source, in row)


def _moves(source: str, placed: list[tuple[int, Value]]) -> Moves:
    words: list[tuple[int, int]] = []
    octets: list[tuple[int, int]] = []
    for at, value in placed:
        if value.source == source and value.width == 8:
            words.append((value.offset, at))
        elif value.source == source:
            octets += [(value.offset + i, at + i) for i in range(value.width)]
    return (
        np.array(words, np.uint64).reshape(-1, 2),
        np.array(octets, np.uint64).reshape(-1, 2),
    )


class Layout:
    """The rows of a chunk, for the fields that each of our messages has, in the order of their numbers.

    ``template``: a row but for its values; ``starts``: of each topic's record in it; ``moves``: of each source into it;
    ``absent``: numbers of FLAT that the messages do not have, field and index
    """

    def __init__(self, messages: Mapping[str, Sequence[Field]]) -> None:
        template, placed = bytearray(), list[tuple[int, Value]]()
        self.starts: list[int] = []
        for topic in FRAME_TOPICS:
            self.starts.append(len(template))
            for piece in frame_record(topic, messages.get(topic.message, ())):
                if isinstance(piece, bytes):
                    template += piece
                else:
                    placed.append((len(template), piece))
                    template += bytes(piece.room)
        self.template = np.frombuffer(bytes(template), np.uint8)
        self.moves = {source: _moves(source, placed) for source in ("frame", "timing", "derived")}
        self.absent = [
            (field.source, field.index)
            for name, message in MESSAGES.items()
            for field in message.fields
            if field not in messages[name] and field.source in FIELD
        ]
        self._of_frame, self._of_timing = self._origins("frame", FLAT), self._origins("timing", TIMING)
        self._of_frame[: len(_SEQUENCE)] = _SEQUENCE

    def _origins(self, source: str, dtype: np.dtype[Any]) -> NDArray[np.intp]:
        """Return for every byte of a record of ``dtype`` its place in a packed row; what has none comes from a zero."""
        origins = np.full(dtype.itemsize, _ZERO, np.intp)
        words, octets = self.moves[source]
        for i in range(8):
            origins[words[:, 0] + i] = words[:, 1] + i
        origins[octets[:, 0]] = octets[:, 1]
        return origins

    def unpack(self, packed: NDArray[np.uint8]) -> tuple[Block, NDArray[np.void]]:
        """Return the FLAT rows and their TIMING of ``packed`` (n, row), bit for bit what ``packing.pack`` was given."""
        rows = _gathered(packed, self._of_frame, FLAT)
        if self.absent:
            self._fill(rows)
        return rows, _gathered(packed, self._of_timing, TIMING)

    def _fill(self, rows: Block) -> None:
        """Give ``rows`` what an older log does not say: no number; a discrete whose channels are valid, unmonitored."""
        for name, index in self.absent:
            fill = np.nan if FIELD[name].kind == "number" else 0
            if name == "discrete_ilm":
                fill = Ilm.ABSENT
            rows[name][(..., *index)] = fill
        if ("discrete_valid", (0,)) in self.absent:
            rows["discrete_valid"] = rows["discrete_state"] != State.ABSENT

    def rows_in(self, data: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the run of rows at the beginning of a chunk's bytes, as (n, row)."""
        size = len(self.template)
        whole = len(data) // size
        candidates = data[: whole * size].reshape(whole, size)
        ours = (candidates[:, :_OPENING] == self.template[:_OPENING]).all(axis=1)
        return candidates[: whole if ours.all() else int(ours.argmin())]


_OPENING: Final = 11  # bytes: opcode, length and channel of the first record, which mark a row
_ZERO: Final = 8  # the last byte of that length
_SEQUENCE: Final = range(11, 15)  # which is the frame's number


def _gathered(packed: NDArray[np.uint8], origins: NDArray[np.intp], dtype: np.dtype[Any]) -> NDArray[np.void]:
    rows = np.empty(len(packed), dtype)
    to = rows.view(np.uint8).reshape(len(packed), dtype.itemsize)
    np.take(packed, origins, axis=1, out=to, mode="clip")  # "raise" would copy; the interpreter is free meanwhile
    return rows


LAYOUT: Final = Layout({name: message.fields for name, message in MESSAGES.items()})  # of what we write
TEMPLATE, STARTS, MOVES = LAYOUT.template, LAYOUT.starts, LAYOUT.moves
ROW: Final = len(TEMPLATE)  # bytes of one frame before compression


def log_times(frames: NDArray[np.int64], rate_hz: float) -> NDArray[np.uint64]:
    """Return simulation time of frames in ns, rounded to the nearest."""
    return np.rint(frames * 1e9 / rate_hz).astype(np.uint64)


def runs_of(times: NDArray[np.uint64], events: Sequence[tuple[int, int]]) -> list[Run]:
    """Return the runs of a chunk: rows at ``times`` [ns], then events, each with its time and its record's offset."""
    runs = [Run(1, times, _offsets(len(times)))] if len(times) else []
    if events:
        event_times, offsets = np.array(events, np.uint64).T
        runs.append(Run(EVENT_CHANNEL, event_times, offsets[None, :]))
    return runs


@lru_cache(maxsize=4)  # all chunks of a flight are of one length but the last
def _offsets(rows: int) -> NDArray[np.int64]:
    return np.add.outer(STARTS, ROW * np.arange(rows))
