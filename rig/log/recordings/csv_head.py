"""The head of a CSV file: which line names the columns, what stands before it, and a row of units behind it.

Decoders and spreadsheets write comments (#), a block of settings before the header, blanks beside separators, quotes, a
separator at the end of each line, a column without a name, and a row of units.  Units are used; anything else beside
names and numbers is left out, and told if it may matter.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from rig.core.errors import BadInput
from rig.core.files import open_regular

SEPARATORS: Final = (",", ";", "\t")
LARGEST_TABLE: Final = 4 << 30  # bytes of a file
COMMENT: Final = "#"
_MOST_HEAD: Final = 1 << 20  # bytes in which the header must end
_MOST_LINES: Final = 2000  # before the header
_LINE: Final = re.compile(rb"[^\r\n]*(?:\r\n|\r|\n|$)")
_BOM: Final = b"\xef\xbb\xbf"
_BRACKETS: Final = {"[": "]", "(": ")", "{": "}"}


class Head(NamedTuple):
    """The contents of a file before its rows."""

    separator: str
    names: list[str]  # of the columns; "" has none
    first: list[str]  # cells of the first row
    plain: bool  # the names are the first line, and nothing else stands before the rows
    begin: int  # byte at which the rows begin
    units: dict[str, str]  # by column, of a row of units
    remarks: list[str]
    blanks: bool  # beside separators, in a cell that is no number

    @property
    def unique(self) -> list[str]:
        """The names, each of those that are none replaced by one that no column has."""
        return [name or f"\0{place}" for place, name in enumerate(self.names)]


class _Line(NamedTuple):
    number: int  # from 1
    begin: int
    text: str

    @property
    def is_comment(self) -> bool:
        return self.text.lstrip().startswith(COMMENT)


def head_of(path: Path, time_column: str, separator: str | None) -> Head:
    """Return the head of the file at ``path``.  BadInput: no text in UTF-8, a first line without an end."""
    lines = list(_lines(path))
    rows = [line for line in lines if not line.is_comment]
    found = _header(lines, rows, time_column, separator)
    if found is None:
        return Head(separator or SEPARATORS[0], [], [], True, 0, {}, [], False)
    line, text, sign = found
    cells, names = _cells(text, sign), _names(text, sign)
    behind = [row for row in rows if row.begin > line.begin]
    units, remarks = dict[str, str](), list[str]()
    is_table = time_column in names and bool(behind)
    if is_table and _is_of_units(unit_cells := _names(behind[0].text, sign), names):
        units = {name: unit for name, cell in zip(names, unit_cells, strict=False) if name and (unit := _bare(cell))}
        behind = behind[1:]
    raw = _cells(behind[0].text, sign) if behind else []
    first = [cell.strip() for cell in raw]
    width = _width(names, first)
    names, unnamed = (names + [""] * width)[:width], len(names) > width or width > len(names)
    nameless = [place for place, name in enumerate(names, 1) if not name and (first + [""] * width)[place - 1]]
    if nameless:
        remarks.append(f"column {', '.join(map(str, nameless))} has no name: left out")
    if line.number > 1 and (before := [row for row in rows if row.begin < line.begin]):
        remarks.append(f"columns are named in line {line.number}; {len(before)} lines before it were left out")
    plain = line.number == 1 and cells == names and not (units or unnamed or line.is_comment) and all(names)
    begin = behind[0].begin if behind else lines[-1].begin + len(lines[-1].text.encode()) + 2
    blanks = any(cell != cell.strip() and not is_number(cell) for cell in raw)
    return Head(sign, names, first, plain and not blanks, begin, units, remarks, blanks)


def is_number(cell: str) -> bool:
    """Return True if a cell is a number with either decimal sign; nan is one, an empty cell is none."""
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _lines(path: Path) -> Iterator[_Line]:
    """Yield the lines at the beginning of a file that are not empty."""
    with open_regular(path, LARGEST_TABLE) as opened:
        data = opened.read(_MOST_HEAD)
    if len(data) == _MOST_HEAD:
        data = data[: max(data.rfind(b"\n"), data.rfind(b"\r")) + 1]
        if not data:
            raise BadInput(f"{path}: not a table: its first line is longer than {_MOST_HEAD >> 20} MiB")
    number, at = 0, len(_BOM) if data.startswith(_BOM) else 0
    while at < len(data):
        found = _LINE.match(data, at)
        if found is None:
            return
        number += 1
        try:
            text = found[0].decode("utf-8").rstrip("\r\n")
        except UnicodeDecodeError:
            raise BadInput(f"{path}: must be encoded in UTF-8") from None
        if text.strip():
            yield _Line(number, at, text)
        at = found.end()


def _header(
    lines: Sequence[_Line], rows: Sequence[_Line], time_column: str, separator: str | None
) -> tuple[_Line, str, str] | None:
    """Return the line of the names, its text, and the separator; None: there is no line but comments.

    It is the first line, unless that has no time column and a later one, or a comment before the rows, has one.
    """

    def of(line: _Line, text: str) -> tuple[_Line, str, str]:
        return line, text, separator or max(SEPARATORS, key=lambda sign: len(_cells(text, sign)))

    if not rows:
        return None
    usual = of(rows[0], rows[0].text)
    if time_column in _names(*usual[1:]):
        return usual
    before = [line for line in lines if line.is_comment and line.begin < rows[0].begin]
    for line in [*reversed(before), *rows[1:_MOST_LINES]]:
        found = of(line, line.text.strip().lstrip(COMMENT) if line.is_comment else line.text)
        if time_column in _names(*found[1:]):
            return found
    return usual


def _cells(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator), [])


def _names(line: str, separator: str) -> list[str]:
    """Return the cells of a line without blanks about them, also where those stand before quotes."""
    blank = separator != " "
    return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=blank), [])]


def _width(names: Sequence[str], first: Sequence[str]) -> int:
    """Return how many columns the rows have, where those that are more, or less, have neither name nor value."""
    longer, shorter = (names, first) if len(names) > len(first) else (first, names)
    return len(first) if first and not any(longer[len(shorter) :]) else len(names)


def _is_of_units(cells: Sequence[str], names: Sequence[str]) -> bool:
    """Return True if a row has a cell for each name, words in some of them and no number."""
    words = [cell for cell in cells if cell]
    is_whole = _width(names, cells) <= min(len(names), len(cells)) and bool(words)
    return is_whole and not any(is_number(cell) or cell[:1].isdecimal() for cell in words)


def _bare(cell: str) -> str:
    """Return a unit without brackets; "" for a dash."""
    if cell[:1] in _BRACKETS and cell.endswith(_BRACKETS[cell[0]]):
        cell = cell[1:-1].strip()
    return "" if cell in ("-", "1") else cell
