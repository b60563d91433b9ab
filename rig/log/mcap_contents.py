"""Channels, schemas and messages of an MCAP file of any legal structure.

Channels and schemas may be declared in the data section, in the summary or in chunks alone; messages stand in chunks
and beside them; a summary, its statistics and its index may be missing; records that are not known are skipped.  So the
data section is walked from record to record, and an index is used only to leave out chunks, or to go on behind damage.

https://mcap.dev/spec
"""

from __future__ import annotations

import io
from collections.abc import Container, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import FOOTER_SIZE
from mcap.records import Channel, ChunkIndex, Footer, Schema, Statistics
from zlib_ng.zlib_ng import crc32

from rig.core.errors import BadLog
from rig.log.container import MAGIC, RECORD_HEAD
from rig.log.mcap_messages import (
    BROKEN,
    PART,
    Broken,
    Budget,
    LimitedFile,
    Raw,
    Record,
    chunk_records,
    contents_of,
    in_chunk,
    inside,
    message,
    walk,
)


@dataclass(slots=True)
class Summary:
    """The channels and schemas of a file, wherever they are declared, and where its chunks are."""

    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    indexed: dict[int, set[int]] = field(default_factory=dict)  # channels of the chunk at a place; none: not told
    chunks: int = 0
    loose: bool = False  # messages beside chunks
    lost: int = 0  # bytes that are in no whole record
    cut: Record | None = None  # a chunk that the file does not have to its end
    _declared: int = -1  # channels, by the statistics

    @property
    def all_are_known(self) -> bool:
        """True if no channel is declared in a chunk alone."""
        return self.chunks == 0 or 0 <= self._declared <= len(self.channels)

    def note(self, opcode: int, contents: bytes) -> None:
        """Take a record that declares something; others are skipped, known or not."""
        stream = ReadDataStream(io.BytesIO(contents))
        if opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels.setdefault(channel.id, channel)
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHUNK_INDEX:
            index = ChunkIndex.read(stream)
            self.indexed[index.chunk_start_offset] = set(index.message_index_offsets)
        elif opcode == Opcode.STATISTICS:
            self._declared = Statistics.read(stream).channel_count


_NOTED: Final = (Opcode.CHANNEL, Opcode.SCHEMA, Opcode.CHUNK_INDEX, Opcode.STATISTICS)


def summary(file: LimitedFile, lenient: bool = False) -> Summary:
    """Return what the records of ``file`` declare, with or without a summary section.

    lenient : of a file that was cut or damaged, what the rest declares
    BadLog: cut or damaged; McapError, EOFError and their like: records that make no sense.
    """
    if file.read(len(MAGIC)) != MAGIC:
        raise McapError("it does not begin as one")
    contents = Summary()
    with suppress(*BROKEN):  # a file need not have one
        for record in walk(file, _summary_start(file)):
            _note(file, record, contents)
    file.seek(max(file.size - len(MAGIC), 0))
    if not lenient and (file.size < 2 * len(MAGIC) or file.read() != MAGIC):
        raise BadLog(f"{file.path}: truncated at byte {file.size}")
    chunks: list[Record] = []
    for record in _data_section(file, contents, lenient):
        contents.loose |= record.opcode == Opcode.MESSAGE
        if record.opcode == Opcode.CHUNK:
            chunks.append(record)
            continue
        try:
            _note(file, record, contents)
        except BROKEN:
            if not lenient:
                raise
    contents.chunks = len(chunks)
    if not contents.all_are_known or contents.cut is not None:
        _look_inside(file, contents, chunks, lenient)
    return contents


def _summary_start(file: LimitedFile) -> int:
    """Return where the footer says that the summary begins; McapError: nowhere."""
    file.seek(max(file.size - FOOTER_SIZE - len(MAGIC), 0))
    footer = file.read(FOOTER_SIZE)
    if len(footer) < FOOTER_SIZE or footer[0] != Opcode.FOOTER:
        raise McapError("no footer at its end")
    start = Footer.read(ReadDataStream(io.BytesIO(footer[RECORD_HEAD.size :]))).summary_start
    if not len(MAGIC) <= start < file.size:
        raise McapError("no summary")
    return start


def _data_section(file: LimitedFile, contents: Summary, lenient: bool) -> Iterator[Record]:
    """Yield the records before DataEnd; Broken: damage.

    lenient : behind damage it goes on at the next chunk that the index names; a chunk that was cut is the last
    """
    start: int | None = len(MAGIC)
    contents.lost, contents.cut = 0, None
    while start is not None:
        try:
            for record in walk(file, start):
                if record.opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    return
                yield record
        except Broken as error:
            if not lenient:
                raise BadLog(f"{file.path}: {_where(file, error.at)}") from None
            start = min((place for place in contents.indexed if place > error.at), default=None)
            contents.lost += (file.size if start is None else start) - error.at
            contents.cut = _cut_chunk(file, error.at) if start is None else None
        else:
            return
    if contents.cut is not None:
        yield contents.cut


