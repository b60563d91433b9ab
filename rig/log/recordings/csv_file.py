"""CSV files as recorders and spreadsheets write them: separator, decimal sign and calendar time found by looking.

The separator is the one that splits the header into most columns; a decimal comma is tried where the separator is no
comma and points do not do; a column of time whose first cell is a date or a time of day is read as such.  CONFIG can
set the first two.
"""

from __future__ import annotations

import csv
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO, TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple

import pyarrow as pa
import pyarrow.csv

from rig.core.errors import BadInput
from rig.core.files import open_regular
from rig.core.text import quoted
from rig.log.recordings.stamps import TIME

SEPARATORS: Final = (",", ";", "\t")
DECIMALS: Final = (".", ",")
CONFIG: Final = "docs/reference/recordings.md"
LARGEST_TABLE: Final = 4 << 30  # bytes of a file
_MOST_HEAD: Final = 1 << 20  # bytes in which the header must end
_NO_VALUE: Final = ["", "nan", "NaN", "NAN"]
_CALENDAR: Final = re.compile(r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d[\d:.]*(?P<zone>Z|[+-]\d\d(?::?\d\d)?)?)?")
_OF_DAY: Final = re.compile(r"\d\d:\d\d(?::\d\d(?:\.\d+)?)?")
_CELL: Final = re.compile(r"In CSV column #(\d+): (?:Row #(\d+): )?CSV conversion error to .+?: (.*)", re.DOTALL)
_COUNT: Final = re.compile(r"CSV parse error: (?:Row #(\d+): )?Expected (\d+) columns, got (\d+)")


class TableFormat(NamedTuple):
    """Format of tables, as CONFIG gives it; None: detected from the file."""

    time_column: str = TIME
    time_unit: str = "s"
    separator: str | None = None
    decimal: str | None = None


class Read(NamedTuple):
    """The columns wanted, as numbers but for a time of the calendar; the names of all; what was found by looking."""

    table: Any
    header: list[str]
    found: str


def read_csv(path: Path, wanted: Callable[[str], bool], written: TableFormat) -> Read:
    """Return the ``wanted`` columns of the file.  BadInput in one line: a cell or a row that does not fit."""
    header, first, separator = _head(path, written)
    once_each(path, header)
    columns: dict[str, Any] = dict.fromkeys(filter(wanted, header), pa.float64())
    if not columns:
        return Read(pa.table({}), header, "")
    if written.time_column in columns:
        columns[written.time_column] = _kind_of_time(dict(zip(header, first, strict=False)).get(written.time_column))
    decimals = DECIMALS[:1] if separator == "," else DECIMALS
    refused: tuple[int, str] = (-1, "")
    for decimal in decimals if written.decimal is None else [written.decimal]:
        try:
            table = _read(path, columns, separator, decimal)
        except pa.ArrowInvalid as error:
            refused = max(refused, _refusal(str(error), header, columns))
        else:
            return Read(table, header, _found(written, separator, decimal))
    raise BadInput(f"{path}: {refused[1]}")


def once_each(path: Path, names: list[str]) -> None:
    """Raise BadInput if a column is given twice."""
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise BadInput(f"{path}: column {twice[0]!r} is given twice")


def _head(path: Path, written: TableFormat) -> tuple[list[str], list[str], str]:
    """Return the names of the columns, the cells of the first row, and the separator."""
    with open_regular(path, LARGEST_TABLE) as opened:
        data = opened.read(_MOST_HEAD)
    if len(data) == _MOST_HEAD:
        data = data[: max(data.rfind(b"\n"), data.rfind(b"\r")) + 1]
        if not data:
            raise BadInput(f"{path}: not a table: its first line is longer than {_MOST_HEAD >> 20} MiB")
    try:
        with TextIOWrapper(BytesIO(data), encoding="utf-8-sig", newline="") as file:
            line = file.readline()
            separator = written.separator or max(SEPARATORS, key=lambda sign: len(_cells(line, sign)))
            file.seek(0)
            rows = list(islice(csv.reader(file, delimiter=separator), 2))
    except UnicodeDecodeError:
        raise BadInput(f"{path}: must be encoded in UTF-8") from None
    header, first = (*rows, [], [])[:2]
    return header, first, separator


def _cells(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator), [])


def _kind_of_time(cell: str | None) -> Any:
    """Return the type of a column of time that begins with ``cell``."""
    if (dated := _CALENDAR.fullmatch(cell or "")) is not None:
        return pa.timestamp("ns", "UTC" if dated["zone"] else None)
    return pa.time64("ns") if _OF_DAY.fullmatch(cell or "") else pa.float64()


def _read(path: Path, columns: dict[str, Any], separator: str, decimal: str) -> Any:
    parse = pyarrow.csv.ParseOptions(delimiter=separator)
    convert = pyarrow.csv.ConvertOptions(
        column_types=columns,
        include_columns=list(columns),
        null_values=_NO_VALUE,
        check_utf8=False,
        decimal_point=decimal,
    )
    try:
        return _columns(path, pyarrow.csv.ReadOptions(), parse, convert)
    except pa.ArrowInvalid:  # one thread knows the number of the row
        return _columns(path, pyarrow.csv.ReadOptions(use_threads=False), parse, convert)


def _columns(path: Path, *options: Any) -> Any:
    """Return the table in a file that is opened here: its name need not be UTF-8."""
    with arrow_file(path) as file:
        return pyarrow.csv.read_csv(file, *options)


@contextmanager
def arrow_file(path: Path) -> Iterator[pa.NativeFile]:
    """Open a table as a file of Arrow's own; BadInput as of ``open_regular``.

    A thread of Arrow lets go of its file after the table is read: of Python's when the process ends, that aborts it.
    """
    with open_regular(path, LARGEST_TABLE), pa.OSFile(os.fsencode(path)) as file:
        yield file


def _refusal(error: str, header: list[str], columns: dict[str, Any]) -> tuple[int, str]:
    """Return the row, from 1 below the header, at which pyarrow stopped, and why in the rig's words."""
    if (cell := _CELL.match(error)) is not None:
        row, name = int(cell[2] or 1) - 1, header[int(cell[1])]
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
        row = int(count[1] or 1) - 1
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
