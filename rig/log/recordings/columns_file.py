"""Columns of CSV and Parquet files as numbers."""

from __future__ import annotations

import csv
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet

from rig.core.errors import BadInput
from rig.core.text import quoted
from rig.core.units.conversion import conversion
from rig.log.mcap_messages import most_bytes
from rig.log.recordings.csv_file import Read, TableFormat, arrow_file, once_each, read_csv
from rig.log.recordings.stamps import Floats

TABLES: Final = (".csv", ".parquet")
_FAULTS: Final = (pa.ArrowException, OSError, ValueError, csv.Error)


class Table:
    """The columns of one file; ``column`` gives each as (n,) f8, NaN where a cell is empty."""

    def __init__(
        self, path: Path, wanted: Callable[[str], bool] = lambda _: True, written: TableFormat | None = None
    ) -> None:
        """Read the ``wanted`` columns; BadInput in one line when the file is missing, cut or not of numbers."""
        self.path, self.written = path, written or TableFormat()
        self.remarks: list[str] = []  # what is told of how it was read
        try:
            self._table, self.header, remark, self.units = _READERS[path.suffix](path, wanted, self.written)
        except _FAULTS as error:
            raise BadInput(f"{path}: {_one_line(error)}") from None
        self.names: list[str] = self._table.column_names
        if remark:
            self.remarks.append(f"{path}: {remark}")

    def column(self, name: str) -> Floats:
        """Return the column ``name``, which must be one of ``names``."""
        column = self._table.column(name)
        if column.type != pa.float64():
            try:
                column = column.cast(pa.float64(), safe=False)
            except pa.ArrowException:
                raise BadInput(f"{self.path}: column {name!r} must contain numbers, got {column.type}") from None
        return np.ascontiguousarray(column.to_numpy())

    def arrow(self, name: str) -> Any:
        """Return the column ``name`` as it was read, an array of Arrow in chunks."""
        return self._table.column(name)

    def time_s(self, zero_ns: int | None = None) -> tuple[Floats, int | None]:
        """Return the column of time, s, and of a time of the calendar its zero: ``zero_ns``, or its first row."""
        name = self.written.time_column
        instants = self._table.column(name)
        if not pa.types.is_temporal(instants.type):
            return self.column(name) * conversion(self.time_unit, "s").factor, None
        empty = np.asarray(instants.is_null())
        if empty.all():
            return np.full(len(empty), np.nan), zero_ns
        try:
            instants = instants.cast(_in_ns(instants.type))
            at_ns = np.asarray(instants.cast(pa.int64()).fill_null(0))
        except pa.ArrowException:
            raise BadInput(f"{self.path}: column {name!r} must be a time, got {instants.type}") from None
        first = int(np.argmin(empty))
        if zero_ns is None:
            zero_ns = int(at_ns[first])
            began = str(instants[first].cast(pa.string())).replace(".000000000", "")
            self.remarks.append(f"{self.path}: {name} in seconds since {began}, its first row")
        return np.where(empty, np.nan, (at_ns - zero_ns) / 1e9), zero_ns

    @cached_property
    def time_unit(self) -> str:
        """The unit of times that are numbers: that of CONFIG, otherwise that of a row of units, which is told."""
        given, stated = self.written.time_unit, self.units.get(self.written.time_column)
        if given is not None or stated in (None, "s"):
            return given or "s"
        try:
            conversion(stated or "s", "s")
        except ValueError:
            self.remarks.append(f"{self.path}: row of units: {quoted(stated)} is no unit of time: s is taken")
            return "s"
        self.remarks.append(f"{self.path}: time in {stated}, by its row of units")
        return stated or "s"


def _in_ns(kind: Any) -> Any:
    """Return the type of nanoseconds to which a type of times is cast; a duration stays one."""
    if pa.types.is_duration(kind):
        return pa.duration("ns")
    return pa.time64("ns") if pa.types.is_time(kind) else pa.timestamp("ns", getattr(kind, "tz", None))


def _parquet(path: Path, wanted: Callable[[str], bool], _: TableFormat) -> Read:
    with arrow_file(path) as opened, pyarrow.parquet.ParquetFile(opened) as file:
        header = list(file.schema_arrow.names)
        names = [name for name in header if wanted(name)]
        once_each(path, names)
        needed, most = 8 * len(names) * file.metadata.num_rows, most_bytes(path.stat().st_size)
        if needed > most:
            raise BadInput(f"{path}: expands to {needed} bytes, more than the {most} that a file of its size may")
        return Read(file.read(columns=names), header, "")


_READERS: Final = {".csv": read_csv, ".parquet": _parquet}


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"cannot be read: {error.strerror}"
    text = "".join(letter if letter.isprintable() else " " for letter in str(error))
    return f"cannot be read: {' '.join(text.split())[:200]}"
