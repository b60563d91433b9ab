"""CSV files as recorders and spreadsheets write them: separator, decimal sign and calendar time found by looking.

The separator is the one that splits the header into most columns; a decimal comma is tried where the separator is no
comma and points do not do; a column of time whose first cell is a date or a time of day is read as such.  CONFIG can
set the first two.  csv_head.py finds the header; lines that begin with # are left out.
"""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import pyarrow as pa
import pyarrow.csv

from rig.core.errors import BadInput
from rig.core.files import open_regular
from rig.core.text import quoted
from rig.log.recordings.csv_head import LARGEST_TABLE, Head, head_of
from rig.log.recordings.stamps import TIME

DECIMALS: Final = (".", ",")
CONFIG: Final = "docs/reference/recordings.md"
_MOST_BLANKS: Final = 16  # of a cell without a value
_NO_VALUE: Final = [" " * n + text for text in ("", "nan", "NaN", "NAN") for n in range(_MOST_BLANKS)]
_COMMENT: Final = re.compile(rb"(?m)(?<![^\r\n])[ \t]*#[^\r\n]*(?:\r\n|\r|\n|$)")
_PART: Final = 1 << 24  # bytes that are searched at once
_CALENDAR: Final = re.compile(r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d[\d:.]*(?P<zone>Z|[+-]\d\d(?::?\d\d)?)?)?")
_OF_DAY: Final = re.compile(r"\d\d:\d\d(?::\d\d(?:\.\d+)?)?")
_CELL: Final = re.compile(r"In CSV column #(\d+): (?:Row #(\d+): )?CSV conversion error to .+?: (.*)", re.DOTALL)
_COUNT: Final = re.compile(r"CSV parse error: (?:Row #(\d+): )?Expected (\d+) columns, got (\d+)")


class TableFormat(NamedTuple):
    """Format of tables, as CONFIG gives it; None: detected from the file."""

    time_column: str = TIME
    time_unit: str | None = None  # None: of the row of units, else s
    separator: str | None = None
    decimal: str | None = None


class Read(NamedTuple):
    """The columns wanted, as numbers but for a time of the calendar; the names of all; what was found by looking."""

    table: Any
    header: list[str]
    found: str
    units: Mapping[str, str] = {}  # by column, of a row of units


def read_csv(path: Path, wanted: Callable[[str], bool], written: TableFormat) -> Read:
    """Return the ``wanted`` columns of the file.  BadInput in one line: a cell or a row that does not fit."""
    head = head_of(path, written.time_column, written.separator)
    header, separator = [name for name in head.names if name], head.separator
    once_each(path, header)
    columns: dict[str, Any] = dict.fromkeys(filter(wanted, header), pa.float64())
    if not columns:
        return Read(pa.table({}), header, "")
    if written.time_column in columns:
        columns[written.time_column] = _kind_of_time(
            dict(zip(head.names, head.first, strict=False)).get(written.time_column)
        )
    decimals = DECIMALS[:1] if separator == "," else DECIMALS
    refused: tuple[int, str] = (-1, "")
    source = _Source(path, head, _comments(path, head.begin))
    for decimal in decimals if written.decimal is None else [written.decimal]:
        try:
            table = _read(source, columns, separator, decimal)
        except pa.ArrowInvalid as error:
            refused = max(refused, _refusal(str(error), source, columns))
        else:
            found = [_found(written, separator, decimal), *head.remarks, *source.remarks]
            return Read(table, header, "; ".join(filter(None, found)), head.units)
    raise BadInput(f"{path}: {refused[1]}")


def once_each(path: Path, names: list[str]) -> None:
    """Raise BadInput if a column is given twice."""
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise BadInput(f"{path}: column {twice[0]!r} is given twice")


class _Source(NamedTuple):
    """A file and how its rows are given to pyarrow: as they are, or from behind the head on and without comments."""

    path: Path
    head: Head
    comments: int

    @property
    def plain(self) -> bool:
        """True if pyarrow reads the file from its first byte on."""
        return self.head.plain and not self.comments

    @property
    def remarks(self) -> list[str]:
        """Remarks for the user."""
        return [f"{self.comments} lines that begin with # were left out"] if self.comments else []

    @property
    def columns(self) -> list[str]:
        """The names of all columns of a row."""
        return self.head.names if self.plain else self.head.unique

    @contextmanager
    def opened(self) -> Iterator[Any]:
        """Open what pyarrow reads."""
        with arrow_file(self.path) as file:
            if self.plain:
                yield file
                return
            file.seek(min(self.head.begin, file.size()))
            if not (self.comments or self.head.blanks):
                yield file
                return
            data = _COMMENT.sub(b"", file.read()) if self.comments else file.read()
            if self.head.blanks:
                sign = re.escape(self.head.separator.encode())
                blank = rb"[ \t]" if self.head.separator != "\t" else rb" "
                data = re.sub(rb"(?m)" + blank + rb"*(" + sign + rb"|$)" + blank + rb"*", rb"\1", data)
            yield pa.BufferReader(data)


