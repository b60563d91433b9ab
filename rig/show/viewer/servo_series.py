"""Servo actuators in the viewer: the second row of a frame as lines and as strips of states.

/actuator/elevator ..              rig.Actuator:message as in the log, and the list of NAMES: deg, or shares
/elevator/channel_1 .. channel_4   engaged; shut off, with the monitor
/elevator/moved_by                 number of channels that move the surface; bypassed: none, or no pressure
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, MOVED, SERVO_FIELDS, ActuatorMonitor, Table
from rig.core.frame.fields import elements
from rig.core.units.quantities import scale_shown
from rig.log.schema import PART_TOPICS
from rig.show.viewer.charts import spanned
from rig.show.viewer.state_strips import Beside, Entity, Strip
from rig.show.viewer.style import (
    ALL_FAILED,
    CHANNEL_COLORS,
    CHANNEL_NAMES,
    FAILED,
    PALETTE,
    QUIET,
    REFERENCE,
    SUSPECT,
    VOTED,
    Color,
    Looks,
    shade,
)

VALUES: Final = "rig.Servo"
DRAWN: Final = (
    "spool",
    "ram",
    "asked",
    "spool_model",
    "ram_model",
    "lvdt",
    "current",
    "pressure",
)
FIELD: Final = {field.name: field for field in SERVO_FIELDS}
NAMES: Final = tuple(name for field in DRAWN for name, _ in elements(FIELD[field]))
_BYPASSED: Final = CHANNELS + 1
_MONITORS: Final[Looks] = {
    monitor.name: (f"shut off: {monitor.name.lower()} monitor", FAILED) if monitor else ("engaged", QUIET)
    for monitor in ActuatorMonitor
} | {"WITH_COMPUTER": ("shut off with its computer", FAILED)}
_WITH_COMPUTER: Final = 1 + max(ActuatorMonitor)
_HELD: Final[Looks] = {
    "HELD_0": ("no channel", ALL_FAILED),
    "HELD_1": ("1 channel", SUSPECT),
    **{f"HELD_{n}": (f"{n} channels", SUSPECT) for n in range(2, CHANNELS)},
    f"HELD_{CHANNELS}": ("all channels", QUIET),
    "BYPASSED": ("bypassed", ALL_FAILED),
}


class Plot(NamedTuple):
    """A plot of each surface: its fields of SERVO, and the axis; None: fitted to the flight."""

    name: str
    fields: tuple[str, ...]
    values: tuple[float, float] | None


PLOTS: Final = (
    Plot("position, deg", ("ram", "asked", "ram_model", "lvdt"), None),
    Plot("current", ("current",), (-1.1, 1.1)),
    Plot("spool", ("spool", "spool_model"), (-1.1, 1.1)),
)
PRESSURE: Final = Plot("pressure: 1 sky blue, 2 green", ("pressure",), (-0.1, 1.1))
LEGEND: Final = "/legend/servos"
LEGEND_LINES: Final = (
    *CHANNEL_NAMES,
    ("ram, spool", VOTED),
    ("command", REFERENCE),
    ("models: darker", shade(VOTED, 1)),
    ("shut off", FAILED),
)


def topic(surface: str) -> str:
    """Return the entity of one of MOVED."""
    return f"/actuator/{surface}"


def look(field: str, number: int) -> tuple[Color, float]:
    """Return colour and width of a line: that of its channel, darker for models."""
    if field in ("ram", "spool"):
        return VOTED, 3.5
    if field == "asked":
        return REFERENCE, 1.5
    if field == "pressure":
        return PALETTE[number], 2.5
    return (shade(CHANNEL_COLORS[number], 1), 1.0) if field.endswith("_model") else (CHANNEL_COLORS[number], 1.5)


def values(table: Table, i: int) -> NDArray[np.float64]:
    """Return the numbers of NAMES of surface ``i`` of MOVED: (n, m)."""
    rows = table.servo[:, i]
    columns = [rows[name].reshape(len(rows), -1) * scale_shown(FIELD[name].unit) for name in DRAWN]
    return np.concatenate(columns, axis=1)


def ranges(table: Table, part: slice = slice(None)) -> dict[str, tuple[float, float]]:
    """Return the axis of the position of each surface in a ``part`` of the rows, deg, by topic."""
    wanted = [i for i, name in enumerate(NAMES) if name == "ram" or name.startswith(("asked", "lvdt"))]
    return {topic(surface): spanned(values(table[part], i)[:, wanted].ravel(), 2.0) for i, surface in enumerate(MOVED)}


def of_surface(surface: str) -> list[Strip]:
    """Return the strips of a surface: its channels, and the number of them that move it."""
    i = MOVED.index(surface)
    monitors = {int(monitor): monitor.name for monitor in ActuatorMonitor} | {_WITH_COMPUTER: "WITH_COMPUTER"}
    channels = [Strip(f"/{surface}/channel_{c + 1}", "failed_by", (i, c), monitors, _MONITORS) for c in range(CHANNELS)]
    return [*channels, Strip(f"/{surface}/moved_by", "", (i,), dict(enumerate(_HELD)), _HELD)]


STRIPS: Final = tuple(strip for surface in MOVED for strip in of_surface(surface))


def entities(table: Table) -> Iterator[Entity]:
    """Yield the lists of each surface."""
    for i, of in enumerate(PART_TOPICS["servo"]):
        yield Entity(of.name, VALUES, values(table, i), of)


def _codes(table: Table, strip: Strip) -> NDArray[Any]:
    """Return the code of a strip in each row."""
    rows = table.servo[:, strip.at[0]]
    by, shut = rows["failed_by"], rows["valve"] != 0
    if strip.field:
        c = strip.at[1]
        return np.where(shut[:, c] & (by[:, c] == ActuatorMonitor.NONE), _WITH_COMPUTER, by[:, c])
    held = ((by == ActuatorMonitor.NONE) & ~shut).sum(axis=1)
    return np.where(rows["bypassed"] != 0, _BYPASSED, held)


SHOWN: Final = Beside("servo", LEGEND, LEGEND_LINES, STRIPS, _codes, entities)
