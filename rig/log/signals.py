"""Writes signals of any names as the log writes those of flight: rig.Signal messages on ``/signal/<name>``.

The messages of one row have the same constant bytes in every row; what changes has fixed places.  So a row is
a numpy record with the tags as fields of their own, and a chunk is a run of such rows.
"""

from __future__ import annotations

import struct
import zlib
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

from rig.log.container import COMPRESSION, LIBRARY, MAGIC, encode
from rig.log.record import HEAD, MESSAGE_OPCODE, WIRE
from rig.log.schema import DOUBLE, FIXED32, MESSAGES, SCHEMA_VERSION, Field, descriptors
from rig.log.writer import CHUNK_BYTES

MESSAGE: Final = "rig.Signal"
ABOUT: Final = "rig.vote"  # name of the metadata record
_NUMPY: Final = {DOUBLE: "<f8", FIXED32: "<u4"}  # all other kinds are varints of one byte
_CHUNK_HEAD: Final = struct.Struct("<BQQQQII4sQ")
_FOOTER_HEAD: Final = struct.Struct("<BQQQ")
_ENTRY: Final = np.dtype([("time", "<u8"), ("offset", "<u8")])

# For each signal, fields of FRAME by name: an array (n,), or one (n,) for each channel.  What is left out is
# NaN or zero.
Columns = Mapping[str, NDArray[Any] | Sequence[NDArray[Any]]]


def write_signals(
    path: Path, times_ns: NDArray[np.uint64], signals: Mapping[str, Columns], about: Mapping[str, str]
) -> None:
    """Write an MCAP file with one message a row and signal; ``about`` becomes its metadata.

    ``times_ns`` (n,), not falling.  OSError when the disk does not take it.
    """
    with path.open("wb") as file:
        writer = _Writer(file, list(signals))
        writer.metadata({**about, "schema_version": str(SCHEMA_VERSION)})
        rows = _template(len(signals), max(1, CHUNK_BYTES // (len(signals) * _RECORD.itemsize)))
        for start in range(0, len(times_ns), len(rows)):
            part = slice(start, start + len(rows))
            times = times_ns[part]
            _fill(rows[: len(times)], start, times, signals, part)
            writer.chunk(rows[: len(times)], times)
        writer.finish()


def _tag(field: Field, number: int) -> bytes:
    key = number << 3 | WIRE.get(field.kind, 0)
    return bytes([key]) if key < 128 else bytes([key & 127 | 128, key >> 7])


def _record() -> np.dtype[Any]:
    """One message record: head, then each field's tag and value."""
    parts: list[tuple[str, str]] = [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
    for number, field in enumerate(MESSAGES[MESSAGE].fields, 1):
        parts += [(f"tag {field.name}", f"V{len(_tag(field, number))}"), (field.name, _NUMPY.get(field.kind, "u1"))]
    return np.dtype(parts)


_RECORD: Final = _record()


def _template(signals: int, rows: int) -> NDArray[Any]:
    """Rows (rows, signals) of _RECORD with all that is constant."""
    made = np.zeros((rows, signals), _RECORD)
    made["opcode"] = MESSAGE_OPCODE
    made["length"] = _RECORD.itemsize - (HEAD.size - struct.calcsize("<HIQQ"))
    made["channel"] = np.arange(1, signals + 1)
    for number, field in enumerate(MESSAGES[MESSAGE].fields, 1):
        made[f"tag {field.name}"] = np.void(_tag(field, number))
        if field.kind == DOUBLE:
            made[field.name] = np.nan
    return made


def _fill(
    rows: NDArray[Any], first: int, times: NDArray[np.uint64], signals: Mapping[str, Columns], part: slice
) -> None:
    rows["sequence"] = np.arange(first, first + len(rows))[:, None]
    rows["log_time"] = rows["publish_time"] = times[:, None]
    for s, columns in enumerate(signals.values()):
        for field in MESSAGES[MESSAGE].fields:
            given = columns.get(field.source)
            if given is None:
                continue
            if not field.index:
                rows[field.name][:, s] = given[part]
            elif field.index[0] < len(given):
                rows[field.name][:, s] = given[field.index[0]][part]


class _Writer:
    """The file around the chunks: header, descriptions, indexes, summary."""

    def __init__(self, file: BinaryIO, names: list[str]) -> None:
        self._file = file
        self._offset = 0
        self._crc = 0
        self._count = len(names)
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._rows = 0
        self._compressor = zstandard.ZstdCompressor(level=1)
        schema = Schema(1, descriptors(MESSAGE).SerializeToString(), SchemaEncoding.Protobuf, MESSAGE)
        self._schemas = encode(schema)
        self._channels = b"".join(
            encode(Channel(i, f"/signal/{name}", MessageEncoding.Protobuf, {}, 1)) for i, name in enumerate(names, 1)
        )
        self._put(MAGIC, encode(Header("", LIBRARY)), self._schemas, self._channels)

    def metadata(self, values: Mapping[str, str]) -> None:
        """Append a metadata record."""
        record = encode(Metadata(ABOUT, dict(values)))
        self._metadata.append(MetadataIndex(self._offset, len(record), ABOUT))
        self._put(record)

    def chunk(self, rows: NDArray[Any], times: NDArray[np.uint64]) -> None:
        """Append rows as a chunk, with an index of the messages of each channel."""
        raw: Any = rows.view(np.uint8).reshape(-1)
        data = self._compressor.compress(raw)
        start, end, size = int(times[0]), int(times[-1]), len(raw)
        length = _CHUNK_HEAD.size + len(data)
        head = _CHUNK_HEAD.pack(
            Opcode.CHUNK, length - 9, start, end, size, zlib.crc32(raw), 4, COMPRESSION.encode(), len(data)
        )
        at = self._offset
        indexes = self._message_indexes(len(rows), times)
        self._put(head, data, indexes)
        step = indexes.itemsize
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=at,
                compression=COMPRESSION,
                compressed_size=len(data),
                message_end_time=end,
                message_index_length=step * self._count,
                message_index_offsets={i + 1: at + length + i * step for i in range(self._count)},
                message_start_time=start,
                uncompressed_size=size,
            )
        )
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
        crc = zlib.crc32(_FOOTER_HEAD.pack(Opcode.FOOTER, 20, summary, start), self._crc)
        self._put(encode(Footer(summary, start, crc)), MAGIC)

    def _put(self, *parts: Any) -> None:
        for part in parts:
            data = memoryview(part).cast("B")
            self._crc = zlib.crc32(data, self._crc)
            self._offset += len(data)
            self._file.write(data)

    def _message_indexes(self, rows: int, times: NDArray[np.uint64]) -> NDArray[Any]:
        made = np.zeros(
            self._count,
            [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("bytes", "<u4"), ("entries", _ENTRY, (rows,))],
        )
        made["opcode"] = Opcode.MESSAGE_INDEX
        made["bytes"] = _ENTRY.itemsize * rows
        made["length"] = 6 + made["bytes"]
        made["channel"] = np.arange(1, self._count + 1)
        made["entries"]["time"] = times
        row = self._count * _RECORD.itemsize
        made["entries"]["offset"] = np.add.outer(np.arange(self._count) * _RECORD.itemsize, np.arange(rows) * row)
        return made

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
            schema_count=1,
        )
