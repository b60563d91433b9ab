"""Map every byte of a chunk to frames; packing.py maps frames to bytes.

All fields of the messages are written, doubles and small integers have a fixed width, and the varints of time stamps
are padded to one: so the records of a topic always have the same length and the same constant bytes (opcode, length,
channel id, protobuf tags), its template.  Variable bytes are moved between the frame and the template by tables of byte
offsets.  A chunk has the records of one topic after those of another: where neighbours are alike, it compresses better.

    FRAMES, n records of each topic | POSES, every POSE_EVERY-th of them | PARTS, n, where there are any | events

Up to schema 4 it had a row of all topics for every frame, poses too, then the events.

No kernels here: a log is read before they would be loaded.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from itertools import accumulate, pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import (
    CHANNELS,
    COMPUTER_FIELDS,
    FLAT,
    ROW_PARTS,
    SERVO_FIELDS,
    TIMING,
    Block,
    Ilm,
    RowPart,
    RowParts,
    State,
    second_rows,
)
from rig.core.frame.fields import FIELD, FIELDS
from rig.core.frame.fields import Field as FrameField
from rig.log.container import Run, message_indexes
from rig.log.records import Value, record, size_of
from rig.log.schema import (
    ALL_TOPICS,
    EVENT_CHANNEL,
    FRAME_TOPICS,
    MESSAGES,
    PART_MESSAGES,
    PART_TOPICS,
    POSE_EVERY,
    POSE_TOPICS,
    Field,
    Topic,
)

Messages = Mapping[str, Sequence[Field]]
Moves = tuple[NDArray[np.uint64], NDArray[np.uint64]]  # of eight bytes, of one byte


class Table:
    """Records of topics that have theirs at the same frames; a row is one of each.

    In a chunk each topic's records stand together, or, if ``rowwise``, the records of each row.
    template : a row but for its values
    """

    def __init__(self, topics: Sequence[Topic], messages: Messages, *, rowwise: bool = False) -> None:
        self._first = ALL_TOPICS.index(topics[0]) + 1
        records = [record(topic, messages.get(topic.message, ())) for topic in topics]
        ends = list(accumulate(map(size_of, records)))
        self._starts = np.array([0, *ends[:-1]])
        # What repeats in a chunk: its begin in a row and its size.
        self._blocks = [(0, ends[-1])] if rowwise else [(a, b - a) for a, b in pairwise([0, *ends])]
        self._block_of = np.array(self._blocks * (len(topics) if rowwise else 1))
        template = bytearray()
        moved: dict[tuple[str, int], list[tuple[int, int, int]]] = defaultdict(list)
        for number, piece in ((i, piece) for i, pieces in enumerate(records) for piece in pieces):
            if isinstance(piece, Value):
                width = 8 if piece.width == 8 else 1
                steps = range(0, piece.width, width)
                moved[piece.source, width] += [(piece.offset + i, len(template) + i, number) for i in steps]
            template += bytes(piece.room) if isinstance(piece, Value) else piece
        self._moved = moved
        self.template = np.frombuffer(bytes(template), np.uint8)
        self._openings = np.add.outer(self._starts, np.arange(_OPENING))

    @property
    def topics(self) -> list[tuple[int, int, int]]:
        """Return of each topic the number of its channel, and where its record begins and ends in a row."""
        ends = [*self._starts[1:].tolist(), len(self.template)]
        places = zip(self._starts.tolist(), ends, strict=True)
        return [(self._first + i, start, end) for i, (start, end) in enumerate(places)]

    @property
    def constant(self) -> NDArray[np.bool_]:
        """Return which bytes of a row are the same in every row."""
        made = np.ones(len(self.template), np.bool_)
        for (_, width), moved in self._moved.items():
            for _, at, _ in moved:
                made[at : at + width] = False
        return made

    def places(self, source: str, width: int) -> NDArray[np.intp]:
        """Return (k, 3) of the values of ``width`` 8 or 1 bytes: place in ``source``, in a row, number of the topic."""
        return np.array(self._moved[source, width], np.intp).reshape(-1, 3)

    def moves(self, source: str, rows: int) -> Moves:
        """Return (k, 3) of each width: place in ``source``, in ``rows`` rows, bytes from there to the next row's."""
        words, octets = (self._moves(self.places(source, width), rows) for width in (8, 1))
        return words, octets

    def _moves(self, places: NDArray[np.intp], rows: int) -> NDArray[np.uint64]:
        start, size = self._block_of[places[:, 2]].T
        return np.stack([places[:, 0], start * (rows - 1) + places[:, 1], size], axis=1).astype(np.uint64)

    def indexes(self, rows: int, begin: int = 0) -> NDArray[Any]:
        """Return the message indexes of ``rows`` rows, which begin at byte ``begin`` of the chunk."""
        start, size = self._block_of.T
        firsts = begin + self._starts + start * (rows - 1)
        return message_indexes(self._first, firsts[:, None] + np.multiply.outer(size, np.arange(rows)))

    def blank(self, rows: int) -> NDArray[np.uint8]:
        """Return the bytes of ``rows`` rows but for their values."""
        return np.concatenate([np.tile(self.template[start : start + size], rows) for start, size in self._blocks])

    def count(self, data: NDArray[np.uint8]) -> int:
        """Return how many rows are at the beginning of a chunk."""
        [_, size] = self._blocks[0]
        whole = len(data) // size
        heads = data[: whole * size].reshape(whole, size)[:, :_OPENING]
        ours = (heads == self.template[:_OPENING]).all(axis=1)
        return whole if ours.all() else int(ours.argmin())

    def rows(self, data: NDArray[np.uint8], rows: int) -> NDArray[np.uint8]:
        """Return the first ``rows`` rows of ``data`` as (rows, row); raise ValueError if they are not the rig's."""
        packed = np.empty((rows, len(self.template)), np.uint8)
        for start, size in self._blocks:
            packed[:, start : start + size] = data[start * rows : (start + size) * rows].reshape(rows, size)
        if (packed[:, self._openings] != self.template[self._openings]).any():
            raise ValueError("not a chunk that the rig writes")
        return packed


