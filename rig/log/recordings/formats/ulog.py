"""The structure of a ULog file: its message formats, its topics, and where the rows of each topic are.

The file is a chain of messages, each with its size and a letter.  The values stay where they are: a column is read
when it is asked for.  A message that cannot be one breaks the chain; the next link is the next place where a few
messages follow each other.  The bytes between are counted.

https://docs.px4.io/main/en/dev_log/ulog_file_format.html
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np

from rig.core.errors import BadInput

MAGIC: Final = b"ULog\x01\x12\x35"
HEADER: Final = 16  # bytes before the first message
_HEAD: Final = 3  # bytes of size and letter
_WIDEST: Final = 65_535  # bytes of a message
_DEEPEST: Final = 10  # formats within each other
_WINDOW: Final = 1 << 20  # bytes that are searched at once
_TYPES: Final = {
    **{"int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4", "uint32_t": "<u4"},
    **{"int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8", "bool": "i1", "char": "i1"},
}
_DATA: Final = ord("D")
_SIZES: Final = {  # bytes of other messages, least and most
    **{ord("F"): (3, _WIDEST), ord("A"): (4, _WIDEST), ord("B"): (40, 256), ord("I"): (4, _WIDEST)},
    **{ord("M"): (5, _WIDEST), ord("P"): (4, _WIDEST), ord("Q"): (5, _WIDEST), ord("R"): (2, 2)},
    **{ord("S"): (8, 8), ord("O"): (2, 2), ord("L"): (9, _WIDEST), ord("C"): (11, _WIDEST)},
}
_LETTERS: Final = np.isin(np.arange(256), [_DATA, *_SIZES])
_CHAIN: Final = 4  # messages in a row that are no accident
_USUAL: Final = 1_500  # bytes of a message that is no data
_SYNC: Final = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"


class Field(NamedTuple):
    """A field of a message format; ``length`` 0: no array."""

    kind: str
    length: int
    name: str


@dataclass
class TopicRows:
    """The rows of one topic: ``at`` is the first byte of each; ``kind`` None: its format is not known."""

    name: str
    multi_id: int
    kind: np.dtype[Any] | None
    least: int = 0  # bytes of a data message
    most: int = _WIDEST
    at: array[int] = field(default_factory=lambda: array("q"))

    @property
    def fields(self) -> Mapping[str, tuple[np.dtype[Any], int]]:
        """Return type and place in a row of each field, in their order."""
        kind = self.kind if self.kind is not None else np.dtype([])
        of: Any = kind.fields or {}
        return {name: (of[name][0], of[name][1]) for name in kind.names or ()}


@dataclass
class Ulog:
    """The topics of a file."""

    data: bytes
    topics: list[TopicRows] = field(default_factory=list)
    dropouts: int = 0
    lost_s: float = 0.0  # by the logger
    left_out: int = 0  # bytes
    cut: int = 0  # bytes of the last message, which is not whole


def read_ulog(data: bytes, where: str) -> Ulog:
    """Return the structure of a ULog.  BadInput: made by a version that cannot be read."""
    return _Walk(data, where).run()


class _Walk:
    """One pass over the file."""

    def __init__(self, data: bytes, where: str) -> None:
        self._data, self._where = data, where
        self._ulog = Ulog(data)
        self._formats: dict[str, list[Field]] = {}
        self._by_id: dict[int, TopicRows] = {}
        self._limits: list[int] = [len(data)]  # where appended data begin, and the end
        self._least, self._most = np.full(65536, 1, np.int32), np.zeros(65536, np.int32)  # of each id: none
        self._found, self._searched = np.empty(0, np.int64), (0, 0)

    def run(self) -> Ulog:
        """Walk from message to message."""
        data, by_id, at = self._data, self._by_id, HEADER
        while True:
            limit = self._limits[0]
            if at + _HEAD > limit:
                if len(self._limits) == 1:
                    self._ulog.cut += limit - at
                    break
                self._ulog.left_out += limit - at
                at = self._limits.pop(0)
                continue
            size, letter = data[at] | data[at + 1] << 8, data[at + 2]
            after = at + _HEAD + size
            if letter == _DATA and after <= limit and size > 1:
                topic = by_id.get(data[at + 3] | data[at + 4] << 8)
                if topic is not None and topic.least <= size <= topic.most:
                    topic.at.append(at + 5)
                    at = after
                    continue
            elif after <= limit and self._is_other(letter, size, at) and self._has_its_size(at, after):
                self._take(letter, at + _HEAD, after)
                at = after
                continue
            next_at = after if after < limit and self._is_message(after) else self._next(at + 1)
            if next_at == len(data) < after and self._begins(at):
                self._ulog.cut = next_at - at
            else:
                self._ulog.left_out += next_at - at
            at = next_at
        self._count_unread()
        return self._ulog

    def _is_other(self, letter: int, size: int, at: int) -> bool:
        """Return True for a message that is no data."""
        if letter not in _SIZES:
            return False
        least, most = _SIZES[letter]
        return least <= size <= most and (letter != ord("S") or self._data[at + 3 : at + 11] == _SYNC)

    def _has_its_size(self, at: int, after: int) -> bool:
        """Return True unless other messages begin within the message from ``at`` to ``after``, and none behind it."""
        return after == self._limits[0] or self._is_message(after) or self._next(at + 1) >= after

    def _is_message(self, at: int) -> bool:
        """Return True if a message may begin at ``at``."""
        return at + 5 <= self._limits[0] and self._begins(at)

    def _begins(self, at: int) -> bool:
        """Return True if the bytes from ``at`` on are the head of a message, whether it is whole or not."""
        data = self._data
        if at + 5 > len(data):
            return True
        size, letter = data[at] | data[at + 1] << 8, data[at + 2]
        if letter == _DATA:
            topic = self._by_id.get(data[at + 3] | data[at + 4] << 8)
            return topic is not None and topic.least <= size <= topic.most
        return self._is_other(letter, size, at)

    def _next(self, at: int) -> int:
        """Return the next place from ``at`` on where the chain can go on; else the end."""
        limit = self._limits[0]
        while at + 5 <= limit:
            first, last = self._searched
            if not first <= at < last:
                self._search(at, limit)
                first, last = self._searched
            for place in self._found[np.searchsorted(self._found, at) :].tolist():
                if self._is_chain(place):
                    return place
            at = last
        return limit

    def _is_chain(self, at: int) -> bool:
        """Return True if data with a message behind them begin at ``at``, or a few other messages."""
        for _ in range(2 if self._data[at + 2] == _DATA else _CHAIN):
            if at == self._limits[0]:
                return True
            if not self._is_message(at):
                return False
            at += _HEAD + (self._data[at] | self._data[at + 1] << 8)
        return at <= self._limits[0]

    def _search(self, at: int, limit: int) -> None:
        """Find the places in a window from ``at`` on that look like the beginning of a message."""
        last = min(at + _WINDOW, limit - 4)
        part = np.frombuffer(self._data, np.uint8, last + 4 - at, at)
        letters = np.flatnonzero(_LETTERS[part[2:-2]])
        sizes = part[letters].astype(np.int32) | part[letters + 1].astype(np.int32) << 8
        ids = part[letters + 3].astype(np.int32) | part[letters + 4].astype(np.int32) << 8
        is_data = part[letters + 2] == _DATA
        fits = np.where(is_data, (sizes >= self._least[ids]) & (sizes <= self._most[ids]), sizes <= _USUAL)
        self._found, self._searched = letters[fits] + at, (at, last)

    def _take(self, letter: int, at: int, after: int) -> None:
        """Take a message that is no data."""
        data = self._data
        if letter == ord("F"):
            name, colon, fields = data[at:after].decode("utf-8", "ignore").partition(":")
            if colon and (made := _fields(fields)) is not None:
                self._formats[name] = made
        elif letter == ord("A"):
            self._subscribe(data[at], data[at + 1] | data[at + 2] << 8, data[at + 3 : after].decode("utf-8", "ignore"))
        elif letter == ord("O"):
            self._ulog.dropouts += 1
            self._ulog.lost_s += (data[at] | data[at + 1] << 8) / 1e3
        elif letter == ord("B") and at == HEADER + _HEAD:
            self._flags(data[at:after])

    def _flags(self, flags: bytes) -> None:
        """Take the flags of the file.  BadInput: one that changes the format and is not known."""
        unknown = flags[8] & ~1 or any(flags[9:16])
        if unknown:
            raise BadInput(f"{self._where}: a ULog of a version that is not known (incompatible flags)")
        begin = [offset for offset in struct.unpack_from("<3Q", flags, 16) if HEADER < offset < len(self._data)]
        self._limits = [*sorted(begin), len(self._data)] if flags[8] & 1 else [len(self._data)]

    def _subscribe(self, multi_id: int, number: int, name: str) -> None:
        """Take the number of a topic."""
        kind, padding = _flat(name, self._formats)
        topic = TopicRows(name, multi_id, kind)
        if kind is not None:
            topic.least, topic.most = 2 + kind.itemsize, 2 + kind.itemsize + padding
        before = self._by_id.get(number)
        if before is not None and (before.name, before.multi_id, before.kind) == (name, multi_id, kind):
            return
        self._by_id[number] = topic
        self._ulog.topics.append(topic)
        self._least[number], self._most[number] = topic.least, topic.most
        self._searched = (0, 0)

    def _count_unread(self) -> None:
        """Count the rows of topics whose format is not known as left out."""
        for topic in self._ulog.topics:
            if topic.kind is None:
                for at in topic.at:
                    self._ulog.left_out += _HEAD + (self._data[at - 5] | self._data[at - 4] << 8)
        self._ulog.topics = [topic for topic in self._ulog.topics if topic.kind is not None and len(topic.at)]


def _fields(text: str) -> list[Field] | None:
    """Return the fields of a format, ``float[3] x;uint8_t y;``; None: it is damaged."""
    made = []
    for part in filter(None, text.split(";")):
        kind, blank, name = part.strip().partition(" ")
        kind, bracket, rest = kind.partition("[")
        count = rest.removesuffix("]")
        if not (blank and kind and name) or (
            bracket and not (count.isdecimal() and count.isascii() and len(count) < 6)
        ):
            return None
        made.append(Field(kind, int(count) if bracket else 0, name))
    return made


def _flat(name: str, formats: dict[str, list[Field]]) -> tuple[np.dtype[Any] | None, int]:
    """Return the row of a topic, nested formats as ``a.b[0]``, and the bytes of padding behind it, which may be absent.

    None: a format is missing, contains itself, or is larger than a message can be.
    """
    made: list[tuple[str, str]] = []

    def add(of: str, prefix: str, depth: int) -> bool:
        if not formats.get(of) or depth > _DEEPEST:
            return False
        for kind, count, field_name in formats[of]:
            for i in range(max(count, 1)):
                full = f"{prefix}{field_name}[{i}]" if count else f"{prefix}{field_name}"
                if kind in _TYPES:
                    made.append((full, _TYPES[kind]))
                elif not add(kind, f"{full}.", depth + 1):
                    return False
                if len(made) > _WIDEST:
                    return False
        return True

    if not add(name, "", 0) or len({field_name for field_name, _ in made}) < len(made):
        return None, 0
    padding = 0
    while made and made[-1][0].startswith("_padding"):
        padding += np.dtype(made.pop()[1]).itemsize
    kind = np.dtype(made)
    fits = kind.itemsize > 0 and kind.itemsize + padding + 2 <= _WIDEST
    return (kind, padding) if fits and ("timestamp", "<u8") in made else (None, 0)
