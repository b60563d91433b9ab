"""A log as a file: CSV, Parquet or NumPy's npz, with the columns of rig/log/columns.py.

Enums are words in CSV and Parquet and numbers in npz.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from rig.errors import BadInput, RigError
from rig.frame import FLAT, SIGNALS, Block, LaneBlock
from rig.log import Log
from rig.log.columns import (
    LANE_OWNERS,
    OWNERS,
    TIME,
    Column,
    LaneColumn,
    chosen,
    chosen_lanes,
    lane_owners,
    name,
    of_columns,
)
from rig.log.reader import iter_blocks
from rig.log.scan import About
from rig.text import choices, quoted
from rig.util.files import replaced

_FOR_VOTE: Final = ("channels", "ilm", "reference")
ENDINGS: Final = ("csv", "parquet", "npz")
TABLE_WRITERS: Final[dict[str, Callable[[pl.DataFrame, Path], None]]] = {
    ".csv": pl.DataFrame.write_csv,
    ".parquet": pl.DataFrame.write_parquet,
}


class Exported(NamedTuple):
    """What was written: the names of the columns, and how many rows."""

    columns: list[str]
    rows: int


def export(log: Log | Path, to: str, out: Path, owners: Sequence[str] = (), for_vote: bool = False) -> Exported:
    """Write the columns of ``owners`` (signals, discretes, topics; all when empty) to ``out``.

    log      : read, or its path; a file is read block by block, and only what is written is held
    for_vote : only what ``rig vote`` reads, samples that the sensor flags left empty
    BadInput: an unknown owner or ending, a folder that is not there; BadLog; RigError when the disk does not take it.
    """
    if to not in ENDINGS:
        raise BadInput(f"--to {to}: allowed: {', '.join(ENDINGS)}")
    with replaced(out) as part:
        described, columns = _read(log, owners, for_vote)
        try:
            _write(part, to, columns, described)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise RigError(f"{out}: cannot be written: {' '.join(str(error).split())[:200]}") from None
    return Exported(list(columns), len(columns[TIME]))


def _read(log: Log | Path, owners: Sequence[str], for_vote: bool) -> tuple[dict[str, Column], dict[str, NDArray[Any]]]:
    """Return the wanted columns by their names in the table, and their values, time first."""
    about = About()
    blocks = iter_blocks(log, about) if isinstance(log, Path) else iter([(log.rows, log.lanes)])
    first = next(blocks, (np.empty(0, FLAT), None))
    described = {name(column): column for column in _chosen(*first, owners, for_vote)}
    held = [_narrowed(rows, lanes, described, for_vote) for rows, lanes in chain([first], blocks)]
    rate_hz = about.rate_hz if isinstance(log, Path) else log.rate_hz
    values = {key: np.concatenate([rows[key] for rows in held]) for key in (TIME, *described)}
    return described, {**values, TIME: values[TIME] / rate_hz}


def _narrowed(rows: Block, lanes: LaneBlock | None, described: dict[str, Column], for_vote: bool) -> Block:
    """Return the wanted columns of a block, which are few of it; ``time_s`` is the frame's number yet."""
    columns = {key: _values(rows, lanes, column, for_vote) for key, column in described.items()}
    columns = {TIME: rows["frame"], **columns}
    narrow = np.empty(len(rows), [(key, values.dtype) for key, values in columns.items()])
    for key, values in columns.items():
        narrow[key] = values
    return narrow


def _chosen(rows: Block, lanes: LaneBlock | None, owners: Sequence[str], for_vote: bool) -> list[Column]:
    """Return the columns of the owners, without channels that are not fitted."""
    of_lanes = [] if for_vote else lane_owners(lanes)
    accepted = [signal.name for signal in SIGNALS] if for_vote else [*OWNERS, *of_lanes]
    for owner in owners:
        if owner in LANE_OWNERS and owner not in of_lanes and not for_vote:
            had = "no servo actuators" if owner.startswith("actuator") else "one computer"
            raise BadInput(f"--signals {owner}: the flight had {had}")
        if owner not in accepted:
            raise BadInput(f"--signals: unknown {quoted(owner)}, {choices(owner, accepted, 'rig signals')}")
    wanted = chosen(rows, owners or accepted, _FOR_VOTE if for_vote else ())
    return [*wanted, *(chosen_lanes(lanes, owners) if of_lanes else ())]


def _values(rows: Block, lanes: LaneBlock | None, column: Column, for_vote: bool) -> NDArray[Any]:
    values = column.of(lanes if isinstance(column, LaneColumn) and lanes is not None else rows)
    if for_vote and column.field == "channels":
        return np.where(rows["valid"][(slice(None), *column.index)] != 0, values, np.nan)
    return values


def _write(path: Path, to: str, columns: dict[str, NDArray[Any]], described: dict[str, Column]) -> None:
    if to == "npz":
        with path.open("wb") as file:
            np.savez_compressed(file, **columns)  # pyright: ignore[reportArgumentType]  # names are ours
    else:
        TABLE_WRITERS[f".{to}"](of_columns(columns, described), path)
