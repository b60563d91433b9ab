"""The MCAP file being written: records in order, their indexes, and the summary that closes it.

    magic  Header  Schema...  Channel...  Metadata...  Attachment...
    ( Chunk  MessageIndex... ) for each second of flight
    Metadata...  DataEnd  Summary  Footer  magic

Every byte before DataEnd counts in its CRC, every byte after it in the footer's.  The summary's data
of a chunk are kept, some 400 bytes: 1.4 MB for an hour of flight at one chunk a second.
"""

from __future__ import annotations

import os
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray
from zlib_ng.zlib_ng import crc32

from rig.core.frame import copied

MAGIC: Final = b"\x89MCAP0\r\n"
LIBRARY: Final = "jsbsim-rig"
COMPRESSION: Final = "zstd"
RECORD_HEAD: Final = struct.Struct("<BQ")  # opcode, length
_CHUNK_HEAD: Final = struct.Struct("<BQQQQII4sQ")
_FOOTER_HEAD: Final = struct.Struct("<BQQQ")
_INDEX_HEAD: Final = struct.Struct("<BQQQQQI")  # of a chunk index, up to its message index offsets
_INDEX_TAIL: Final = struct.Struct("<QI4sQQ")


class Run(NamedTuple):
    """Messages of neighbouring channels in a chunk, as many of each and at the same times."""

    times: NDArray[np.uint64]  # (n,), ns
    indexes: NDArray[Any]  # (channels,), as ``message_indexes`` returns it

    @property
    def channels(self) -> range:
        """The ids of its channels."""
        first = int(self.indexes["channel"][0])
        return range(first, first + len(self.indexes))


class Packed(NamedTuple):
    """One compressed chunk and its indexes."""

    data: bytes
    crc: int  # of the bytes before compression
    size: int  # their number
    runs: Sequence[Run]

    @property
    def span(self) -> tuple[int, int]:
        """Time of the first and of the last message, ns."""
        return min(int(run.times.min()) for run in self.runs), max(int(run.times.max()) for run in self.runs)


_ENTRY: Final = np.dtype([("time", "<u8"), ("offset", "<u8")])


def _index_dtype(entries: int) -> np.dtype[Any]:
    return np.dtype(
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("bytes", "<u4"),
            ("entries", _ENTRY, (entries,)),
        ]
    )


def index_size(entries: int) -> int:
    """Return bytes of a message index record."""
    return _index_dtype(entries).itemsize


def message_indexes(first: int, offsets: NDArray[np.int64]) -> NDArray[Any]:
    """Return the records that follow a chunk, but for their times.

    first : id of the first channel
    offsets : (channels, n) of each message's record in the chunk
    """
    channels, entries = offsets.shape
    made = np.zeros(channels, _index_dtype(entries))
    made["opcode"] = Opcode.MESSAGE_INDEX
    made["length"] = 6 + 16 * entries
    made["channel"] = np.arange(first, first + channels)
    made["bytes"] = 16 * entries
    made["entries"]["offset"] = offsets
    return made


def _timed(run: Run) -> bytes:
    made = copied(run.indexes)  # flights in other threads share the original
    made["entries"]["time"] = run.times
    return made.tobytes()


class _Kept(NamedTuple):
    """What is remembered of a chunk that has been written."""

    start: int  # ns
    end: int
    offset: int  # of the chunk record in the file
    length: int  # of that record
    compressed: int
    uncompressed: int
    runs: list[tuple[range, int]]  # channels, and the messages of each of them


def encode(record: McapRecord) -> bytes:
    """Return the bytes of a record, opcode and length included."""
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _utf8(text: str) -> str:
    """Return the text with what is no UTF-8, of the name of a file, escaped."""
    return text.encode(errors="backslashreplace").decode()


class Opening(NamedTuple):
    """The start of a file and its summary: all schemas and channels, as records."""

    schemas: bytes
    channels: bytes
    schema_count: int
    channel_count: int

    @classmethod
    def of(cls, schemas: Sequence[Schema], channels: Sequence[Channel]) -> Opening:
        """Encode them; ids from 1."""
        records = b"".join(map(encode, schemas)), b"".join(map(encode, channels))
        return cls(*records, len(schemas), len(channels))


