"""Goes through a log from end to end and checks every byte of it.

Each byte of the file is under one of three checksums (chunk, data section, footer): what comes out of a
log without BadLog is what was written.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple, TypeVar

import numpy as np
import zstandard
from foxglove_schemas_protobuf.Log_pb2 import Log as FoxgloveLog
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Metadata, Schema
from numpy.typing import NDArray

from rig.errors import BadLog
from rig.frame import FRAME, TIMING, Block
from rig.log.container import COMPRESSION, MAGIC, channels
from rig.log.index import EVENT_CHANNEL
from rig.log.layout import rows_in, unpack
from rig.log.record import HEAD, MESSAGE_OPCODE
from rig.log.schema import MESSAGES, SCHEMA_VERSION, TOPICS, descriptors
from rig.log.writer import RESULT, RIG

R = TypeVar("R", Attachment, Channel, Chunk, DataEnd, Footer, Metadata, Schema)
CHUNK_LIMIT: Final = 1 << 28  # bytes that a chunk may claim; ours have 1 MiB
_MALFORMED: Final = (McapError, DecodeError, ValueError, LookupError, struct.error, zstandard.ZstdError)


class Damaged(BadLog):
    """A log of ours, of which ``recover`` can save what lies before byte ``at``."""

    def __init__(self, path: Path, what: str, at: int) -> None:
        super().__init__(f"{path}: {what}; rig recover saves what is before")
        self.what = what
        self.at = at


@dataclass(frozen=True, slots=True)
class LoggedEvent:
    """An event as the log tells it; the fields of rig.events.Event."""

    frame: int
    level: str
    name: str
    text: str


class Part(NamedTuple):
    """One chunk of a log, decoded, and its bytes as they are in the file."""

    rows: Block
    timing: NDArray[Any]
    events: list[LoggedEvent]
    event_entries: list[tuple[int, int]]  # time in ns, offset in the chunk
    chunk: Chunk


@dataclass(slots=True)
class About:
    """What a log says beside its frames; filled while the log is read."""

    metadata: dict[str, str] = field(default_factory=dict)
    result: dict[str, str] | None = None
    attachments: dict[str, bytes] = field(default_factory=dict)
    others: dict[str, dict[str, str]] = field(default_factory=dict)  # metadata records of other names

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return float(self.metadata["rate_hz"])


def iter_parts(path: Path, about: About) -> Iterator[Part]:
    """Read ``path`` from end to end, filling ``about``; Damaged at the first byte that is not as it was written."""
    try:
        with path.open("rb") as file:
            yield from _parts(file, path, about)
    except OSError as error:
        raise BadLog(f"{path}: cannot be read: {error.strerror}") from None


def _parts(file: BinaryIO, path: Path, about: About) -> Iterator[Part]:
    if file.read(len(MAGIC)) != MAGIC:
        raise BadLog(f"{path}: not an MCAP file")
    described = _Descriptions(path)
    for record in _records(file, path):
        try:
            part = _take(record, path, about, described)
        except _MALFORMED as error:
            where = f"damaged at byte {record.offset}: {error}"
            raise Damaged(path, where, record.offset) from None
        if part is not None:
            yield part


class _Record(NamedTuple):
    opcode: int
    offset: int
    content: bytes
    crc_before: int  # of the data section, or after DataEnd of the summary


_RECORD_HEAD: Final = struct.Struct("<BQ")


def _records(file: BinaryIO, path: Path) -> Iterator[_Record]:
    """Every record up to the footer; Damaged where the file ends before it."""
    size = file.seek(0, 2)
    file.seek(size - len(MAGIC))
    ended = size >= 2 * len(MAGIC) and file.read() == MAGIC
    offset = file.seek(len(MAGIC))
    crc = zlib.crc32(MAGIC)
    while True:
        head = file.read(_RECORD_HEAD.size)
        opcode, length = _RECORD_HEAD.unpack(head) if len(head) == _RECORD_HEAD.size else (0, size)
        if offset + len(head) + length > size:
            if ended:
                raise Damaged(path, f"damaged at byte {offset}", offset)
            raise Damaged(path, f"truncated at byte {size}", offset)
        content = file.read(length)
        yield _Record(opcode, offset, content, crc)
        if opcode == Opcode.FOOTER:
            break
        crc = 0 if opcode == Opcode.DATA_END else zlib.crc32(content, zlib.crc32(head, crc))
        offset += len(head) + length
    end = file.read()
    if end != MAGIC:
        at = size - len(end)
        raise Damaged(path, f"truncated at byte {size}" if MAGIC.startswith(end) else "damaged at its end", at)


def _as(kind: type[R], record: _Record) -> R:
    read: Any = kind.read
    return read(ReadDataStream(BytesIO(record.content)))


def _take(record: _Record, path: Path, about: About, described: _Descriptions) -> Part | None:
    """Note what ``record`` says; a chunk gives a part."""
    if record.opcode == Opcode.CHUNK:
        described.check(about)
        return decode(_as(Chunk, record))
    if record.opcode == Opcode.METADATA:
        said = _as(Metadata, record)
        if said.name == RIG:
            _check_version(path, said.metadata)
            about.metadata = said.metadata
        elif said.name == RESULT:
            about.result = said.metadata
        else:
            about.others[said.name] = said.metadata
    elif record.opcode == Opcode.ATTACHMENT:
        _same("attachment", int.from_bytes(record.content[-4:], "little"), zlib.crc32(record.content[:-4]))
        attached = _as(Attachment, record)
        about.attachments[attached.name] = attached.data
    elif record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        described.add(record)
    elif record.opcode == Opcode.DATA_END:
        described.check(about)
        _same("data section", _as(DataEnd, record).data_section_crc, record.crc_before)
    elif record.opcode == Opcode.FOOTER:
        head = _RECORD_HEAD.pack(record.opcode, len(record.content)) + record.content[:16]
        _same("summary", _as(Footer, record).summary_crc, zlib.crc32(head, record.crc_before))
    return None


def _same(what: str, crc: int, found: int) -> None:
    if crc != found:
        raise ValueError(f"the checksum of the {what} does not match")


def _check_version(path: Path, metadata: dict[str, str]) -> None:
    """BadLog when the log is of another version: which, and who wrote it."""
    version = metadata["schema_version"]
    if int(version) != SCHEMA_VERSION:
        by = metadata.get("version jsbsim-rig", "of another version")
        commit = f", commit {metadata['git commit']}" if "git commit" in metadata else ""
        written = f"written by jsbsim-rig {by}{commit}"
        raise BadLog(f"{path}: schema version {version} ({written}); this one reads version {SCHEMA_VERSION}")


class _Descriptions:
    """The schemas and channels of a log, which must be those that this version writes."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._checked = False

    def add(self, record: _Record) -> None:
        if record.opcode == Opcode.SCHEMA:
            schema = _as(Schema, record)
            self._schemas[schema.id] = schema
        else:
            channel = _as(Channel, record)
            self._channels[channel.id] = channel

    def check(self, about: About) -> None:
        """BadLog when the layout of chunks cannot be the one of rig/log/layout.py."""
        if self._checked:
            return
        if not about.metadata:
            raise BadLog(f"{self._path}: not a log of this rig (no metadata record {RIG!r})")
        for ours in channels():
            found = self._channels.get(ours.id)
            if found is None or found.topic != ours.topic:
                named = "is missing" if found is None else f"is {found.topic}"
                raise BadLog(f"{self._path}: its signals are not those of this rig: {ours.topic} {named}")
            self._check_schema(self._schemas[found.schema_id], TOPICS[ours.id - 1].message)
        self._checked = True

    def _check_schema(self, schema: Schema, name: str) -> None:
        same = schema.name == name
        if same and name in MESSAGES:  # foxglove's may be of another release: we write the fields we know
            same = FileDescriptorSet.FromString(schema.data) == descriptors(name)
        if not same:
            raise BadLog(f"{self._path}: the fields of {schema.name} are not those of this rig")


