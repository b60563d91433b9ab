"""The frames of a flight as one table, in memory during the flight and when read from a log.

    table["voted"], len(table), table[first:end]    as for an array of rows
    table.servo   (n, 3) SERVO, or None: no servo moves a surface
    table.lane    (n, 4) COMPUTER, or None: there is one computer
    table.timing  (n,) TIMING, or None: not known
    table.clean   (n,) samples before any fault, or None: not kept

Kernels get its arrays: ``rows`` and the parts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.core.frame.row import Block
from rig.core.frame.second_row import ROW_PARTS, RowPart, RowParts, SecondRows, parts_of, second_rows


class Table:
    """Consecutive frames; a slice is a view."""

    __slots__ = ("beside", "clean", "rows", "timing")
    rows: Block
    beside: Any  # arrays (n,), or None
    timing: Any
    clean: Any

    def __init__(
        self,
        rows: Block,
        beside: SecondRows | None = None,
        timing: NDArray[Any] | None = None,
        clean: NDArray[Any] | None = None,
    ) -> None:
        """beside : (n,) servos and lanes as one record per frame, as the loop fills and the log packs them."""
        self.rows, self.beside, self.timing, self.clean = rows, beside, timing, clean

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, key: Any) -> Any:
        """Return a field of the rows, or the frames of a slice."""
        if isinstance(key, str):
            return self.rows[key]
        return self.each(lambda part: part[key])

    def each(self, function: Callable[[NDArray[Any]], NDArray[Any]]) -> Table:
        """Return the table with ``function`` applied to its rows and to each of its parts."""
        return Table(function(self.rows), *[None if part is None else function(part) for part in self.arrays()[1:]])

    def arrays(self) -> tuple[Any, ...]:
        """Return the arrays of the table, in the order of its arguments."""
        return self.rows, self.beside, self.timing, self.clean

    def part(self, name: RowPart) -> Any:
        """Return a part by its name in the log; None: the flight has none."""
        return self.beside[name] if self.beside is not None and name in self.parts else None

    @property
    def parts(self) -> RowParts:
        """Return the names of its parts in the log."""
        return parts_of(self.beside)

    @property
    def servo(self) -> Any:
        """(n, 3) SERVO; None: no servo moves a surface."""
        return self.part("servo")

    @property
    def lane(self) -> Any:
        """(n, 4) COMPUTER; None: there is one computer."""
        return self.part("computer")

    def copy(self) -> Table:
        """Return a copy of the table."""
        return self.each(lambda part: part.copy())

    def copied_beside(self, parts: Iterable[RowPart]) -> Table:
        """Return its rows with new records beside them, into which ``parts`` are copied field by field.

        The padding between fields is part of the digest, and zero.
        """
        made = second_rows(len(self), self.parts)
        made["frame"] = self["frame"]
        for part in parts:
            for name in ROW_PARTS[part].base.names or ():
                made[part][name] = self.part(part)[name]
        return Table(self.rows, made, self.timing, self.clean)


def stacked(tables: list[Table]) -> Table:
    """Return consecutive tables as one."""
    rows, *parts = zip(*(table.arrays() for table in tables), strict=True)
    return Table(np.concatenate(rows), *[None if part[0] is None else np.concatenate(part) for part in parts])
