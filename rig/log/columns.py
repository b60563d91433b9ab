"""Every number of a frame under the name that the log gives it, like ``pitch_rate.ch_1``; and as one table.

The table has a row a frame, its columns named as ``rig vote`` names its own:

    time_s
    <signal>.1 ..  .ilm.1 ..  .ref                    what rig vote reads: an ilm is 0, 1 or empty where there is none
    <signal>.voted .level .pattern .decided_by .state.1 ..  .trend.high .trend.low      what rig vote writes
    <signal>.truth .valid.1 ..  .reference_usable .source                             what only a flight has
    <discrete>.1 ..  .truth .voted .state.1 ..  .level .valid.1 ..  .ilm.1 ..
    control.*, inertial.*, flight.*, autopilot_command.*         the fields of these topics
    actuator.<surface>.ram .asked.1 ..                of a flight with servo actuators
    computer.<A to D>.voted_<signal> ..               of a flight with several computers
    ccdl.state_A_B .. .age_A_B .. .outvoted_A_B ..    of the link from A to B, and so on

Enums are words.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import (
    FLAT,
    INDEX,
    SERVO_FIELDS,
    SIGNALS,
    Block,
    Ilm,
    Pattern,
    RowPart,
    State,
    Table,
)
from rig.core.frame.fields import FIELD
from rig.core.renamed import TOPICS, now_called
from rig.core.text import choices, quoted
from rig.core.units.quantities import unit_of_name
from rig.log.schema import MESSAGES, PART_MESSAGES, PART_TOPICS, TOPICS_OF_ROWS, Field, Topic

if TYPE_CHECKING:
    import polars as pl


@dataclass(frozen=True, slots=True)
class Column:
    """One number of a frame: its owner, its name in the owner's message, and its place in FLAT."""

    owner: str  # a signal, a discrete, or the topic: control, inertial, flight, autopilot_command
    name: str
    field: str  # of FLAT
    index: tuple[int, ...]
    enum: type[IntEnum] | None
    wraps: bool  # an angle: differences are the short way round

    @property
    def path(self) -> str:
        """The name that users write: ``pitch_rate.ch_1``."""
        return f"{self.owner}.{self.name}"

    @property
    def channel(self) -> int | None:
        """The channel, counted from 1; None: it belongs to no channel."""
        return self.index[1] + 1 if len(self.index) == 2 else None

    def of(self, rows: Block | Table) -> NDArray[Any]:
        """Return the column of ``rows`` (n,), a view."""
        return rows[self.field][(slice(None), *self.index)]


@dataclass(frozen=True, slots=True)
class PartColumn(Column):
    """One number of the rows of servos and computers; owners: ``actuator.elevator``, ``computer.A``, ``ccdl`` ...."""

    part: RowPart

    def of(self, rows: Block | Table) -> NDArray[Any]:
        """Return the column of a table that has the part, a view."""
        part = rows.part(self.part) if isinstance(rows, Table) else rows[self.part]
        return part[self.field][(slice(None), *self.index)]


def _column(topic: Topic, field: Field) -> Column:
    angle = topic.message == "rig.Signal" and SIGNALS[topic.item or 0].wraps
    wraps = angle and FLAT[field.source].base == "f8"
    return Column(topic.name.rsplit("/", 1)[1], field.name, field.source, topic.at(field), field.enum, wraps)


COLUMNS: Final = tuple(_column(topic, field) for topic in TOPICS_OF_ROWS for field in MESSAGES[topic.message])
PART_COLUMNS: Final = tuple(
    PartColumn(topic.name[1:].replace("/", "."), field.name, field.source, topic.at(field), field.enum, False, part)
    for part, topics in PART_TOPICS.items()
    for topic in topics
    for field in PART_MESSAGES[topic.message]
)
_PART_UNITS: Final = {column.path: f.unit for column in PART_COLUMNS for f in SERVO_FIELDS if f.name == column.field}
_OF_SIGNALS: Final = {
    field.name for field in MESSAGES["rig.Signal"] if field.source in FIELD and FIELD[field.source].unit
}


def unit_of(path: str) -> str:
    """Return the SI unit of the number that the log names ``path``, like ``pitch_rate.ch_1``; "" where it has none."""
    if path in _PART_UNITS:
        return _PART_UNITS[path]
    owner, _, name = path.partition(".")
    if owner in INDEX:
        return SIGNALS[INDEX[owner]].unit if name in _OF_SIGNALS else ""
    return unit_of_name(name)


