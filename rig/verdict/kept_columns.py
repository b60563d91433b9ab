"""What is kept of the signals with a fault, which sentences look at again: frames in which it was not yet failed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, Block
from rig.verdict.signal_kernels import NEVER

# One signal's fields that a sentence looks at again, frame by frame.
COLUMNS: Final = np.dtype(
    [("channels", "f8", (CHANNELS,)), ("valid", "u1", (CHANNELS,)), ("state", "u1", (CHANNELS,)), ("pattern", "u1")]
)
Columns = Callable[[int, int, int], NDArray[Any]]  # signal, first frame, end (excluded): (n,) COLUMNS


class KeptColumns:
    """The columns of signals from the frame before a fault acts on them until it is failed, 41 bytes a frame."""

    def __init__(self, signals: Iterable[int]) -> None:
        self._parts: dict[int, list[tuple[int, NDArray[Any]]]] = {s: [] for s in signals}  # first frame, (n,) COLUMNS
        self._before: dict[int, NDArray[Any]] = {}  # the last row that was added

    def add(self, rows: Block, first: int, faults: NDArray[Any]) -> None:
        """Take the next ``rows`` (n,), from frame ``first`` on; faults : (F,) FAULT, with what they did to them."""
        if not len(rows):
            return
        unfailed = (faults["failed_at"] == NEVER) | (faults["failed_at"] >= first)
        going_on = faults["signal"][(faults["executed"] != 0) & unfailed & (faults["discrete"] == 0)]
        for s, parts in self._parts.items():
            if s in going_on:
                follows = bool(parts) and parts[-1][0] + len(parts[-1][1]) == first
                if not follows and s in self._before:
                    parts.append((first - 1, self._before[s]))
                parts.append((first, columns(rows, s)))
            self._before[s] = columns(rows[-1:], s)

    def of(self, s: int, first: int, end: int) -> NDArray[Any]:
        """Return what was kept of a signal in the frames ``first`` to ``end`` (excluded), (n,) COLUMNS."""
        within = [part[max(first - start, 0) : max(end - start, 0)] for start, part in self._parts[s]]
        return np.concatenate([np.empty(0, COLUMNS), *within])


def columns(rows: Block, s: int) -> NDArray[Any]:
    """Return (n,) COLUMNS of one signal of ``rows``."""
    kept = np.empty(len(rows), COLUMNS)
    for field in COLUMNS.names or ():
        kept[field] = rows[field][:, s]
    return kept