class Container:
    """Write one MCAP file; every method raises OSError if the disk fails."""

    def __init__(self, path: Path, opening: Opening, *, new: bool = False) -> None:
        """Open ``path``; ``new``: FileExistsError when there is a file already, also one that came this moment."""
        self._path = path
        mode = "xb" if new else "wb"
        self._file = path.open(mode, buffering=0)  # unbuffered: a killed process loses nothing it has written
        self._offset = 0
        self._crc = 0
        self._chunks: list[_Kept] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._opening = opening
        try:
            self._put(MAGIC, encode(Header("", LIBRARY)), opening.schemas, opening.channels)
        except OSError:
            self.discard()
            raise
        self._whole = (self._offset, self._crc)

    def _put(self, *parts: Any) -> None:
        for part in parts:
            left = memoryview(part).cast("B")
            self._crc = crc32(left, self._crc)
            self._offset += len(left)
            while left:
                left = left[self._file.write(left) :]

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record."""
        record = encode(Metadata(name, {key: _utf8(value) for key, value in values.items()}))
        index = MetadataIndex(self._offset, len(record), name)
        self._put(record)
        self._metadata.append(index)
        self._whole = (self._offset, self._crc)

    def attachment(self, name: str, data: bytes) -> None:
        """Append a file; the media type is text for the endings that we write."""
        media = "text/plain" if name.endswith((".toml", ".txt", ".json", ".csv")) else "application/octet-stream"
        record = encode(Attachment(0, 0, name := _utf8(name), media, data))
        index = AttachmentIndex(self._offset, len(record), 0, 0, len(data), name, media)
        self._put(record)
        self._attachments.append(index)
        self._whole = (self._offset, self._crc)

    def chunk(self, packed: Packed) -> None:
        """Append a chunk and its message indexes."""
        start, end = packed.span
        length = _CHUNK_HEAD.size + len(packed.data)
        head = _CHUNK_HEAD.pack(
            Opcode.CHUNK,
            length - 9,
            start,
            end,
            packed.size,
            packed.crc,
            4,
            COMPRESSION.encode(),
            len(packed.data),
        )
        offset = self._offset
        self._put(b"".join([head, packed.data, *map(_timed, packed.runs)]))  # at once: frames are flown beside it
        runs = [(run.channels, len(run.times)) for run in packed.runs]
        self._chunks.append(_Kept(start, end, offset, length, len(packed.data), packed.size, runs))
        self._whole = (self._offset, self._crc)

    def rewind(self) -> None:
        """Cut the file back to its last whole record, after a write that failed."""
        self._offset, self._crc = self._whole
        self._file.seek(self._offset)
        self._file.truncate()

    def finish(self) -> None:
        """Write the summary and the footer, and close the file."""
        self._put(encode(DataEnd(self._crc)))
        start, self._crc = self._offset, 0
        offsets: list[bytes] = []
        for opcode, group in self._groups():
            begin = self._offset
            for part in group:
                self._put(part)
            if self._offset > begin:
                offsets.append(encode(SummaryOffset(opcode, begin, self._offset - begin)))
        offsets_start = self._offset
        self._put(*offsets)
        crc = crc32(_FOOTER_HEAD.pack(Opcode.FOOTER, 20, start, offsets_start), self._crc)
        self._put(encode(Footer(start, offsets_start, crc)), MAGIC)
        self._file.close()

    def close(self) -> None:
        """Close the file as it is."""
        self._file.close()

    def gone(self) -> bool:
        """Return True if the file is no longer where it was made: deleted, moved, or replaced."""
        own = os.fstat(self._file.fileno())
        try:
            there = self._path.stat()
        except OSError:
            return True
        return (own.st_dev, own.st_ino) != (there.st_dev, there.st_ino)

    def discard(self) -> None:
        """Close the file and remove it."""
        self._file.close()
        if self._path.is_file():
            self._path.unlink()

    def _groups(self) -> Iterator[tuple[int, Iterable[bytes]]]:
        yield Opcode.SCHEMA, [self._opening.schemas]
        yield Opcode.CHANNEL, [self._opening.channels]
        yield Opcode.STATISTICS, [encode(self._statistics())]
        yield Opcode.CHUNK_INDEX, self._chunk_indexes()
        yield Opcode.ATTACHMENT_INDEX, map(encode, self._attachments)
        yield Opcode.METADATA_INDEX, map(encode, self._metadata)

    def _statistics(self) -> Statistics:
        counts = Counter[int]()  # by channel, whose numbers may have gaps
        for channels, messages in (run for kept in self._chunks for run in kept.runs):
            for channel in channels:
                counts[channel] += messages
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=self._opening.channel_count,
            channel_message_counts={channel: counts[channel] for channel in sorted(counts)},
            chunk_count=len(self._chunks),
            message_count=counts.total(),
            message_start_time=min((kept.start for kept in self._chunks), default=0),
            message_end_time=max((kept.end for kept in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=self._opening.schema_count,
        )

    def _chunk_indexes(self) -> Iterator[bytes]:
        """Yield a record a chunk, packed here: the library is slow with twenty offsets each."""
        for kept in self._chunks:
            indexes: dict[int, int] = {}
            length = 0
            for channels, messages in kept.runs:
                for channel in channels:
                    indexes[channel] = kept.offset + kept.length + length
                    length += index_size(messages)
            offsets = struct.pack(f"<{'HQ' * len(indexes)}", *chain.from_iterable(indexes.items()))
            size = _INDEX_HEAD.size - 9 + len(offsets) + _INDEX_TAIL.size
            places = (kept.start, kept.end, kept.offset, kept.length)
            head = _INDEX_HEAD.pack(Opcode.CHUNK_INDEX, size, *places, len(offsets))
            yield head + offsets + _INDEX_TAIL.pack(length, 4, COMPRESSION.encode(), kept.compressed, kept.uncompressed)
