"""The second row of a frame in the viewer: for each of its parts lists of numbers, messages, and states as lanes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import LanePart, Table
from rig.core.frame.fields import Field
from rig.show.viewer.state_strips import Changes, Lane, changed
from rig.show.viewer.style import Color


class Entity(NamedTuple):
    """What an entity has in every row: one list of numbers, and the message of the log where it is sent too."""

    path: str
    archetype: str  # of the list
    values: NDArray[np.float64]  # (n, m)
    message: str = ""
    columns: Iterable[tuple[str, Field, NDArray[Any]]] = ()  # name, field, values (n,) of the numbers of the message


class Beside(NamedTuple):
    """A part of the second row, and how it is drawn; functions of rows (n,) that have the part."""

    part: LanePart
    legend: str  # entity
    legend_lines: Sequence[tuple[str, Color]]
    lanes: Sequence[Lane]
    codes: Callable[[Table, Lane], NDArray[Any]]  # the state of a lane in each row
    entities: Callable[[Table], Iterator[Entity]]

    def changes(self, rows: Table, before: Table | None) -> Iterator[Changes]:
        """Yield the changes in ``rows`` of any lane, after the row ``before`` (1,); None: all lanes begin here."""
        for lane in self.lanes:
            last = None if before is None else self.codes(before, lane)
            yield from changed(lane.path, lane.states, self.codes(rows, lane), last)
