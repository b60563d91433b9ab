"""MCAP files by hand, record by record, so that any field may lie."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Header, McapRecord, Message, Schema

MAGIC = b"\x89MCAP0\r\n"
CHANNEL = Channel(id=1, topic="/imu", message_encoding="json", metadata={}, schema_id=1)
SCHEMA = Schema(id=1, name="imu", encoding="jsonschema", data=b"{}")
RLE_BLOCK = 1 << 17  # bytes that four bytes of a zstd frame can say


def record(one: McapRecord) -> bytes:
    """One record as bytes."""
    builder = RecordBuilder()
    one.write(builder)
    return builder.end()


def message(k: int, body: bytes = b'{"x": 1}') -> Message:
    """Message ``k``, 10 ms after the one before."""
    return Message(1, 10_000_000 * k, body, 10_000_000 * k, k)


def chunk(data: bytes, size: int, compression: str = "", **more: Any) -> Chunk:
    """A chunk that claims ``size`` bytes; without a checksum."""
    return Chunk(compression, data, 10**9, 0, more.get("crc", 0), size)


def zeros(count: int, told: int | None = None, first: bytes = b"") -> bytes:
    """A zstd frame of ``first`` and ``count`` zero bytes (RFC 8878), which tells its size as ``told`` if given."""
    head = struct.pack("<IB", 0xFD2FB528, 0 if told is None else 0xC0) + b"\x70"  # a window of 16 MiB
    head += b"" if told is None else struct.pack("<Q", told)
    head += (len(first) << 3).to_bytes(3, "little") + first if first else b""  # a raw block
    sizes = [RLE_BLOCK] * (count // RLE_BLOCK) + ([count % RLE_BLOCK] if count % RLE_BLOCK else [])
    last = len(sizes) - 1
    return head + b"".join((n << 3 | 1 << 1 | (k == last)).to_bytes(3, "little") + b"\0" for k, n in enumerate(sizes))


def skipped(count: int) -> bytes:
    """The head of a record of ``count`` bytes that no reader knows."""
    return struct.pack("<BQ", 0x80, count)


def write(path: Path, chunks: list[Chunk], summary_at: int | None = None) -> None:
    """A file of ``chunks`` with their index; ``summary_at`` is where the footer says that the summary begins."""
    data = MAGIC + record(Header("", "")) + record(SCHEMA) + record(CHANNEL)
    index = b""
    for one in chunks:
        written = record(one)
        index += record(
            ChunkIndex(
                chunk_length=len(written),
                chunk_start_offset=len(data),
                compression=one.compression,
                compressed_size=len(one.data),
                message_end_time=10**9,
                message_index_length=0,
                message_index_offsets={},
                message_start_time=0,
                uncompressed_size=one.uncompressed_size,
            )
        )
        data += written
    data += record(DataEnd(0))
    start = len(data) if summary_at is None else summary_at
    path.write_bytes(data + record(SCHEMA) + record(CHANNEL) + index + record(Footer(start, 0, 0)) + MAGIC)