class Decoded(NamedTuple):
    """The contents of a chunk except its events."""

    rows: Block  # FLAT
    timing: NDArray[np.void]
    beside: Block | None
    runs: list[Run]
    size: int  # bytes


class Layout:
    """Layout of the frames of a log, for the fields of each message, in the order of their numbers.

    rowwise : as up to schema 4, poses at every frame
    parts : of the second row, those that it has
    absent : numbers of FLAT that the messages do not have, field and index
    """

    def __init__(self, messages: Messages, *, rowwise: bool = False, parts: RowParts = ()) -> None:
        self._rowwise, self._parts = rowwise, parts
        self.table = Table((*FRAME_TOPICS, *POSE_TOPICS) if rowwise else FRAME_TOPICS, messages, rowwise=rowwise)
        self.absent = [
            (field.source, field.index)
            for name, fields in MESSAGES.items()
            for field in fields
            if field not in messages[name] and field.source in FIELD
        ]
        self._of_frame, self._of_timing = _origins(self.table, "frame", FLAT), _origins(self.table, "timing", TIMING)
        self._known = _Known.of(self.table, "frame", FLAT)

    def read(self, data: NDArray[np.uint8]) -> Decoded:
        """Return the contents of a chunk, bit for bit as ``packing.pack`` got them; ValueError: not the rig's chunk."""
        packed = self.table.rows(data, self.table.count(data))
        rows, timing = self.frames(packed)
        times = packed[:, _TIME].copy().view(np.uint64)[:, 0]
        if self._rowwise or not len(times):
            runs = [Run(times, self.table.indexes(len(times)))] if len(times) else []
            return Decoded(rows, timing, second_rows(0, self._parts) if self._parts else None, runs, packed.nbytes)
        size = packed.nbytes + POSES.rows(data[packed.nbytes :], len(times[::POSE_EVERY])).nbytes
        parts: dict[RowPart, NDArray[np.uint8]] = {}
        for part in self._parts:
            parts[part] = PARTS[part].rows(data[size:], len(times))
            size += parts[part].nbytes
        beside = self.beside(rows, parts)
        return Decoded(rows, timing, beside, frame_runs(times, self._parts), size)

    def frames(self, packed: NDArray[np.uint8]) -> tuple[Block, NDArray[np.void]]:
        """Return FLAT and TIMING of rows of the table; ValueError: a value that has no name."""
        self._known.require(packed)
        rows, timing = _gathered(packed, self._of_frame, FLAT), _gathered(packed, self._of_timing, TIMING)
        if self.absent:
            self._fill(rows)
        return rows, timing

    def beside(self, rows: Block, parts: Mapping[RowPart, NDArray[np.uint8]]) -> Block | None:
        """Return the second rows of the records of its parts, beside ``rows``; ValueError as ``frames``."""
        if not self._parts:
            return None
        beside = second_rows(len(rows), self._parts)
        beside["frame"] = rows["frame"]
        for part in self._parts:
            kind = ROW_PARTS[part]
            _known_of(part).require(parts[part])
            beside[part] = _gathered(parts[part], _origins(PARTS[part], part, kind), kind)
        return beside

    def _fill(self, rows: Block) -> None:
        """Give ``rows`` what an older log does not say: no number; a discrete whose channels are valid, unmonitored."""
        for name, index in self.absent:
            fill = np.nan if FIELD[name].kind == "number" else 0
            if name == "discrete_ilm":
                fill = Ilm.ABSENT
            rows[name][(..., *index)] = fill
        if ("discrete_valid", (0,)) in self.absent:
            rows["discrete_valid"] = rows["discrete_state"] != State.ABSENT


_OPENING: Final = 11  # bytes: opcode, length and channel of a record
_TIME: Final = slice(15, 23)  # the time of a row's first record
_ZERO: Final = 8  # the last byte of its length


