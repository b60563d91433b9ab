"""The structure of an ArduPilot dataflash log: its message formats, and where the rows of each message are.

A message begins with two bytes of mark and one of type; a FMT message gives the length of a type.  A message is
accepted if another one, or the end, is right behind it: there is no checksum.  All other bytes are counted.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.log.recordings.formats.gathered import gathered

MAGIC: Final = b"\xa3\x95\x80"
HEADER: Final = 3  # bytes before the fields of a message
_WINDOW: Final = 1 << 24  # bytes that are searched at once
_KINDS: Final = {  # numpy types of format letters
    **{"b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "c": "<i2", "C": "<u2", "i": "<i4", "I": "<u4"},
    **{"e": "<i4", "E": "<u4", "L": "<i4", "f": "<f4", "d": "<f8", "g": "<f2", "q": "<i8", "Q": "<u8"},
    **{"n": "S4", "N": "S16", "Z": "S64", "a": "V64"},
}
TEXTS: Final = "nNZa"
SCALED: Final = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}  # by the letter itself
_FMT: Final = np.dtype([("Type", "u1"), ("Length", "u1"), ("Name", "S4"), ("Format", "S16"), ("Columns", "S64")])
_FMT_TYPE: Final = 0x80
_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,3}")


@dataclass
class Message:
    """One message: its rows, the letters of its fields, and their units of FMTU."""

    name: str
    letters: dict[str, str]
    kind: np.dtype[Any]
    at: NDArray[np.int64]  # (n,) first byte of each
    units: dict[str, str] | None = None  # of each field; None: there is no FMTU of the message
    factors: dict[str, float] = field(default_factory=dict)  # of MULT
    instance: str = ""  # field that numbers the instances; "" for none


@dataclass
class Dataflash:
    """The messages of a file."""

    data: bytes
    messages: list[Message]
    left_out: int  # bytes
    cut: int = 0  # bytes of the last message, which is not whole

    def column(self, message: Message, name: str, rows: Any = slice(None)) -> NDArray[Any]:
        """Return a field of some rows of a message as it is in the file."""
        fields: Any = message.kind.fields
        kind, offset = fields[name][:2]
        return gathered(self.data, message.at[rows], HEADER + offset, kind)


def read_dataflash(data: bytes) -> Dataflash:
    """Return the structure of a dataflash log."""
    marks = _marks(data)
    types = np.frombuffer(data, np.uint8)[marks + 2]
    formats = _formats(data, marks[types == _FMT_TYPE])
    lengths = np.zeros(256, np.int64)
    for number, (_, kind) in formats.items():
        lengths[number] = HEADER + kind.itemsize
    known = lengths[types] > 0
    marks, types = marks[known], types[known]
    taken = _chain(marks, marks + lengths[types], len(data))
    marks, types = marks[taken], types[taken]
    left = len(data) - int(lengths[types].sum())
    tail = data[int(marks[-1] + lengths[types[-1]]) if len(marks) else 0 :]
    cut = len(tail) if _is_cut(tail, lengths) else 0
    if tail and tail.count(tail[:1]) == len(tail):  # a page that was not filled
        left -= len(tail)
    order = np.argsort(types, kind="stable")
    first = np.searchsorted(types[order], np.arange(257))
    messages: dict[str, Message] = {}
    for number, ((name, letters), kind) in formats.items():
        at = marks[order[first[number] : first[number + 1]]]
        if len(at) and (name not in messages or len(at) > len(messages[name].at)):
            messages[name] = Message(name, letters, kind, at)
    made = Dataflash(data, list(messages.values()), left - cut, cut)
    _add_units(made, messages, formats)
    return made


def _is_cut(tail: bytes, lengths: NDArray[np.int64]) -> bool:
    """Return True if the bytes behind the last message are the beginning of one."""
    if len(tail) < HEADER:
        return len(tail) > 0 and MAGIC.startswith(tail[:2])
    return tail.startswith(MAGIC[:2]) and len(tail) < lengths[tail[2]]


def _marks(data: bytes) -> NDArray[np.int64]:
    """Return all places of the mark that have a type behind them."""
    whole, found = np.frombuffer(data, np.uint8), []
    for first in range(0, max(len(data) - 2, 0), _WINDOW):
        part = whole[first : min(first + _WINDOW + 1, len(data) - 1)]
        found.append(np.flatnonzero((part[:-1] == MAGIC[0]) & (part[1:] == MAGIC[1])) + first)
    return np.concatenate(found) if found else np.empty(0, np.int64)


_Formats = dict[int, tuple[tuple[str, dict[str, str]], np.dtype[Any]]]


def _formats(data: bytes, at: NDArray[np.int64]) -> _Formats:
    """Return name, letters and row of each type that a FMT message at one of ``at`` describes; the first of a type."""
    made: _Formats = {}
    at = at[at + HEADER + _FMT.itemsize <= len(data)]
    first_letter = np.frombuffer(data, np.uint8)[at + HEADER + 2] | 0x20
    for place in at[(first_letter >= ord("a")) & (first_letter <= ord("z"))].tolist():
        row = np.frombuffer(data, _FMT, 1, place + HEADER)[0]
        number, length = int(row["Type"]), int(row["Length"])
        name, format, columns = (row[key].decode("latin-1") for key in ("Name", "Format", "Columns"))
        names = columns.split(",") if columns else []
        if number in made or not _NAME.fullmatch(name) or len(names) != len(format) or len(set(names)) != len(names):
            continue
        if not all(letter in _KINDS for letter in format):
            continue
        kind = np.dtype([(field_name, _KINDS[letter]) for field_name, letter in zip(names, format, strict=True)])
        if kind.itemsize + HEADER == length:
            made[number] = (name, dict(zip(names, format, strict=True))), kind
    return made


def _chain(at: NDArray[np.int64], after: NDArray[np.int64], size: int) -> NDArray[np.bool_]:
    """Return which of the messages from ``at`` to ``after`` follow each other, in a file of ``size`` bytes."""
    count = len(at)
    next_one = np.searchsorted(at, after)
    there = np.append(at, -1)[next_one] == after
    ends = (after == size) | ((next_one == count) & (after < size))
    next_one = np.where(there, next_one, np.where(ends, count, -1))
    breaks = np.flatnonzero(next_one != np.arange(1, count + 1))
    taken, i = np.zeros(count, np.bool_), 0
    for stop in breaks.tolist():
        if stop < i:
            continue
        taken[i:stop] = True
        taken[stop] = next_one[stop] >= 0
        i = int(next_one[stop]) if taken[stop] else stop + 1
    taken[i:] = True
    return taken


def _add_units(log: Dataflash, messages: dict[str, Message], formats: _Formats) -> None:
    """Take units, factors and instances of FMTU."""

    def rows(name: str, *fields: str) -> list[tuple[Any, ...]]:
        message = messages.get(name)
        if message is None or not all(key in message.letters for key in fields):
            return []
        return list(zip(*(log.column(message, key).tolist() for key in fields), strict=True))

    units = {chr(number & 255): label.decode("latin-1") for number, label in rows("UNIT", "Id", "Label")}
    factors = {chr(number & 255): float(f"{factor:.7g}") for number, factor in rows("MULT", "Id", "Mult")}
    for number, unit_ids, factor_ids in rows("FMTU", "FmtType", "UnitIds", "MultIds"):
        if number not in formats or (message := messages.get(formats[number][0][0])) is None:
            continue
        ids = dict(zip(message.letters, unit_ids.decode("latin-1"), strict=False))
        message.units = {name: units.get(ids.get(name, ""), "") for name in message.letters}
        message.instance = next((name for name, of in ids.items() if of == "#"), "")
        for name, of in zip(message.letters, factor_ids.decode("latin-1"), strict=False):
            factor = factors.get(of, 0.0)
            if message.letters[name] not in SCALED and np.isfinite(factor) and factor > 0.0:
                message.factors[name] = factor