def _comments(path: Path, begin: int) -> int:
    """Return how many lines from byte ``begin`` on are comments."""
    count = 0
    with open_regular(path, LARGEST_TABLE) as file:
        file.seek(begin)
        while part := file.read(_PART):
            part += file.readline()
            count += sum(1 for _ in _COMMENT.finditer(part)) if b"#" in part else 0
    return count


def _kind_of_time(cell: str | None) -> Any:
    """Return the type of a column of time that begins with ``cell``."""
    if (dated := _CALENDAR.fullmatch(cell or "")) is not None:
        return pa.timestamp("ns", "UTC" if dated["zone"] else None)
    return pa.time64("ns") if _OF_DAY.fullmatch(cell or "") else pa.float64()


def _read(source: _Source, columns: dict[str, Any], separator: str, decimal: str) -> Any:
    parse = pyarrow.csv.ParseOptions(delimiter=separator)
    convert = pyarrow.csv.ConvertOptions(
        column_types=columns,
        include_columns=list(columns),
        null_values=_NO_VALUE,
        check_utf8=False,
        decimal_point=decimal,
    )
    try:
        return _columns(source, True, parse, convert)
    except pa.ArrowInvalid:  # one thread knows the number of the row
        return _columns(source, False, parse, convert)


def _columns(source: _Source, use_threads: bool, *options: Any) -> Any:
    """Return the table in a file that is opened here: its name need not be UTF-8."""
    names = {} if source.plain else {"column_names": source.columns}
    with source.opened() as file:
        try:
            return pyarrow.csv.read_csv(file, pyarrow.csv.ReadOptions(use_threads=use_threads, **names), *options)
        except pa.ArrowInvalid as error:
            if source.plain or "Empty CSV" not in str(error):
                raise
            empty: list[Any] = [pa.array([], kind) for kind in options[1].column_types.values()]
            return pa.table(empty, list(options[1].column_types))


@contextmanager
def arrow_file(path: Path) -> Iterator[pa.NativeFile]:
    """Open a table as a file of Arrow's own; BadInput as of ``open_regular``.

    A thread of Arrow lets go of its file after the table is read: of Python's when the process ends, that aborts it.
    """
    with open_regular(path, LARGEST_TABLE), pa.OSFile(os.fsencode(path)) as file:
        yield file


def _refusal(error: str, source: _Source, columns: dict[str, Any]) -> tuple[int, str]:
    """Return the row, from 1 below the header, at which pyarrow stopped, and why in the rig's words."""
    above = 1 if source.plain else 0  # rows that pyarrow counts and we do not
    if (cell := _CELL.match(error)) is not None:
        row, name = int(cell[2] or 1) - above, source.columns[int(cell[1])]
        value = re.search(r"'(.*)'", cell[3], re.DOTALL)
        got = quoted(value[1] if value else cell[3])
        if name in columns and columns[name] != pa.float64():
            return row, f"row {row}, column {name!r}: {got} is not a time like that of the first row"
        time = ", or for time 2024-05-01T12:00:00.02" if name == next(iter(columns)) else ""
        return row, (
            f"row {row}, column {name!r}: {got} is not a number (empty or nan: no sample{time}); "
            f"separator, decimal, time_column and [mapping] of CONFIG: {CONFIG}"
        )
    if (count := _COUNT.match(error)) is not None:
        row = int(count[1] or 1) - above
        return row, (
            f"row {row} has {count[3]} cells, the header {count[2]}; "
            f"a cut file, or another separator or decimal in CONFIG: {CONFIG}"
        )
    text = "".join(letter if letter.isprintable() else " " for letter in error)
    return 0, f"cannot be read as CSV: {' '.join(text.split())[:200]}"


def _found(written: TableFormat, separator: str, decimal: str) -> str:
    """Say which separator and decimal sign were found, where they are not the usual ones."""
    parts = []
    if written.separator is None and separator != ",":
        parts.append(f"columns separated by {'tabs' if separator == chr(9) else repr(separator)}")
    if written.decimal is None and decimal != ".":
        parts.append("decimal comma")
    return ", ".join(parts)
