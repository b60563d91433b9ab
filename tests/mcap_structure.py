"""An MCAP file written again, record by record, in any structure that the format allows."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import lz4.frame
import numpy as np
import zstandard
from hostile_mcap import MAGIC, record
from mcap.reader import make_reader
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Message,
    MessageIndex,
    Metadata,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader
from zlib_ng.zlib_ng import crc32


class Structure(NamedTuple):
    """How a file is written."""

    compression: str = "zstd"
    chunk_messages: int = 100  # in a chunk; 0: all beside chunks
    beside: float = 0.0  # share of messages that stand beside chunks
    shuffled: bool = False  # chunks, and what stands beside them, in another order
    numbered: int = 1  # of the first channel
    declared: str = "top"  # top, chunk, both: where schemas and channels are declared
    about_last: bool = False  # metadata and attachments behind the data
    unknown: bool = False  # records that no reader knows, between all others and in chunks
    crcs: bool = False
    summary: str = "all"  # all, none, bare (channels and chunk indexes), index (chunk indexes alone), statistics
    indexes: bool = True  # of messages


class Held(NamedTuple):
    """The contents of a file."""

    about: list[McapRecord]
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    messages: list[Message]


def held(path: Path) -> Held:
    """Everything in a file that is no structure."""
    found = Held([], {}, {}, [])
    with path.open("rb") as file:
        for one in StreamReader(file).records:
            match one:
                case Schema():
                    found.schemas[one.id] = one
                case Channel():
                    found.channels[one.id] = one
                case Message():
                    found.messages.append(one)
                case Metadata() | Attachment():
                    found.about.append(one)
                case _:
                    pass
    return found


def _compressed(data: bytes, compression: str) -> bytes:
    if compression == "zstd":
        return zstandard.ZstdCompressor().compress(data)
    return lz4.frame.compress(data) if compression == "lz4" else data


def _unknown() -> bytes:
    return struct.pack("<BQ", 0x7A, 5) + b"12345" + struct.pack("<BQ", 0xF0, 0)


class _Made:
    def __init__(self, how: Structure) -> None:
        self.how, self.data, self.indexes, self.chunks = how, bytearray(MAGIC), b"", 0

    def put(self, *records: McapRecord) -> None:
        for one in records:
            self.data += (_unknown() if self.how.unknown else b"") + record(one)

    def chunk(self, declared: Sequence[McapRecord], messages: Sequence[Message]) -> None:
        how, inside, places = self.how, b"", dict[int, list[tuple[int, int]]]()
        for one in (*declared, *messages):
            inside += _unknown() if how.unknown else b""
            if isinstance(one, Message):
                places.setdefault(one.channel_id, []).append((one.log_time, len(inside)))
            inside += record(one)
        times = [one.log_time for one in messages]
        crc = crc32(inside) if how.crcs else 0
        packed = _compressed(inside, how.compression)
        self.put(Chunk(how.compression, packed, max(times), min(times), crc, len(inside)))
        written = len(record(Chunk(how.compression, packed, max(times), min(times), crc, len(inside))))
        at, offsets = len(self.data) - written, dict[int, int]()
        for channel, entries in places.items() if how.indexes else ():
            offsets[channel] = len(self.data)
            self.data += record(MessageIndex(channel, entries))
        self.chunks += 1
        self.indexes += record(
            ChunkIndex(
                chunk_length=written,
                chunk_start_offset=at,
                compression=how.compression,
                compressed_size=len(packed),
                message_end_time=max(times),
                message_index_length=len(self.data) - at - written,
                message_index_offsets=offsets,
                message_start_time=min(times),
                uncompressed_size=len(inside),
            )
        )


def write_again(source: Path, out: Path, how: Structure, seed: int = 0) -> None:
    """Write the contents of ``source`` to ``out``."""
    contents, rng = held(source), np.random.default_rng(seed)
    numbers = {old: how.numbered + 3 * i for i, old in enumerate(sorted(contents.channels, reverse=how.numbered > 1))}
    schemas = {old: Schema(**{**vars(one), "id": one.id + how.numbered}) for old, one in contents.schemas.items()}
    channels = [
        Channel(
            numbers[old], one.topic, one.message_encoding, one.metadata, one.schema_id and one.schema_id + how.numbered
        )
        for old, one in contents.channels.items()
    ]
    declared: list[McapRecord] = [*schemas.values(), *channels]
    moved = [Message(**{**vars(one), "channel_id": numbers[one.channel_id]}) for one in contents.messages]
    moved = moved if how.shuffled else sorted(moved, key=lambda one: one.log_time)
    alone = rng.random(len(moved)) < (how.beside if how.chunk_messages else 1.0)
    inside = [one for one, is_alone in zip(moved, alone, strict=True) if not is_alone]
    size = how.chunk_messages or 1
    parts: list[Any] = [inside[i : i + size] for i in range(0, len(inside), size)]
    parts += [one for one, is_alone in zip(moved, alone, strict=True) if is_alone]
    if how.shuffled:
        parts = [parts[i] for i in rng.permutation(len(parts))]
    else:
        parts.sort(key=lambda part: part.log_time if isinstance(part, Message) else part[0].log_time)
    made = _Made(how)
    made.put(Header("", "another program"))
    at_top = how.declared != "chunk" or not isinstance(parts[0], list)
    made.put(*(declared if at_top else []))
    made.put(*([] if how.about_last else contents.about))
    for part in parts:
        if isinstance(part, Message):
            made.put(*([] if at_top else declared), part)
            at_top = True
        else:
            made.chunk([] if how.declared == "top" else declared, part)
    made.put(*(contents.about if how.about_last else []))
    made.put(DataEnd(crc32(made.data) if how.crcs and not how.unknown else 0))
    out.write_bytes(_closed(made, how, declared, len(channels), moved))


def _closed(made: _Made, how: Structure, declared: list[McapRecord], channels: int, moved: list[Message]) -> bytes:
    counts: dict[int, int] = {}
    for one in moved:
        counts[one.channel_id] = counts.get(one.channel_id, 0) + 1
    times = [one.log_time for one in moved]
    statistics = Statistics(0, channels, counts, made.chunks, max(times), min(times), len(moved), 0, len(declared))
    groups = {
        "all": b"".join(map(record, declared)) + record(statistics) + made.indexes,
        "bare": b"".join(map(record, declared)) + made.indexes,
        "index": made.indexes,
        "statistics": record(statistics) + made.indexes,
        "none": b"",
    }[how.summary]
    start = len(made.data) if groups else 0
    return bytes(made.data) + groups + record(Footer(start, 0, 0)) + MAGIC


STRUCTURES = {
    "chunks of zstd": Structure(),
    "no summary": Structure(summary="none"),
    "no statistics": Structure(summary="bare"),
    "an index alone": Structure(summary="index", declared="chunk"),
    "statistics without channels": Structure(summary="statistics", declared="chunk"),
    "declared in chunks, no summary": Structure(summary="none", declared="chunk", indexes=False),
    "declared twice": Structure(declared="both"),
    "no chunks": Structure(chunk_messages=0),
    "no chunks, no summary": Structure(chunk_messages=0, summary="none"),
    "no compression": Structure(compression=""),
    "lz4": Structure(compression="lz4", chunk_messages=7),
    "one chunk": Structure(chunk_messages=10**6),
    "messages beside chunks": Structure(beside=0.3, summary="bare"),
    "messages beside chunks, all indexed": Structure(beside=0.3),
    "out of order": Structure(shuffled=True, chunk_messages=11, beside=0.1),
    "channels renumbered": Structure(numbered=900),
    "what it is about at the end": Structure(about_last=True, summary="none"),
    "records that are not known": Structure(unknown=True, beside=0.2),
    "with checksums": Structure(crcs=True, beside=0.1),
}


def stock_messages(path: Path) -> list[tuple[str, int, bytes]]:
    """The messages of a file by the reader of the format's authors, in the order of time."""
    with path.open("rb") as file:
        return [(channel.topic, one.log_time, one.data) for _, channel, one in make_reader(file).iter_messages()]
