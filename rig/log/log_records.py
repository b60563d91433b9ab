"""Records of a log: its contents beside its frames, its schemas and channels, and its checksums."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple, TypeVar

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, DataEnd, Footer, Header, Metadata, Schema
from zlib_ng.zlib_ng import crc32

from rig.core.errors import BadLog
from rig.core.frame import RowParts
from rig.core.renamed import MESSAGES as MESSAGES_NOW
from rig.core.renamed import TOPICS
from rig.core.text import quoted
from rig.log.chunk_layout import Layout, layout_of
from rig.log.container import COMPRESSION, LIBRARY, MAGIC, RECORD_HEAD
from rig.log.decode import MALFORMED, Damaged, same_crc
from rig.log.mcap_messages import RECORD_LIMIT
from rig.log.schema import (
    ALL_TOPICS,
    BY_TOPIC,
    MESSAGES,
    OLDEST,
    PART_MESSAGES,
    PART_TOPICS,
    RESULT,
    RIG,
    SCHEMA_VERSION,
    Field,
    channels,
    descriptors,
    older,
)

_RATES_HZ: Final = (1.0, 1000.0)  # of a flight, as a scenario has them
R = TypeVar("R", Attachment, Channel, DataEnd, Footer, Header, Metadata, Schema)
_VOTED: Final = ("rig.Signal", "rig.Discrete")  # messages of an output of rig vote


NUMBERS: Final = {topic.name: number for number, topic in enumerate(ALL_TOPICS, 1)}  # of our channels


@dataclass(slots=True)
class About:
    """The contents of a log beside its frames; filled while the log is read."""

    metadata: dict[str, str] = field(default_factory=dict)
    result: dict[str, str] | None = None
    attachments: dict[str, bytes] = field(default_factory=dict)
    others: dict[str, dict[str, str]] = field(default_factory=dict)  # metadata records of other names
    parts: RowParts = ()  # of servo actuators, of several computers
    again: bool = False  # another program wrote its records again
    unchecked: bool = False  # without checksums of all its bytes

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return float(self.metadata["rate_hz"])


class LogRecord(NamedTuple):
    """One record of a log."""

    opcode: int
    offset: int
    content: bytes
    crc_before: int  # of the data section, or after DataEnd of the summary


def records(file: BinaryIO, path: Path) -> Iterator[LogRecord]:
    """Yield every record up to the footer; Damaged where the file ends before it."""
    size = file.seek(0, 2)
    file.seek(size - len(MAGIC))
    ended = size >= 2 * len(MAGIC) and file.read() == MAGIC
    offset = file.seek(len(MAGIC))
    crc = crc32(MAGIC)
    while True:
        head = file.read(RECORD_HEAD.size)
        opcode, length = RECORD_HEAD.unpack(head) if len(head) == RECORD_HEAD.size else (0, size)
        if length > RECORD_LIMIT and ended:
            raise Damaged(path, f"damaged at byte {offset}: a record of {length} bytes", offset)
        if offset + len(head) + length > size:
            if ended:
                raise Damaged(path, f"damaged at byte {offset}", offset)
            raise Damaged(path, f"truncated at byte {size}", offset)
        content = file.read(length)
        yield LogRecord(opcode, offset, content, crc)
        if opcode == Opcode.FOOTER:
            break
        crc = 0 if opcode == Opcode.DATA_END else crc32(content, crc32(head, crc))
        offset += len(head) + length
    end = file.read()
    if end != MAGIC:
        at = size - len(end)
        raise Damaged(path, f"truncated at byte {size}" if MAGIC.startswith(end) else "damaged at its end", at)


def written_again(file: BinaryIO, path: Path) -> bool:
    """Return True if a program other than the rig wrote the file, by its header and its first data."""
    try:
        for record in records(file, path):
            if record.opcode == Opcode.CHUNK:
                return COMPRESSION.encode() != record.content[32 : 32 + len(COMPRESSION)]
            if record.opcode == Opcode.MESSAGE or (
                record.opcode == Opcode.HEADER and _as(Header, record).library != LIBRARY
            ):
                return True
            if record.opcode == Opcode.CHANNEL:
                channel = _as(Channel, record)
                number = NUMBERS.get(TOPICS.get(channel.topic, channel.topic), channel.id)
                if number != channel.id:
                    return True
    except (Damaged, *MALFORMED):
        return False  # its own reader says where
    return False


def _as(kind: type[R], record: LogRecord) -> R:
    read: Any = kind.read
    return read(ReadDataStream(BytesIO(record.content)))


def note(record: LogRecord, path: Path, about: About, described: Descriptions) -> None:
    """Note the contents of ``record``, no chunk."""
    if record.opcode == Opcode.METADATA:
        entry = _as(Metadata, record)
        if entry.name == RIG:
            _check_version(path, entry.metadata)
            _check_rate(path, entry.metadata)
            about.metadata = entry.metadata
        elif entry.name == RESULT:
            _check_result(path, entry.metadata)
            about.result = entry.metadata
        else:
            about.others[entry.name] = entry.metadata
    elif record.opcode == Opcode.ATTACHMENT:
        if (told := int.from_bytes(record.content[-4:], "little")) or not about.again:
            same_crc("attachment", told, crc32(record.content[:-4]))
        attached = _as(Attachment, record)
        about.attachments[attached.name] = attached.data
    elif record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
        described.add(record)
    elif record.opcode == Opcode.DATA_END:
        described.check(about)
        told = _as(DataEnd, record).data_section_crc
        about.unchecked = about.again and not told
        if not about.unchecked:
            same_crc("data section", told, record.crc_before)
    elif record.opcode == Opcode.FOOTER:
        head = RECORD_HEAD.pack(record.opcode, len(record.content)) + record.content[:16]
        if (told := _as(Footer, record).summary_crc) or not about.again:
            same_crc("summary", told, crc32(head, record.crc_before))


def _check_version(path: Path, metadata: dict[str, str]) -> None:
    """Raise BadLog, which says who wrote it, for a log of a version that is not read."""
    version = metadata["schema_version"]
    if not OLDEST <= int(version) <= SCHEMA_VERSION:
        by = metadata.get("version jsbsim-rig", "of another version")
        commit = f", commit {metadata['git commit']}" if "git commit" in metadata else ""
        written = f"written by jsbsim-rig {by}{commit}"
        raise BadLog(f"{path}: schema version {version} ({written}); this one reads {OLDEST} to {SCHEMA_VERSION}")


def _check_rate(path: Path, metadata: dict[str, str]) -> None:
    """Raise BadLog unless the rate is one that a flight can have."""
    text = metadata.get("rate_hz", "nothing")
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = math.nan
    if not _RATES_HZ[0] <= rate_hz <= _RATES_HZ[1]:
        raise BadLog(f"{path}: rate_hz of its metadata is {quoted(text)}, must be from 1 to 1000")


def _check_result(path: Path, result: dict[str, str]) -> None:
    """Raise BadLog where what is kept of a unit under test, or of the keys, is no JSON table of finite numbers."""
    for key in ("unit", "keys"):
        try:
            data = json.loads(result.get(key, "{}"))
            json.dumps(data, allow_nan=False)
        except (ValueError, RecursionError):
            data = None
        if not isinstance(data, dict):
            raise BadLog(f"{path}: {key!r} of its result is damaged")


class Descriptions:
    """The schemas and channels of a log, which must be those that this version writes, or an older one wrote."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._layout: Layout | None = None

    def add(self, record: LogRecord) -> None:
        """Take a schema or a channel."""
        if record.opcode == Opcode.SCHEMA:
            schema = _as(Schema, record)
            self._schemas[schema.id] = schema
        else:
            channel = _as(Channel, record)
            self._channels[channel.id] = channel

    def renumber(self, channels: Mapping[int, Channel], schemas: Mapping[int, Schema]) -> dict[int, int]:
        """Take the channels of a file that another program numbered; return the rig's numbers, by those of the file."""
        self._schemas = dict(schemas)
        numbers: dict[int, int] = {}
        for channel in channels.values():
            number = NUMBERS.get(TOPICS.get(channel.topic, channel.topic))
            if number is not None and channel.schema_id in schemas:
                numbers[channel.id] = number
                self._channels.setdefault(number, channel)
        return numbers

    def check(self, about: About) -> Layout:
        """Return the layout of the chunks; raise BadLog if the messages are not those of the rig."""
        if self._layout is None:
            if not about.metadata:
                raise BadLog(f"{self._path}: {self._foreign()}")
            version = int(about.metadata["schema_version"])
            newest, by_topic = version == SCHEMA_VERSION, version >= BY_TOPIC
            fields_by_message: dict[str, tuple[Field, ...]] = {}
            named = {channel.topic for channel in self._channels.values()} if by_topic else set[str]()
            about.parts = tuple(part for part, topics in PART_TOPICS.items() if topics[0].name in named)
            for written in channels(about.parts):
                name = ALL_TOPICS[written.id - 1].message
                fields = self._fields(self._schema(written), name, newest)
                fields_by_message.setdefault(name, fields)
            self._layout = layout_of(about.parts) if by_topic else Layout(fields_by_message, rowwise=True)
        return self._layout

    def _foreign(self) -> str:
        """Say what a file without the metadata of a flight is, and what reads it."""
        if any(schema.name in _VOTED for schema in self._schemas.values()):
            return (
                "an output of rig vote, no log of a flight: rig view shows it, rig diff compares it, rig vote votes on "
                "its channels again; rig vote --out FILE.csv or .parquet writes a table"
            )
        return f"not a log of this rig (no metadata record {RIG!r})"

    def _schema(self, written: Channel) -> Schema:
        """Return the schema in this log of a channel that the rig writes."""
        channel = self._channels.get(written.id)
        if channel is None or TOPICS.get(channel.topic, channel.topic) != written.topic:
            named = "is missing" if channel is None else f"is {channel.topic}"
            raise BadLog(f"{self._path}: its signals are not those of this rig: {written.topic} {named}")
        return self._schemas[channel.schema_id]

    def _fields(self, schema: Schema, name: str, newest: bool) -> tuple[Field, ...]:
        """Return the fields of a message of the rig in this log, in the order of their numbers; none of foxglove's.

        Those may be of another release: we write the fields that we know.
        """
        fields: tuple[Field, ...] | None = ()
        known = {**MESSAGES, **PART_MESSAGES}
        if name in known:
            described = FileDescriptorSet.FromString(schema.data)
            if described == descriptors(name):
                fields = known[name]
            else:
                fields = None if newest else older(described, known[name])
        if MESSAGES_NOW.get(schema.name, schema.name) != name or fields is None:
            raise BadLog(f"{self._path}: the fields of {schema.name} are not those of this rig")
        return fields
