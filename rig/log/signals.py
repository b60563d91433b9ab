"""Writes signals and discretes of any names as the log writes those of flight: rig.Signal and rig.Discrete messages.

The messages of one kind and row have the same constant bytes in every row; what changes has fixed places.  So a row
is a numpy record with the tags as fields of their own, and a chunk is a run of such rows of one kind.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.well_known import MessageEncoding, SchemaEncoding
from numpy.typing import NDArray
from zlib_ng.zlib_ng import crc32

from rig.log.container import COMPRESSION, LIBRARY, MAGIC, encode
from rig.log.record import HEAD, MESSAGE_OPCODE, WIRE
from rig.log.schema import DOUBLE, FIXED32, MESSAGES, SCHEMA_VERSION, Field, descriptors
from rig.log.writer import CHUNK_BYTES

ABOUT: Final = "rig.vote"  # name of the metadata record
_NUMPY: Final = {DOUBLE: "<f8", FIXED32: "<u4"}  # all other kinds are varints of one byte
_CHUNK_HEAD: Final = struct.Struct("<BQQQQII4sQ")
_FOOTER_HEAD: Final = struct.Struct("<BQQQ")
_ENTRY: Final = np.dtype([("time", "<u8"), ("offset", "<u8")])

# For each topic, fields of FRAME by name: an array (n,), or one (n,) for each channel.  What is left out is
# NaN or zero; what the message has no field for is left out.
Columns = Mapping[str, NDArray[Any] | Sequence[NDArray[Any]]]
Topics = Mapping[str, tuple[str, Columns]]  # topic: message, columns


def write_topics(path: Path, times_ns: NDArray[np.uint64], topics: Topics, about: Mapping[str, str]) -> None:
    """Write an MCAP file with one message a row and topic; ``about`` becomes its metadata.

    ``times_ns`` (n,), not falling.  OSError when the disk does not take it.
    """
    messages = dict.fromkeys(message for message, _ in topics.values())
    groups = [_Group(i, message, topics) for i, message in enumerate(messages, 1)]
    first = 1
    for group in groups:
        group.first, first = first, first + len(group.columns)
    with path.open("wb") as file:
        writer = _Writer(file, groups)
        writer.metadata({**about, "schema_version": str(SCHEMA_VERSION)})
        room = max(1, CHUNK_BYTES // max(group.row_bytes for group in groups))
        rows = [group.template(room) for group in groups]
        for start in range(0, len(times_ns), room):
            part = slice(start, start + room)
            times = times_ns[part]
            for group, some in zip(groups, rows, strict=True):
                group.fill(some[: len(times)], start, times, part)
                writer.chunk(group, some[: len(times)], times)
        writer.finish()


def _tag(field: Field, number: int) -> bytes:
    key = number << 3 | WIRE.get(field.kind, 0)
    return bytes([key]) if key < 128 else bytes([key & 127 | 128, key >> 7])


def _record(message: str) -> np.dtype[Any]:
    """One message record: head, then each field's tag and value."""
    parts: list[tuple[str, str]] = [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
    for number, field in enumerate(MESSAGES[message].fields, 1):
        parts += [(f"tag {field.name}", f"V{len(_tag(field, number))}"), (field.name, _NUMPY.get(field.kind, "u1"))]
    return np.dtype(parts)


class _Group:
    """The topics of one kind of message; their channels have ids from ``first`` on."""

    def __init__(self, schema: int, message: str, topics: Topics) -> None:
        self.schema, self.message, self.first = schema, message, 1
        self.columns = {topic: columns for topic, (kind, columns) in topics.items() if kind == message}
        self.fields = MESSAGES[message].fields
        self.record = _record(message)
        self.row_bytes = len(self.columns) * self.record.itemsize

    @property
    def ids(self) -> NDArray[np.int64]:
        """The ids of its channels."""
        return np.arange(self.first, self.first + len(self.columns))

    def template(self, rows: int) -> NDArray[Any]:
        """Rows (rows, topics) of ``record`` with all that is constant."""
        made = np.zeros((rows, len(self.columns)), self.record)
        made["opcode"] = MESSAGE_OPCODE
        made["length"] = self.record.itemsize - (HEAD.size - struct.calcsize("<HIQQ"))
        made["channel"] = self.ids
        for number, field in enumerate(self.fields, 1):
            made[f"tag {field.name}"] = np.void(_tag(field, number))
            if field.kind == DOUBLE:
                made[field.name] = np.nan
        return made

    def fill(self, rows: NDArray[Any], first: int, times: NDArray[np.uint64], part: slice) -> None:
        """Put the columns' rows ``part`` into ``rows``."""
        rows["sequence"] = np.arange(first, first + len(rows))[:, None]
        rows["log_time"] = rows["publish_time"] = times[:, None]
        for s, columns in enumerate(self.columns.values()):
            for field in self.fields:
                given = columns.get(field.source)
                if given is None:
                    continue
                if not field.index:
                    rows[field.name][:, s] = given[part]
                elif field.index[0] < len(given):
                    rows[field.name][:, s] = given[field.index[0]][part]


class _Writer:
    """The file around the chunks: header, descriptions, indexes, summary."""

    def __init__(self, file: BinaryIO, groups: list[_Group]) -> None:
        self._file = file
        self._offset = 0
        self._crc = 0
        self._groups = groups
        self._count = sum(len(group.columns) for group in groups)
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._rows = 0
        self._compressor = zstandard.ZstdCompressor(level=1)
        self._schemas = b"".join(encode(_schema(group)) for group in groups)
        self._channels = b"".join(
            encode(Channel(int(i), topic, MessageEncoding.Protobuf, {}, group.schema))
            for group in groups
            for i, topic in zip(group.ids, group.columns, strict=True)
        )
        self._put(MAGIC, encode(Header("", LIBRARY)), self._schemas, self._channels)

    def metadata(self, values: Mapping[str, str]) -> None:
        """Append a metadata record."""
        record = encode(Metadata(ABOUT, dict(values)))
        self._metadata.append(MetadataIndex(self._offset, len(record), ABOUT))
        self._put(record)

    def chunk(self, group: _Group, rows: NDArray[Any], times: NDArray[np.uint64]) -> None:
        """Append rows of one kind as a chunk, with an index of the messages of each channel."""
        raw: Any = rows.view(np.uint8).reshape(-1)
        data = self._compressor.compress(raw)
        start, end, size = int(times[0]), int(times[-1]), len(raw)
        length = _CHUNK_HEAD.size + len(data)
        head = _CHUNK_HEAD.pack(
            Opcode.CHUNK, length - 9, start, end, size, crc32(raw), 4, COMPRESSION.encode(), len(data)
        )
        at = self._offset
        indexes = _message_indexes(group, len(rows), times)
        self._put(head, data, indexes)
        step = indexes.itemsize
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=at,
                compression=COMPRESSION,
                compressed_size=len(data),
                message_end_time=end,
                message_index_length=step * len(group.columns),
                message_index_offsets={int(c): at + length + i * step for i, c in enumerate(group.ids)},
                message_start_time=start,
                uncompressed_size=size,
            )
        )
        if group is self._groups[0]:
            self._rows += len(rows)

    def finish(self) -> None:
        """Write the summary and the footer."""
        self._put(encode(DataEnd(self._crc)))
        summary, self._crc = self._offset, 0
        offsets: list[bytes] = []
        for opcode, group in (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, encode(self._statistics())),
            (Opcode.CHUNK_INDEX, b"".join(map(encode, self._chunks))),
            (Opcode.METADATA_INDEX, b"".join(map(encode, self._metadata))),
        ):
            offsets.append(encode(SummaryOffset(opcode, self._offset, len(group))))
            self._put(group)
        start = self._offset
        self._put(*offsets)
        crc = crc32(_FOOTER_HEAD.pack(Opcode.FOOTER, 20, summary, start), self._crc)
        self._put(encode(Footer(summary, start, crc)), MAGIC)

    def _put(self, *parts: Any) -> None:
        for part in parts:
            data = memoryview(part).cast("B")
            self._crc = crc32(data, self._crc)
            self._offset += len(data)
            self._file.write(data)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=self._count,
            channel_message_counts=dict.fromkeys(range(1, self._count + 1), self._rows),
            chunk_count=len(self._chunks),
            message_count=self._rows * self._count,
            message_start_time=self._chunks[0].message_start_time if self._chunks else 0,
            message_end_time=self._chunks[-1].message_end_time if self._chunks else 0,
            metadata_count=len(self._metadata),
            schema_count=len(self._groups),
        )


def _schema(group: _Group) -> Schema:
    return Schema(group.schema, descriptors(group.message).SerializeToString(), SchemaEncoding.Protobuf, group.message)


def _message_indexes(group: _Group, rows: int, times: NDArray[np.uint64]) -> NDArray[Any]:
    count = len(group.columns)
    made = np.zeros(
        count,
        [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("bytes", "<u4"), ("entries", _ENTRY, (rows,))],
    )
    made["opcode"] = Opcode.MESSAGE_INDEX
    made["bytes"] = _ENTRY.itemsize * rows
    made["length"] = 6 + made["bytes"]
    made["channel"] = group.ids
    made["entries"]["time"] = times
    offsets = np.add.outer(np.arange(count) * group.record.itemsize, np.arange(rows) * group.row_bytes)
    made["entries"]["offset"] = offsets
    return made