def decode(chunk: Chunk) -> Part:
    """The frames and events of a chunk; ValueError when it is damaged."""
    if chunk.compression != COMPRESSION or chunk.uncompressed_size > CHUNK_LIMIT:
        raise ValueError("not a chunk that the rig writes")
    if zstandard.frame_content_size(chunk.data) != chunk.uncompressed_size:
        raise ValueError("the size of the chunk does not match")
    data = zstandard.ZstdDecompressor().decompress(chunk.data)
    _same("chunk", chunk.uncompressed_crc, zlib.crc32(data))
    packed = rows_in(np.frombuffer(data, np.uint8))
    rows = np.zeros(len(packed), FRAME)
    timing = np.zeros(len(packed), TIMING)
    unpack(packed, rows, timing)
    events, entries = _events(data, packed.nbytes)
    return Part(rows, timing, events, entries, chunk)


_LEVELS: Final = {FoxgloveLog.INFO: "info", FoxgloveLog.WARNING: "warning", FoxgloveLog.ERROR: "error"}


def _events(data: bytes, offset: int) -> tuple[list[LoggedEvent], list[tuple[int, int]]]:
    events: list[LoggedEvent] = []
    entries: list[tuple[int, int]] = []
    while offset < len(data):
        opcode, length, channel, frame, time, _ = HEAD.unpack_from(data, offset)
        if opcode != MESSAGE_OPCODE or channel != EVENT_CHANNEL:
            raise ValueError("not a chunk that the rig writes")
        message = FoxgloveLog.FromString(data[offset + HEAD.size : offset + 9 + length])
        events.append(LoggedEvent(frame, _LEVELS[message.level], message.name, message.message))
        entries.append((time, offset))
        offset += 9 + length
    return events, entries
