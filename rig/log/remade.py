"""A log of the rig that another program wrote again: filtered, sorted, with other chunks, compression or none.

The messages are the rig's, byte for byte; their channels may have other numbers, and they may stand in any order, in
chunks and beside them.  They are put together again frame by frame, each by its time.  Channels that the rig does not
know are skipped.  A frame that lacks a message, or has one twice, is damage.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from rig.core.event import Event
from rig.core.frame import RowPart
from rig.log.chunk_layout import PARTS, Layout, Table, log_times
from rig.log.container import Run, message_indexes
from rig.log.decode import Damaged, Part, damage, event_of
from rig.log.log_records import About, Descriptions, note, records
from rig.log.mcap_contents import summary
from rig.log.mcap_messages import MESSAGE_HEAD, Budget, LimitedFile, Record, chunk_records, inside
from rig.log.records import HEAD
from rig.log.schema import ALL_TOPICS, EVENT_CHANNEL

_BLOCK: Final = 256  # frames that are decoded at once


def remade_parts(file: BinaryIO, path: Path, about: About) -> Iterator[Part]:
    """Yield the frames of a log in their order, filling ``about`` first; Damaged at the end, where it was cut or is not
    as it was written.
    """
    described, about.again = Descriptions(path), True
    with LimitedFile(path) as whole:
        with damage(path, 0):
            contents = summary(whole, lenient=True)
            numbers = described.renumber(contents.channels, contents.schemas)
        damaged = _noted(file, path, about, described)
        if damaged is not None and not about.metadata:
            raise damaged
        with damage(path, 0):
            frames = _Frames(described.check(about), about)
        budget = Budget(whole)
        try:
            for record in records(file, path):
                if damaged is not None and record.offset >= damaged.at:
                    break
                with damage(path, record.offset):
                    for data in _messages(whole, record, budget):
                        frames.take(data, numbers)
                    yield from frames.whole(_BLOCK)
        except Damaged as error:
            damaged = error
        with damage(path, whole.size):
            yield from frames.whole(1, last=True)
        if damaged is not None:
            try:
                raise damaged
            finally:
                damaged = None  # an error that its own frame holds keeps all blocks until a collection
        if lacking := frames.lacking():
            raise Damaged(path, lacking, whole.size)


def _noted(file: BinaryIO, path: Path, about: About, described: Descriptions) -> Damaged | None:
    """Take what all records say that are no data, which may be anywhere; return where the log is damaged."""
    try:
        for record in records(file, path):
            if record.opcode in (Opcode.METADATA, Opcode.ATTACHMENT, Opcode.DATA_END, Opcode.FOOTER):
                with damage(path, record.offset):
                    note(record, path, about, described)
    except Damaged as error:
        return error
    return None


def _messages(file: LimitedFile, record: Any, budget: Budget) -> Iterator[bytes]:
    """Yield the messages of a record, each from its head on."""
    if record.opcode == Opcode.MESSAGE:
        yield record.content
    elif record.opcode == Opcode.CHUNK:
        chunk = Record(record.opcode, record.offset, len(record.content))
        for opcode, begin, end, data in inside(chunk_records(file, chunk, budget)):
            if opcode == Opcode.MESSAGE:
                yield data[begin:end]


class _Frames:
    """The messages of the frames that are not whole yet, and of those that were not asked for."""

    def __init__(self, layout: Layout, about: About) -> None:
        self._layout, self._parts, self._rate_hz = layout, about.parts, about.rate_hz
        self._tables: dict[RowPart | None, Table] = {None: layout.table, **{part: PARTS[part] for part in about.parts}}
        sizes = {n: end - start for table in self._tables.values() for n, start, end in table.topics}
        self._sizes = {number: size - HEAD.size for number, size in sizes.items()}  # of the data of their messages
        self._held: dict[int, dict[int, bytes]] = {number: {} for number in sizes}  # by topic and time
        self._counts: dict[int, int] = {}  # messages by time
        self._events: list[tuple[int, Event]] = []
        self._others: dict[int, list[int]] = {}  # times of messages that are not read back, by topic
        self._next, self._ready = 0, list[int]()  # the frames before ``_next`` are whole; those that were not given

    def take(self, message: bytes, numbers: dict[int, int]) -> None:
        """Take a message, from its head on, if its channel is one of the rig.  ValueError: not as the rig writes it."""
        channel, sequence, time, _ = MESSAGE_HEAD.unpack_from(message)
        number = numbers.get(channel)
        if number is None:
            return
        if number == EVENT_CHANNEL:
            frame = round(time * self._rate_hz / 1e9)
            frame = frame if self._time(frame) == time else sequence  # which a program may have numbered again
            self._events.append((time, event_of(frame, time, message[MESSAGE_HEAD.size :])))
        elif (size := self._sizes.get(number)) is None:
            self._others.setdefault(number, []).append(time)
        else:
            if len(message) - MESSAGE_HEAD.size != size:
                raise ValueError(f"a message of {ALL_TOPICS[number - 1].name} is not as the rig writes it")
            held = self._held[number]
            if time in held:
                raise ValueError(f"two messages of {ALL_TOPICS[number - 1].name} at {time} ns")
            held[time] = message[MESSAGE_HEAD.size :]
            self._counts[time] = self._counts.get(time, 0) + 1

    def whole(self, least: int, last: bool = False) -> Iterator[Part]:
        """Yield the frames that are whole and follow the one before, if they are ``least`` or more.

        last : no message comes any more; those behind a gap too
        """
        while self._counts.get(time := self._time(self._next)) == len(self._sizes):
            self._ready.append(time)
            self._next += 1
        while len(self._ready) >= least:
            yield self._part(self._ready[:_BLOCK])
            self._ready = self._ready[_BLOCK:]
        if not last:
            return
        rest = list(takewhile(lambda time: self._counts[time] == len(self._sizes), sorted(self._counts)))
        while rest:
            yield self._part(rest[:_BLOCK])
            rest = rest[_BLOCK:]
        if self._events or self._others:
            yield self._part([])

    def _time(self, frame: int) -> int:
        """Return the time of a frame, ns, as ``log_times``."""
        return round(frame * 1e9 / self._rate_hz)

    def lacking(self) -> str:
        """Return which frame lacks a message; "": none does."""
        if not self._counts:
            return ""
        time = min(self._counts)
        topic = next(ALL_TOPICS[number - 1].name for number, held in self._held.items() if time not in held)
        return f"the frame at {time / 1e9:g} s has no message of {topic}"

    def _part(self, times: list[int]) -> Part:
        """Return the frames at ``times``, which are whole, with the events up to the last of them."""
        stamps = np.array(times, np.uint64)
        frames = np.rint(stamps * (self._rate_hz / 1e9)).astype(np.int64)
        if not np.array_equal(log_times(frames, self._rate_hz), stamps):
            raise ValueError("the time of a message is that of no frame")
        packed = {part: self._packed(table, stamps, frames) for part, table in self._tables.items()}
        rows, timing = self._layout.frames(packed[None])
        beside = self._layout.beside(rows, {part: packed[part] for part in self._parts})
        for time in times:
            del self._counts[time]
        runs = [_run(number, times) for number in self._sizes] if times else []
        runs += [_run(number, of) for number, of in self._others.items()]
        until = times[-1] if times else 2**64
        events = sorted((each for each in self._events if each[0] <= until), key=lambda each: each[0])
        runs += [_run(EVENT_CHANNEL, [time for time, _ in events])] if events else []
        self._events = [each for each in self._events if each[0] > until]
        self._others = {}
        return Part(rows, timing, beside, [event for _, event in events], runs, None)

    def _packed(self, table: Table, times: NDArray[np.uint64], frames: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Return the records of ``table`` at these times as the rig writes them, and forget them."""
        packed = np.tile(table.template, (len(times), 1))
        heads = np.zeros(len(times), [("frame", "<u4"), ("time", "<u8"), ("published", "<u8")])
        heads["frame"], heads["time"], heads["published"] = frames, times, times
        head = heads.view(np.uint8).reshape(len(times), heads.itemsize)
        for number, start, end in table.topics:
            held = self._held[number]
            data = b"".join([held.pop(time) for time in times.tolist()])
            begin = start + HEAD.size
            packed[:, begin - head.shape[1] : begin] = head
            packed[:, begin:end] = np.frombuffer(data, np.uint8).reshape(len(times), end - begin)
        constant = table.constant
        if (packed[:, constant] != table.template[constant]).any():
            raise ValueError("a message is not as the rig writes it")
        return packed


def _run(number: int, times: list[int]) -> Run:
    return Run(np.array(times, np.uint64), message_indexes(number, np.zeros((1, len(times)), np.int64)))
