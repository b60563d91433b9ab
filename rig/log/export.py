"""A log as a file: CSV, Parquet or NumPy's npz, with the columns of rig/log/columns.py.

Enums are words in CSV and Parquet and numbers in npz.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from rig.errors import BadInput, RigError
from rig.frame import SIGNALS, Block
from rig.log import Log
from rig.log.columns import LANE_OWNERS, OWNERS, TIME, Column, chosen, chosen_lanes, name, of_columns
from rig.text import choices, quoted
from rig.util.files import replaced

_FOR_VOTE: Final = ("channels", "ilm", "reference")
ENDINGS: Final = ("csv", "parquet", "npz")
TABLE_WRITERS: Final[dict[str, Callable[[pl.DataFrame, Path], None]]] = {
    ".csv": pl.DataFrame.write_csv,
    ".parquet": pl.DataFrame.write_parquet,
}


def export(log: Log, to: str, out: Path, owners: Sequence[str] = (), for_vote: bool = False) -> list[str]:
    """Write the columns of ``owners`` (signals, discretes, topics; all when empty) to ``out``; their names.

    for_vote : only what ``rig vote`` reads, samples that the sensor flags left empty
    BadInput: an unknown owner or ending, a folder that is not there; RigError when the disk does not take it.
    """
    if to not in ENDINGS:
        raise BadInput(f"--to {to}: allowed: {', '.join(ENDINGS)}")
    wanted = _chosen(log, owners, for_vote)
    columns = {TIME: log.time_s, **{name(column): _values(log.rows, column, for_vote) for column in wanted}}
    described = {name(column): column for column in wanted}
    if log.lanes is not None and not for_vote:
        of_servos = {name(column): column for column in chosen_lanes(owners)}
        columns |= {key: column.of(log.lanes) for key, column in of_servos.items()}
        described |= of_servos
    with replaced(out) as part:
        try:
            _write(part, to, columns, described)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise RigError(f"{out}: cannot be written: {' '.join(str(error).split())[:200]}") from None
    return list(columns)


def _chosen(log: Log, owners: Sequence[str], for_vote: bool) -> list[Column]:
    """Return the columns of the owners in FLAT, without channels that are not fitted."""
    accepted = (
        [signal.name for signal in SIGNALS] if for_vote else [*OWNERS, *(LANE_OWNERS if log.lanes is not None else ())]
    )
    for owner in owners:
        if log.lanes is None and owner in LANE_OWNERS:
            raise BadInput(f"--signals {owner}: the flight had no servo actuators")
        if owner not in accepted:
            raise BadInput(f"--signals: unknown {quoted(owner)}, {choices(owner, accepted, 'rig signals')}")
    return chosen(log.rows, owners or accepted, _FOR_VOTE if for_vote else ())


def _values(rows: Block, column: Column, for_vote: bool) -> NDArray[Any]:
    values = np.ascontiguousarray(column.of(rows))
    if for_vote and column.field == "channels":
        return np.where(rows["valid"][(slice(None), *column.index)] != 0, values, np.nan)
    return values


def _write(path: Path, to: str, columns: dict[str, NDArray[Any]], described: dict[str, Column]) -> None:
    if to == "npz":
        with path.open("wb") as file:
            np.savez_compressed(file, **columns)  # pyright: ignore[reportArgumentType]  # names are ours
    else:
        TABLE_WRITERS[f".{to}"](of_columns(columns, described), path)
