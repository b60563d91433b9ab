"""Every number of a frame under the name that the log gives it, like ``pitch_rate.ch_1``."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final

from numpy.typing import NDArray

from rig.frame import FLAT, INDEX, SIGNALS, Block, Pattern
from rig.frame.fields import FIELD
from rig.log.schema import MESSAGES, TOPICS_OF_ROWS, Field, Topic


@dataclass(frozen=True, slots=True)
class Column:
    """One number of a frame: whose it is, its name in the owner's message, and its place in FLAT."""

    owner: str  # a signal, a discrete, or the topic: control, inertial, flight, demand
    name: str
    field: str  # of FLAT
    index: tuple[int, ...]
    enum: type[IntEnum] | None
    wraps: bool  # an angle: differences are the short way round

    @property
    def path(self) -> str:
        """As users write it."""
        return f"{self.owner}.{self.name}"

    @property
    def channel(self) -> int | None:
        """The channel, counted from 1; None for what is not of one channel."""
        return self.index[1] + 1 if len(self.index) == 2 else None

    def of(self, rows: Block) -> NDArray[Any]:
        """The column of ``rows`` (n,), a view."""
        return rows[self.field][(slice(None), *self.index)]


def _column(topic: Topic, field: Field) -> Column:
    index = field.index if topic.item is None else (topic.item, *field.index)
    angle = topic.message == "rig.Signal" and SIGNALS[topic.item or 0].wraps
    wraps = angle and FLAT[field.source].base == "f8"
    return Column(topic.name.rsplit("/", 1)[1], field.name, field.source, index, field.enum, wraps)


COLUMNS: Final = tuple(_column(topic, field) for topic in TOPICS_OF_ROWS for field in MESSAGES[topic.message].fields)
_UNITS: Final = {"_rad_s": "rad/s", "_rad": "rad", "_m_s2": "m/s2", "_m_s": "m/s", "_m": "m"}  # by end of a name
_OF_SIGNALS: Final = {
    field.name for field in MESSAGES["rig.Signal"].fields if field.source in FIELD and FIELD[field.source].unit
}


def unit_of(path: str) -> str:
    """The SI unit of the number that the log names ``path``, like ``pitch_rate.ch_1``; "" where it has none."""
    owner, _, name = path.partition(".")
    if owner in INDEX:
        return SIGNALS[INDEX[owner]].unit if name in _OF_SIGNALS else ""
    return next((unit for end, unit in _UNITS.items() if name.endswith(end)), "")


def label(column: Column, value: int) -> str:
    """A decision's value as a reader would say it."""
    if column.enum is None:
        return str(value)
    found = column.enum(value)
    return found.label if isinstance(found, Pattern) else found.name.lower()
