"""Records and chunks of an MCAP file from any writer, within limits of memory.

A file of a few hundred kilobytes can hold a chunk that expands to gigabytes.  The declared size of a record is checked
before memory is allocated, chunks are expanded one at a time, and the sum of all expanded sizes is limited.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Final, NamedTuple

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from zlib_ng.zlib_ng import crc32

from rig.core.errors import BadLog
from rig.core.files import open_regular
from rig.log.container import MAGIC, RECORD_HEAD
from rig.log.decode import CHUNK_LIMIT, MALFORMED

EXPANSION: Final = 100  # bytes of memory for a byte of a file, beyond the first CHUNK_LIMIT
RECORD_LIMIT: Final = CHUNK_LIMIT + (1 << 16)  # bytes of a record
MESSAGE_LIMIT: Final = 1 << 22  # bytes of a message that numbers are read from
PART: Final = 1 << 20  # bytes that are read at once
BROKEN: Final = (  # raised by records that make no sense
    *MALFORMED,
    EOFError,
    OverflowError,  # of a place beyond what a file can have
    RuntimeError,  # of the lz4 library
)
_CHUNK_HEAD: Final = struct.Struct("<QQQII")  # first and last time, size, checksum, length of the compression's name
MESSAGE_HEAD: Final = struct.Struct("<HIQQ")  # channel id, sequence, log time, publish time


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


class Record(NamedTuple):
    """The place of a record in a file."""

    opcode: int
    at: int  # of its first byte
    length: int  # of its contents

    @property
    def begin(self) -> int:
        """The place of its contents."""
        return self.at + RECORD_HEAD.size

    @property
    def after(self) -> int:
        """The place behind it."""
        return self.begin + self.length


class Broken(McapError):
    """No whole record begins at byte ``at``."""

    def __init__(self, at: int) -> None:
        super().__init__(f"no record at byte {at}")
        self.at = at


def walk(file: LimitedFile, start: int = len(MAGIC)) -> Iterator[Record]:
    """Yield the place of every record from byte ``start`` to the footer, unknown ones too; Broken: the chain breaks."""
    at = start
    while True:
        file.seek(at)
        head = file.read(RECORD_HEAD.size)
        if len(head) < RECORD_HEAD.size:
            raise Broken(at)
        record = Record(head[0], at, RECORD_HEAD.unpack(head)[1])
        if record.opcode == 0 or record.after > file.size:
            raise Broken(at)
        yield record
        if record.opcode == Opcode.FOOTER:
            return
        at = record.after


def contents_of(file: LimitedFile, record: Record) -> bytes:
    """Return the bytes of a record; McapError: too many."""
    if record.length > RECORD_LIMIT:
        raise McapError(f"a record of {record.length} bytes at byte {record.at}")
    file.seek(record.begin)
    return file.read(record.length)


def chunk_records(file: LimitedFile, record: Record, budget: Budget, cut: bool = False) -> bytes:
    """Return the records of a chunk, expanded; never more bytes than it claims, which are checked first.

    cut : the file ends within the chunk; what its beginning gives
    """
    content = contents_of(file, record)
    head = _CHUNK_HEAD.unpack_from(content)
    begin = _CHUNK_HEAD.size + head[4] + 8
    if cut:  # the declared number of its bytes is more than there are
        content = content[: begin - 8] + max(len(content) - begin, 0).to_bytes(8, "little") + content[begin:]
    chunk = Chunk.read(ReadDataStream(io.BytesIO(content)))
    size = chunk.uncompressed_size
    if size > CHUNK_LIMIT:
        raise BadLog(f"{file.path}: a chunk declares {size} bytes; at most {CHUNK_LIMIT} are read")
    budget.spend(size)
    data = _begun(chunk) if cut else _expanded(chunk)
    if cut:
        return data
    if len(data) != size:
        raise ValueError(f"a chunk declares {size} bytes and has {len(data)}")
    if chunk.uncompressed_crc not in (0, crc32(data)):
        raise ValueError("the checksum of a chunk does not match")
    return data


def _begun(chunk: Chunk) -> bytes:
    """Return what the beginning of a compressed chunk gives, up to its last whole record."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
            parts = bytearray()
            while len(parts) < size and (part := reader.read1(min(PART, size - len(parts)))):
                parts += part
    else:
        parts = bytearray(_expanded(chunk))
    at = 0
    while at + RECORD_HEAD.size <= len(parts):
        after = at + RECORD_HEAD.size + RECORD_HEAD.unpack_from(parts, at)[1]
        if after > len(parts):
            break
        at = after
    return bytes(parts[:at])


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


def inside(data: bytes) -> Iterator[tuple[int, int, int, bytes]]:
    """Yield opcode, begin and end of the records in a chunk, and the chunk.  ValueError: one is longer than that."""
    at = 0
    while at < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, at)
        at += RECORD_HEAD.size
        if length > len(data) - at:
            raise ValueError("a record is longer than its chunk")
        yield opcode, at, at + length, data
        at += length


class Raw(NamedTuple):
    """One message as it is in the file."""

    channel: int
    time_ns: int
    data: bytes


def in_chunk(data: bytes, wanted: Container[int], path: Path) -> Iterator[Raw]:
    """Yield the messages of the channels ``wanted`` in the records of a chunk."""
    for opcode, begin, end, _ in inside(data):
        if opcode == Opcode.MESSAGE and (found := message(data, begin, end, wanted, path)) is not None:
            yield found


def message(data: bytes, begin: int, end: int, wanted: Container[int], path: Path) -> Raw | None:
    """Return the message that stands from ``begin`` to ``end``; None: it is of none of the channels ``wanted``."""
    if end - begin < MESSAGE_HEAD.size:
        raise ValueError("a message without a head")
    channel, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data, begin)
    if channel not in wanted:
        return None
    if end - begin > MESSAGE_LIMIT:
        raise BadLog(f"{path}: a message of {end - begin} bytes; numbers are read from up to {MESSAGE_LIMIT}")
    return Raw(channel, time_ns, data[begin + MESSAGE_HEAD.size : end])
