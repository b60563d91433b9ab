"""A log as a file: CSV, Parquet or NumPy's npz, with the columns of rig/log/columns.py.

Enums are words in CSV and Parquet and numbers in npz.  Units are metadata of the columns in Parquet, ``unit``; CSV and
npz have no place for them that every reader knows, so they stand beside, in ``<file>.units.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow.parquet import ParquetWriter

from rig.core.blocks import in_blocks
from rig.core.errors import BadInput, RigError
from rig.core.files import replaced, write_text
from rig.core.frame import FLAT, SIGNALS, Block, Table
from rig.core.text import choices, quoted
from rig.log import Log
from rig.log.columns import (
    OWNERS,
    PART_OWNERS,
    TIME,
    Column,
    chosen,
    chosen_of_parts,
    name,
    of_columns,
    part_owners,
    unit_of,
)
from rig.log.log_file import iter_blocks
from rig.log.scan import About

_FOR_VOTE: Final = ("channels", "ilm", "reference")
UNITS: Final = ".units.json"  # behind the name of a CSV or npz
ENDINGS: Final = ("csv", "parquet", "npz")
GROUP_BYTES: Final = 1 << 24  # of columns that are written at once
Group = dict[str, NDArray[Any]]  # (n,) columns by name, time first


class Exported(NamedTuple):
    """An exported table: the names of the columns, and the number of rows."""

    columns: list[str]
    rows: int
    units: dict[str, str]  # SI, of the columns that have one


def export(log: Log | Path, to: str, out: Path, owners: Sequence[str] = (), for_vote: bool = False) -> Exported:
    """Write the columns of ``owners`` (signals, discretes, topics; all when empty) to ``out``.

    log      : read, or its path; a file is read and written block by block, but for npz, whose columns are held
    for_vote : only what ``rig vote`` reads, samples that the sensor flags left empty
    BadInput: an unknown owner or ending, a folder that is not there; BadLog; RigError when the disk does not take it.
    """
    if to not in ENDINGS:
        raise BadInput(f"--to {to}: allowed: {', '.join(ENDINGS)}")
    with replaced(out) as part:
        described, groups = _read(log, owners, for_vote)
        try:
            rows = _WRITERS[to](part, groups, described)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise RigError(f"{out}: cannot be written: {' '.join(str(error).split())[:200]}") from None
    units = units_of(described)
    write_units(out, units)
    return Exported([TIME, *described], rows, units)


def write_units(out: Path, units: Mapping[str, str]) -> None:
    """Write the units of a table beside it, unless it has them in itself."""
    if out.suffix != ".parquet":
        write_text(out.with_name(f"{out.name}{UNITS}"), f"{json.dumps(units, indent=1)}\n")


def parquet_with_units(table: pa.Table, units: Mapping[str, str]) -> pa.Table:
    """Return the table with the unit of each column that has one in the column's metadata."""
    described = [
        field.with_metadata({**(field.metadata or {}), "unit": units[field.name]}) if field.name in units else field
        for field in table.schema
    ]
    return table.cast(pa.schema(described))


def units_of(described: dict[str, Column]) -> dict[str, str]:
    """Return the SI units of the columns that have one, by name; time first."""
    of = {key: unit_of(column.path) for key, column in described.items()}
    return {TIME: "s", **{key: unit for key, unit in of.items() if unit}}


def _read(log: Log | Path, owners: Sequence[str], for_vote: bool) -> tuple[dict[str, Column], Iterator[Group]]:
    """Return the wanted columns by their names in the table, and their values, time first, group by group."""
    about = About()
    blocks = iter_blocks(log, about) if isinstance(log, Path) else log.blocks()
    first = next(blocks, Table(np.empty(0, FLAT)))
    described = {name(column): column for column in _chosen(first, owners, for_vote)}
    rate_hz = about.rate_hz if isinstance(log, Path) else log.rate_hz
    held = (_narrowed(block, described, for_vote) for block in chain([first], blocks))
    return described, _groups(held, rate_hz)


def _groups(held: Iterator[NDArray[Any]], rate_hz: float) -> Iterator[Group]:
    """Yield narrow blocks as columns, as many rows as GROUP_BYTES hold; one group without rows of a log without."""
    first = next(held)
    size = max(GROUP_BYTES // first.dtype.itemsize, 1)
    for (block,) in in_blocks(([block] for block in chain([first], held)), size):
        yield _group(block, rate_hz)
    if not len(first):
        yield _group(first, rate_hz)


def _group(block: NDArray[Any], rate_hz: float) -> Group:
    return {**{key: block[key] for key in block.dtype.names or ()}, TIME: block[TIME] / rate_hz}


def _narrowed(table: Table, described: dict[str, Column], for_vote: bool) -> Block:
    """Return the wanted columns of a block, which are few of it; ``time_s`` is the frame's number yet."""
    columns = {key: _values(table, column, for_vote) for key, column in described.items()}
    columns = {TIME: table["frame"], **columns}
    narrow = np.empty(len(table), [(key, values.dtype) for key, values in columns.items()])
    for key, values in columns.items():
        narrow[key] = values
    return narrow


def _chosen(table: Table, owners: Sequence[str], for_vote: bool) -> list[Column]:
    """Return the columns of the owners, without channels that are not fitted."""
    of_parts = [] if for_vote else part_owners(table)
    accepted = [signal.name for signal in SIGNALS] if for_vote else [*OWNERS, *of_parts]
    for owner in owners:
        if owner in PART_OWNERS and owner not in of_parts and not for_vote:
            had = "no servo actuators" if owner.startswith("actuator") else "one computer"
            raise BadInput(f"--signals {owner}: the flight had {had}")
        if owner not in accepted:
            raise BadInput(f"--signals: unknown {quoted(owner)}, {choices(owner, accepted, 'rig signals')}")
    wanted = chosen(table.rows, owners or accepted, _FOR_VOTE if for_vote else ())
    return [*wanted, *(chosen_of_parts(table, owners) if of_parts else ())]


def _values(table: Table, column: Column, for_vote: bool) -> NDArray[Any]:
    values = column.of(table)
    if for_vote and column.field == "channels":
        return np.where(table["valid"][(slice(None), *column.index)] != 0, values, np.nan)
    return values


def _write_csv(path: Path, groups: Iterator[Group], described: dict[str, Column]) -> int:
    rows = 0
    with path.open("wb") as file:
        for group in groups:
            of_columns(group, described).write_csv(file, include_header=file.tell() == 0)
            rows += len(group[TIME])
    return rows


def _write_parquet(path: Path, groups: Iterator[Group], described: dict[str, Column]) -> int:
    """Write a row group for each group; each column that has a unit has it in its metadata."""
    units, rows = units_of(described), 0
    tables = (of_columns(group, described).to_arrow() for group in groups)
    first = parquet_with_units(next(tables), units)
    with path.open("wb") as opened, ParquetWriter(opened, first.schema, compression="zstd") as file:
        for table in chain([first], tables):
            file.write_table(table.cast(first.schema))
            rows += len(table)
    return rows


def _write_npz(path: Path, groups: Iterator[Group], described: dict[str, Column]) -> int:
    """Write whole columns, which are held: an array of the file has its length at its begin."""
    held = list(groups)
    columns = {key: np.concatenate([group[key] for group in held]) for key in (TIME, *described)}
    with path.open("wb") as file:
        np.savez_compressed(file, **columns)  # pyright: ignore[reportArgumentType]  # names are ours
    return len(columns[TIME])


_WRITERS: Final = {"csv": _write_csv, "parquet": _write_parquet, "npz": _write_npz}