class _Known(NamedTuple):
    """The bytes of a row that have a greatest value, (k,): codes of an enum, flags, counts of channels."""

    at: NDArray[np.intp]
    most: NDArray[np.uint8]
    names: list[str]

    @classmethod
    def of(cls, table: Table, source: str, dtype: np.dtype[Any]) -> _Known:
        """Find the values among those of ``source``, records of ``dtype``."""
        greatest = {field.name: _greatest(field) for field in _FIELDS[source]}
        named: dict[int, str] = {}  # by byte of a record
        for name, (kind, offset, *_) in (dtype.base.fields or {}).items():
            if greatest.get(name) is not None:
                named |= dict.fromkeys(range(offset, offset + kind.itemsize), name)
        found = [(at, named.get(place % dtype.base.itemsize)) for place, at, _ in table.places(source, 1).tolist()]
        kept = [(at, name) for at, name in found if name is not None]
        most = [greatest[name] for _, name in kept]
        return cls(np.array([at for at, _ in kept], np.intp), np.array(most, np.uint8), [name for _, name in kept])

    def require(self, packed: NDArray[np.uint8]) -> None:
        """Raise ValueError if a row of ``packed`` has a greater value, for which a reader has no name."""
        beyond = packed[:, self.at] > self.most
        if beyond.any():
            row, place = (int(i) for i in np.argwhere(beyond)[0])
            value = packed[row, self.at[place]]
            raise ValueError(f"{self.names[place]} is {value} in a frame, allowed: at most {self.most[place]}")


def _greatest(field: FrameField) -> int | None:
    if field.enum is not None:
        return int(max(field.enum))
    return 1 if field.kind == "flag" else _COUNTS.get(field.name)


_COUNTS: Final = {
    **dict.fromkeys(("level", "discrete_level"), CHANNELS),
    **dict.fromkeys(("reset", "discrete_reset"), (1 << CHANNELS) - 1),
}
_FIELDS: Final = {"frame": FIELDS, "servo": SERVO_FIELDS, "computer": COMPUTER_FIELDS}


@cache
def _known_of(part: RowPart) -> _Known:
    return _Known.of(PARTS[part], part, ROW_PARTS[part])


def _origins(table: Table, source: str, dtype: np.dtype[Any]) -> NDArray[np.intp]:
    """Return for every byte of a record of ``dtype`` its place in a row; what has none comes from a zero."""
    origins = np.full(dtype.itemsize, _ZERO, np.intp)
    for width in (8, 1):
        place, at, _ = table.places(source, width).T
        for i in range(width):
            origins[place + i] = at + i
    return origins


def _gathered(packed: NDArray[np.uint8], origins: NDArray[np.intp], dtype: np.dtype[Any]) -> NDArray[np.void]:
    rows = np.empty(len(packed), dtype)
    to = rows.reshape(-1).view(np.uint8).reshape(len(packed), dtype.itemsize)
    np.take(packed, origins, axis=1, out=to, mode="clip")  # "raise" would copy; the interpreter is free meanwhile
    return rows


LAYOUT: Final = Layout(MESSAGES)  # of what we write
FRAMES: Final = LAYOUT.table
POSES: Final = Table(POSE_TOPICS, {})
ROW: Final = len(FRAMES.template) + len(POSES.template)  # the most bytes of a frame before compression
PARTS: Final[dict[RowPart, Table]] = {part: Table(topics, PART_MESSAGES) for part, topics in PART_TOPICS.items()}


@cache
def layout_of(parts: RowParts) -> Layout:
    """Return the layout that the rig writes, with these parts of the second row."""
    return Layout(MESSAGES, parts=parts) if parts else LAYOUT


def row_bytes(parts: RowParts) -> int:
    """Return the most bytes of a frame before compression, with these parts of the second row."""
    return ROW + sum(len(PARTS[part].template) for part in parts)


def log_times(frames: NDArray[np.int64], rate_hz: float) -> NDArray[np.uint64]:
    """Return simulation time of frames in ns, rounded to the nearest."""
    return np.rint(frames * 1e9 / rate_hz).astype(np.uint64)


def frame_runs(times: NDArray[np.uint64], parts: RowParts = ()) -> list[Run]:
    """Return the runs of a chunk of frames at ``times`` (n,), ns, with these parts of the second row."""
    if not len(times):
        return []
    frames, poses, *of_parts = _indexes(len(times), parts)
    beside = [Run(times, np.concatenate(of_parts))] if parts else []  # the topics of all parts are neighbours
    return [Run(times, frames), Run(times[::POSE_EVERY], poses), *beside]


@lru_cache(maxsize=4)  # all chunks of a flight are of one length but the last
def _indexes(frames: int, parts: RowParts) -> list[NDArray[Any]]:
    poses, begin = len(range(0, frames, POSE_EVERY)), frames * len(FRAMES.template)
    found, behind = [FRAMES.indexes(frames), POSES.indexes(poses, begin)], begin + poses * len(POSES.template)
    for part in parts:
        found.append(PARTS[part].indexes(frames, behind))
        behind += frames * len(PARTS[part].template)
    return found


def event_runs(events: Sequence[tuple[int, int]]) -> list[Run]:
    """Return the run of events, each with its time and its record's offset in the chunk; none without events."""
    times, offsets = np.array(events, np.int64).reshape(-1, 2).T
    return [Run(times.astype(np.uint64), message_indexes(EVENT_CHANNEL, offsets[None, :]))] if events else []
