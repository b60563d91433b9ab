"""Messages of an MCAP file from any writer, within limits of memory.

A file of a few hundred kilobytes can hold a chunk that expands to gigabytes.  The declared size of a record is checked
before memory is allocated, chunks are expanded one at a time, and the sum of all expanded sizes is limited.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import lz4.frame
import zstandard
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE
from mcap.records import Channel, Chunk, ChunkIndex, Footer, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from zlib_ng.zlib_ng import crc32

from rig.core.errors import BadLog
from rig.core.files import open_regular
from rig.log.container import MAGIC, RECORD_HEAD
from rig.log.decode import CHUNK_LIMIT

EXPANSION: Final = 100  # bytes of memory for a byte of a file, beyond the first CHUNK_LIMIT
RECORD_LIMIT: Final = CHUNK_LIMIT + (1 << 16)  # bytes of a record
MESSAGE_LIMIT: Final = 1 << 22  # bytes of a message that numbers are read from
_MESSAGE: Final = struct.Struct("<HIQQ")  # channel id, sequence, log time, publish time


def most_bytes(size: int) -> int:
    """Return bytes of memory that the contents of a compressed file of ``size`` bytes may take."""
    return CHUNK_LIMIT + EXPANSION * size


class LimitedFile(io.BufferedReader):
    """A file to read; it allocates no memory for bytes that a record declares and the file does not have."""

    def __init__(self, path: Path) -> None:
        """Open ``path``; BadLog."""
        super().__init__(open_regular(path, kind=BadLog).detach())
        self.path = path
        self.size = self.seek(0, io.SEEK_END)
        self.seek(0)

    def read(self, size: int | None = -1, /) -> bytes:
        """Read up to ``size`` bytes, all that are left when negative."""
        left = max(self.size - self.tell(), 0)
        return super().read(left if size is None or size < 0 else min(size, left))


class Budget:
    """Bytes that may still be expanded or collected from one file."""

    def __init__(self, file: LimitedFile) -> None:
        self._path = file.path
        self._most = self._left = most_bytes(file.size)

    def spend(self, count: int) -> None:
        """Take ``count`` bytes; BadLog when they are not left."""
        self._left -= count
        if self._left < 0:
            raise BadLog(f"{self._path}: expands to more than {self._most} bytes, the limit for a file of its size")


@dataclass(slots=True)
class Summary:
    """The entries of the summary section."""

    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)


class Raw(NamedTuple):
    """One message as it is in the file."""

    channel: int
    time_ns: int
    data: bytes


def summary(file: LimitedFile) -> Summary:
    """Return the summary of ``file``; BadLog when it has none; McapError, EOFError and their like for a damaged one."""
    if file.read(len(MAGIC)) != MAGIC:
        raise McapError("it does not begin as one")
    file.seek(-(FOOTER_SIZE + len(MAGIC)), io.SEEK_END)
    footer = next(_records(file))
    if not isinstance(footer, Footer):
        raise McapError("no footer at its end")
    if footer.summary_start == 0:
        raise BadLog(f"{file.path}: truncated or without a summary")
    file.seek(footer.summary_start)
    contents = Summary()
    for record in _records(file):
        if isinstance(record, Channel):
            contents.channels[record.id] = record
        elif isinstance(record, Schema):
            contents.schemas[record.id] = record
        elif isinstance(record, ChunkIndex):
            contents.chunks.append(record)
    return contents


def messages(file: LimitedFile, summary: Summary, wanted: Container[int], budget: Budget) -> Iterator[Raw]:
    """Yield the messages of the channels ``wanted``, in the order of the file.

    BadLog: a chunk or a message beyond the limits; ValueError, McapError and their like: a damaged one.
    """
    for record in _indexed(file, summary, wanted) if summary.chunks else _whole(file):
        if isinstance(record, Chunk):
            data = _content(file.path, record, budget)
            yield from _in_chunk(data, wanted, file.path)
        elif isinstance(record, Message) and record.channel_id in wanted:
            _check_size(file.path, len(record.data))
            yield Raw(record.channel_id, record.log_time, record.data)


def _records(file: LimitedFile) -> Iterator[McapRecord]:
    """Yield records from where ``file`` is, chunks as they are."""
    return StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=RECORD_LIMIT).records


def _whole(file: LimitedFile) -> Iterator[McapRecord]:
    file.seek(0)
    return StreamReader(file, emit_chunks=True, validate_crcs=True, record_size_limit=RECORD_LIMIT).records


def _indexed(file: LimitedFile, summary: Summary, wanted: Container[int]) -> Iterator[McapRecord]:
    """Yield the chunks that may have messages of the channels ``wanted``: all, where an index has no entries."""
    for index in sorted(summary.chunks, key=lambda index: index.chunk_start_offset):
        inside = index.message_index_offsets
        if inside and not any(channel in wanted for channel in inside):
            continue
        file.seek(index.chunk_start_offset)
        record = next(_records(file))
        if not isinstance(record, Chunk):
            raise McapError(f"no chunk at byte {index.chunk_start_offset}, where the index names one")
        yield record


def _content(path: Path, chunk: Chunk, budget: Budget) -> bytes:
    """Return the records of a chunk, expanded; never more bytes than it claims, which are checked first."""
    size = chunk.uncompressed_size
    if size > CHUNK_LIMIT:
        raise BadLog(f"{path}: a chunk declares {size} bytes; at most {CHUNK_LIMIT} are read")
    budget.spend(size)
    data = _expanded(chunk)
    if len(data) != size:
        raise ValueError(f"a chunk declares {size} bytes and has {len(data)}")
    if chunk.uncompressed_crc not in (0, crc32(data)):
        raise ValueError("the checksum of a chunk does not match")
    return data


def _expanded(chunk: Chunk) -> bytes:
    """Return at most one byte more than the chunk declares."""
    size = chunk.uncompressed_size
    if chunk.compression == "":
        return chunk.data
    if chunk.compression == "lz4":
        return lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    if chunk.compression == "zstd":
        content_size = zstandard.frame_content_size(chunk.data)  # -1 when it does not tell
        if content_size not in (-1, size):
            raise ValueError(f"a chunk declares {size} bytes and its contents {content_size}")
        return zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size) if size else b""
    raise ValueError(f"a chunk of unknown compression {chunk.compression[:20]!r}; known: zstd, lz4 and none")


def _in_chunk(data: bytes, wanted: Container[int], path: Path) -> Iterator[Raw]:
    at = 0
    while at < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        at += RECORD_HEAD.size
        if length > len(data) - at:
            raise ValueError("a record is longer than its chunk")
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE.size:
                raise ValueError("a message without a head")
            channel, _, time_ns, _ = _MESSAGE.unpack_from(data, at)
            if channel in wanted:
                _check_size(path, length)
                yield Raw(channel, time_ns, data[at + _MESSAGE.size : at + length])
        at += length


def _check_size(path: Path, size: int) -> None:
    if size > MESSAGE_LIMIT:
        raise BadLog(f"{path}: a message of {size} bytes; numbers are read from up to {MESSAGE_LIMIT}")