def label(column: Column, value: int) -> str:
    """Return a decision's value in words."""
    if column.enum is None:
        return str(value)
    member = column.enum(value)
    return member.label if isinstance(member, Pattern) else member.name.lower()


TIME: Final = "time_s"
OWNERS: Final = tuple(dict.fromkeys(column.owner for column in COLUMNS))
PART_OWNERS: Final = tuple(dict.fromkeys(column.owner for column in PART_COLUMNS))
_OWN: Final = {"trend_high": "trend.high", "trend_low": "trend.low", "reference": "ref"}
_NUMBERED: Final = {"channels": "", "discrete_channels": "", "state": ".state", "discrete_state": ".state"}


def name(column: Column) -> str:
    """Return the column's name in a table."""
    if isinstance(column, PartColumn) and column.part == "servo":
        return ".".join([column.owner, column.field, *(str(i + 1) for i in column.index[1:])])
    if isinstance(column, PartColumn):
        return f"{column.owner}.{column.name}"
    if column.field in _NUMBERED:
        return f"{column.owner}{_NUMBERED[column.field]}.{column.channel}"
    if column.field.removeprefix("discrete_") in ("ilm", "valid"):
        return f"{column.owner}.{column.field}.{column.channel}"
    return f"{column.owner}.{_OWN.get(column.name, column.name)}"


def chosen(rows: Block, owners: Sequence[str], fields: Sequence[str] = ()) -> list[Column]:
    """Return the columns of ``owners`` (signals, discretes, topics; all if none), without channels not fitted.

    fields : of FLAT; all if none
    """
    wanted, of = owners or OWNERS, fields or tuple(rows.dtype.names or ())
    return [column for column in COLUMNS if column.owner in wanted and column.field in of and _fitted(rows, column)]


def _fitted(rows: Block, column: Column) -> bool:
    """Return True if the channel is fitted; what is of no channel always is."""
    if column.channel is None or not len(rows):
        return True
    field = "discrete_state" if column.field.startswith("discrete_") else "state"
    return bool(rows[field][0][column.index] != State.ABSENT)


def chosen_of_parts(table: Table, owners: Sequence[str] = ()) -> list[PartColumn]:
    """Return the columns of ``owners`` of servos and computers that the table has; all of them if none."""
    of = table.parts
    return [column for column in PART_COLUMNS if column.part in of and (not owners or column.owner in owners)]


def part_owners(table: Table) -> list[str]:
    """Return the owners of the columns of servos and computers of the table."""
    return list(dict.fromkeys(column.owner for column in chosen_of_parts(table)))


def dataframe(table: Table, time_s: NDArray[np.float64], owners: Sequence[str] = ()) -> pl.DataFrame:
    """Return a flight's table at ``time_s`` (n,), s; SI units, enums as words.

    BadInput: an owner that is no signal, discrete, topic, actuator or computer of the flight.
    """
    allowed = [*OWNERS, *part_owners(table)]
    for owner in owners:
        if owner not in allowed:
            if new := TOPICS.get(f"/{owner}"):
                raise BadInput(now_called(owner, new.removeprefix("/")))
            raise BadInput(f"unknown {quoted(owner)}, {choices(owner, allowed, 'rig signals')}")
    values = {column: column.of(table) for column in (*chosen(table.rows, owners), *chosen_of_parts(table, owners))}
    return of_columns({TIME: time_s, **{name(c): v for c, v in values.items()}}, {name(c): c for c in values})


def of_columns(values: dict[str, NDArray[Any]], columns: dict[str, Column]) -> pl.DataFrame:
    """Return arrays (n,) by name as a table; ``columns``: those that are columns of a frame."""
    import polars as pl  # a log is read without it

    return pl.DataFrame({key: _series(np.ascontiguousarray(array), columns.get(key)) for key, array in values.items()})


def _series(values: NDArray[Any], column: Column | None) -> pl.Series:
    import polars as pl

    series = pl.Series(values)
    if column is None or column.enum is None:
        return series
    if column.enum is Ilm:
        return pl.select(pl.when(series < int(Ilm.ABSENT)).then(series)).to_series()
    return series.cast(pl.UInt8).cat.to(pl.Enum([label(column, int(member)) for member in column.enum]))
