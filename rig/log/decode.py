"""Chunks of a log back to rows and events, on threads, a few chunks ahead of the reader."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NamedTuple, Self

import numpy as np
import zstandard
from foxglove_schemas_protobuf.Log_pb2 import Log as FoxgloveLog
from google.protobuf.message import DecodeError
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Chunk
from numpy.typing import NDArray
from zlib_ng.zlib_ng import crc32

from rig.core.errors import BadLog
from rig.core.event import Event, Severity
from rig.core.frame import Block
from rig.core.threads import cores
from rig.log.chunk_layout import Layout, event_runs
from rig.log.container import COMPRESSION, Run
from rig.log.records import HEAD, MESSAGE_OPCODE
from rig.log.schema import EVENT_CHANNEL, LEVELS

CHUNK_LIMIT: Final = 1 << 28  # bytes that a chunk may claim; ours have 1 MiB
AHEAD: Final = 8  # chunks that are decoded before they are asked for
THREADS: Final = min(4, cores())  # nearly all of decoding leaves the interpreter to others
# Raised by bytes that make no sense.
MALFORMED: Final = (McapError, DecodeError, ValueError, LookupError, struct.error, zstandard.ZstdError)


class Damaged(BadLog):
    """A damaged log of the rig, of which ``recover`` can save the bytes before ``at``."""

    def __init__(self, path: Path, what: str, at: int) -> None:
        super().__init__(f"{path}: {what}; rig recover saves the frames before it")
        self.what = what
        self.at = at


@contextmanager
def damage(path: Path, at: int) -> Iterator[None]:
    """Raise every error of malformed bytes as Damaged at byte ``at``."""
    try:
        yield
    except MALFORMED as error:
        raise Damaged(path, f"damaged at byte {at}: {error}", at) from None


class Part(NamedTuple):
    """One chunk of a log, decoded, and its bytes as they are in the file; None: another program wrote them again."""

    rows: Block
    timing: NDArray[Any]
    beside: Block | None
    events: list[Event]
    runs: list[Run]  # of its messages
    chunk: Chunk | None


class Decoder:
    """Decode chunks on threads, a few ahead of the reader; the parts come in the order of the file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._ahead: deque[tuple[int, Future[Part]]] = deque()

    def __enter__(self) -> Self:
        self._pool = ThreadPoolExecutor(THREADS, "decode")
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown(cancel_futures=True)

    def add(self, content: bytes, at: int, layout: Layout) -> Iterator[Part]:
        """Begin with the chunk record at byte ``at``, in ``layout``; give the oldest part when enough are under way."""
        self._ahead.append((at, self._pool.submit(decode, content, layout)))
        if len(self._ahead) > AHEAD:
            yield self._next()

    def rest(self) -> Iterator[Part]:
        """Yield all parts that are still being decoded."""
        while self._ahead:
            yield self._next()

    def _next(self) -> Part:
        """Return the oldest part; after Damaged there is no other."""
        at, part = self._ahead.popleft()
        try:
            with damage(self._path, at):
                return part.result()
        except Damaged:
            self._ahead.clear()
            raise


def same_crc(what: str, crc: int, expected: int) -> None:
    """Raise ValueError unless two checksums are equal."""
    if crc != expected:
        raise ValueError(f"the checksum of the {what} does not match")


def decode(content: bytes, layout: Layout) -> Part:
    """Return the frames and events of a chunk record; ValueError and its like when it is damaged."""
    chunk = Chunk.read(ReadDataStream(BytesIO(content)))
    if chunk.compression != COMPRESSION or chunk.uncompressed_size > CHUNK_LIMIT:
        raise ValueError("not a chunk that the rig writes")
    if zstandard.frame_content_size(chunk.data) != chunk.uncompressed_size:
        raise ValueError("the size of the chunk does not match")
    data = zstandard.ZstdDecompressor().decompress(chunk.data)
    same_crc("chunk", chunk.uncompressed_crc, crc32(data))
    held = layout.read(np.frombuffer(data, np.uint8))
    events, entries = _events(data, held.size)
    return Part(held.rows, held.timing, held.beside, events, [*held.runs, *event_runs(entries)], chunk)


_LATEST_NS: Final = 2**63 - 1  # of the times that readers count with
_LEVELS: Final[dict[Any, Severity]] = {code: level for level, code in LEVELS.items()}


def event_of(frame: int, time: int, data: bytes) -> Event:
    """Return the event of a message.  ValueError: a time beyond those that readers count with."""
    if time > _LATEST_NS:
        raise ValueError(f"the time of an event is {time} ns, allowed: at most {_LATEST_NS}")
    message = FoxgloveLog.FromString(data)
    return Event(frame, _LEVELS[message.level], message.name, message.message)


def _events(data: bytes, offset: int) -> tuple[list[Event], list[tuple[int, int]]]:
    events: list[Event] = []
    entries: list[tuple[int, int]] = []
    while offset < len(data):
        opcode, length, channel, frame, time, _ = HEAD.unpack_from(data, offset)
        if opcode != MESSAGE_OPCODE or channel != EVENT_CHANNEL:
            raise ValueError("not a chunk that the rig writes")
        events.append(event_of(frame, time, data[offset + HEAD.size : offset + 9 + length]))
        entries.append((time, offset))
        offset += 9 + length
    return events, entries
