"""A log as a table: CSV, Parquet or NumPy's npz, the columns named as ``rig vote`` names its own.

    time_s
    <signal>.1 ..  .ilm.1 ..  .ref                    what rig vote reads: an ilm is 0, 1 or empty where there is none
    <signal>.voted .level .pattern .resolver .state.1 ..  .trend.high .trend.low      what rig vote writes
    <signal>.truth .valid.1 ..  .reference_usable .source                             what only a flight has
    <discrete>.1 ..  .truth .voted .state.1 ..  .level .valid.1 ..  .ilm.1 ..
    control.*, inertial.*, flight.*, demand.*         the fields of these topics

Enums are words in CSV and Parquet and numbers in npz.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from rig.errors import BadInput, RigError
from rig.files import replaced
from rig.frame import SIGNALS, Block, Ilm, State
from rig.log import Log
from rig.log.columns import COLUMNS, Column
from rig.offline.decisions import label
from rig.offline.table import TABLE_WRITERS
from rig.text import choices, quoted

TIME: Final = "time_s"
_OWN: Final = {"trend_high": "trend.high", "trend_low": "trend.low", "reference": "ref"}
_NUMBERED: Final = {"channels": "", "discrete_channels": "", "state": ".state", "discrete_state": ".state"}
_FOR_VOTE: Final = ("channels", "ilm", "reference")
ENDINGS: Final = ("csv", "parquet", "npz")
OWNERS: Final = tuple(dict.fromkeys(column.owner for column in COLUMNS))


def export(log: Log, to: str, out: Path, owners: Sequence[str] = (), for_vote: bool = False) -> list[str]:
    """Write the columns of ``owners`` (signals, discretes, topics; all when empty) to ``out``; their names.

    for_vote : only what ``rig vote`` reads, samples that the sensor flags left empty
    BadInput: an unknown owner or ending, a folder that is not there; RigError when the disk does not take it.
    """
    if to not in ENDINGS:
        raise BadInput(f"--to {to}: allowed: {', '.join(ENDINGS)}")
    chosen = _chosen(log.rows, owners, for_vote)
    columns = {TIME: log.time_s}
    for column in chosen:
        columns[name(column)] = _values(log.rows, column, for_vote)
    with replaced(out) as part:
        try:
            _write(part, to, columns, {name(column): column for column in chosen})
        except (OSError, pl.exceptions.PolarsError) as error:
            raise RigError(f"{out}: cannot be written: {' '.join(str(error).split())[:200]}") from None
    return list(columns)


def name(column: Column) -> str:
    """The column's name in a table."""
    if column.field in _NUMBERED:
        return f"{column.owner}{_NUMBERED[column.field]}.{column.channel}"
    if column.field.removeprefix("discrete_") in ("ilm", "valid"):
        return f"{column.owner}.{column.field}.{column.channel}"
    return f"{column.owner}.{_OWN.get(column.name, column.name)}"


def _chosen(rows: Block, owners: Sequence[str], for_vote: bool) -> list[Column]:
    """The columns of the owners, without channels that are not fitted."""
    signals = [signal.name for signal in SIGNALS]
    known = signals if for_vote else OWNERS
    for owner in owners:
        if owner not in known:
            raise BadInput(f"--signals: unknown {quoted(owner)}, {choices(owner, known, 'rig signals')}")
    wanted = owners or known
    fields = _FOR_VOTE if for_vote else tuple(rows.dtype.names or ())
    return [column for column in COLUMNS if column.owner in wanted and column.field in fields and _fitted(rows, column)]


def _fitted(rows: Block, column: Column) -> bool:
    """Whether the channel is there; what is of no channel always is."""
    if column.channel is None or not len(rows):
        return True
    field = "discrete_state" if column.field.startswith("discrete_") else "state"
    return bool(rows[field][0][column.index] != State.ABSENT)


def _values(rows: Block, column: Column, for_vote: bool) -> NDArray[Any]:
    values = np.ascontiguousarray(column.of(rows))
    if for_vote and column.field == "channels":
        return np.where(rows["valid"][(slice(None), *column.index)] != 0, values, np.nan)
    return values


def _write(path: Path, to: str, columns: dict[str, NDArray[Any]], known: dict[str, Column]) -> None:
    if to == "npz":
        with path.open("wb") as file:
            np.savez_compressed(file, **columns)  # pyright: ignore[reportArgumentType]  # names are ours
    else:
        table = pl.DataFrame({key: _series(values, known.get(key)) for key, values in columns.items()})
        TABLE_WRITERS[f".{to}"](table, path)


def _series(values: NDArray[Any], column: Column | None) -> pl.Series:
    series = pl.Series(values)
    if column is None or column.enum is None:
        return series
    if column.enum is Ilm:
        return pl.select(pl.when(series < int(Ilm.ABSENT)).then(series)).to_series()
    return series.cast(pl.UInt8).cat.to(pl.Enum([label(column, int(member)) for member in column.enum]))
