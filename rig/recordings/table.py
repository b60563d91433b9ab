"""Columns of CSV and Parquet files as numbers."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from rig.errors import BadInput
from rig.log.export import TABLE_WRITERS
from rig.log.messages import most_bytes
from rig.recordings.clock import Floats

TABLES: Final = tuple(TABLE_WRITERS)
_NO_VALUE: Final = ["", "nan", "NaN", "NAN"]
_FAULTS: Final = (pa.ArrowException, OSError, ValueError, csv.Error)


class Table:
    """The columns of one file; ``column`` gives each as (n,) f8, NaN where a cell is empty."""

    def __init__(self, path: Path, wanted: Callable[[str], bool] = lambda _: True) -> None:
        """Read the ``wanted`` columns; BadInput in one line when the file is missing, cut or not of numbers."""
        self.path = path
        try:
            self._table = _csv(path, wanted) if path.suffix == ".csv" else _parquet(path, wanted)
        except FileNotFoundError:
            raise BadInput(f"{path}: no such file") from None
        except _FAULTS as error:
            raise BadInput(f"{path}: {_one_line(error)}") from None
        self.names: list[str] = self._table.column_names

    def column(self, name: str) -> Floats:
        """Return the column ``name``, which must be one of ``names``."""
        column = self._table.column(name)
        if column.type != pa.float64():
            try:
                column = column.cast(pa.float64(), safe=False)
            except pa.ArrowException:
                raise BadInput(f"{self.path}: column {name!r} is not of numbers but of {column.type}") from None
        return np.ascontiguousarray(column.to_numpy())


def _csv(path: Path, wanted: Callable[[str], bool]) -> Any:
    with path.open(encoding="utf-8-sig", newline="") as file:
        header = next(csv.reader(file), [])
    _once_each(path, header)
    numbers = dict.fromkeys(filter(wanted, header), pa.float64())
    convert = pyarrow.csv.ConvertOptions(
        column_types=numbers, include_columns=list(numbers), null_values=_NO_VALUE, check_utf8=False
    )
    if not numbers:
        return pa.table({})
    try:
        return pyarrow.csv.read_csv(path, convert_options=convert)
    except pa.ArrowInvalid:  # one thread knows the number of the row
        slow = pyarrow.csv.ReadOptions(use_threads=False)
        return pyarrow.csv.read_csv(path, read_options=slow, convert_options=convert)


def _once_each(path: Path, names: list[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise BadInput(f"{path}: column {twice[0]!r} is there twice")


def _parquet(path: Path, wanted: Callable[[str], bool]) -> Any:
    with pyarrow.parquet.ParquetFile(path) as file:
        names = [name for name in file.schema_arrow.names if wanted(name)]
        _once_each(path, names)
        needed, most = 8 * len(names) * file.metadata.num_rows, most_bytes(path.stat().st_size)
        if needed > most:
            raise BadInput(f"{path}: expands to {needed} bytes, more than the {most} that a file of its size may")
        return file.read(columns=names)


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"cannot be read: {error.strerror}"
    text = "".join(letter if letter.isprintable() else " " for letter in str(error))
    return f"cannot be read: {' '.join(text.split())[:200]}"