def _where(file: LimitedFile, at: int) -> str:
    """Say where a file is damaged, or that it was cut."""
    file.seek(max(file.size - len(MAGIC), 0))
    return f"damaged at byte {at}" if file.read() == MAGIC else f"truncated at byte {file.size}"


def _cut_chunk(file: LimitedFile, at: int) -> Record | None:
    """Return the chunk that begins at byte ``at`` and goes on behind the end of the file, if it is one."""
    file.seek(at)
    head = file.read(RECORD_HEAD.size)
    if len(head) < RECORD_HEAD.size or head[0] != Opcode.CHUNK:
        return None
    return Record(head[0], at, file.size - at - RECORD_HEAD.size)


def _look_inside(file: LimitedFile, contents: Summary, chunks: list[Record], lenient: bool) -> None:
    """Take the channels and schemas that chunks declare."""
    budget = Budget(file)
    for record in chunks:
        try:
            for opcode, begin, end, data in inside(chunk_records(file, record, budget, record is contents.cut)):
                if opcode in (Opcode.CHANNEL, Opcode.SCHEMA):
                    contents.note(opcode, data[begin:end])
        except BROKEN:
            if not lenient:
                raise


def _note(file: LimitedFile, record: Record, contents: Summary) -> None:
    if record.opcode in _NOTED:
        contents.note(record.opcode, contents_of(file, record))


def messages(
    file: LimitedFile, summary: Summary, wanted: Container[int], budget: Budget, damage: list[str] | None = None
) -> Iterator[Raw]:
    """Yield the messages of the channels ``wanted``, in the order of the file, in and beside chunks.

    damage : lines on what was left out are added to it; None: BadLog, ValueError, McapError and their like, as of a
             file of which nothing can be read
    BadLog: a chunk or a message beyond the limits.
    """
    if damage is None:
        _check_data_section(file, summary)
    bad = of_cut = given = 0
    first: Exception | None = None
    for record in _data_section(file, summary, lenient=damage is not None):
        try:
            for raw in _of_record(file, record, summary, wanted, budget):
                of_cut += record is summary.cut
                given += 1
                yield raw
        except BROKEN as error:
            if damage is None:
                raise
            first = first or error
            bad += 0 if record is summary.cut else record.after - record.at
    if damage is None:
        return
    if first is not None and not given:
        raise first
    if bad:
        damage.append(f"damaged: {bad} of {file.size} bytes are chunks or messages that cannot be read: left out")
    if summary.lost:
        read = f"; {of_cut} messages of a chunk in them were read" if of_cut else ""
        damage.append(f"{_where(file, file.size)}: {summary.lost} of {file.size} bytes are no whole record{read}")


def _of_record(
    file: LimitedFile, record: Record, summary: Summary, wanted: Container[int], budget: Budget
) -> Iterable[Raw]:
    """Return the messages of the channels ``wanted`` in a chunk, or of a record that is one."""
    if record.opcode == Opcode.CHUNK:
        held = summary.indexed.get(record.at)
        if held and not any(channel in wanted for channel in held):
            return ()
        return in_chunk(chunk_records(file, record, budget, record is summary.cut), wanted, file.path)
    if record.opcode != Opcode.MESSAGE:
        return ()
    data = contents_of(file, record)
    found = message(data, 0, len(data), wanted, file.path)
    return () if found is None else (found,)


def _check_data_section(file: LimitedFile, contents: Summary) -> None:
    """Raise ValueError if the data section has a checksum and messages, or chunks without index, and is not as written.

    Chunks that the index names have checksums of their own.
    """
    if contents.chunks == len(contents.indexed) and not contents.loose:
        return
    end = next((record for record in walk(file) if record.opcode in (Opcode.DATA_END, Opcode.FOOTER)), None)
    if end is None or end.opcode != Opcode.DATA_END or end.length < 4:
        return
    told = int.from_bytes(contents_of(file, end)[:4], "little")
    if told == 0:
        return
    file.seek(0)
    left, crc = end.at, 0
    while left:
        part = file.read(min(left, PART))
        left, crc = left - len(part), crc32(part, crc)
    if crc != told:
        raise ValueError("the checksum of the data section does not match")
