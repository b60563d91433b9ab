"""Arrays of many rows, processed in blocks in the memory of one block; a file holds the columns of very many rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from tempfile import TemporaryFile
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

ROWS: Final = 4_000  # of a block: eight megabytes of a flight's rows
HELD: Final = 1 << 16  # rows whose columns are held in memory; those of more lie in a file
Arrays = Sequence[NDArray[Any] | None]  # (n,) beside each other, contiguous; None: there are none of a kind


def cuts(rows: int) -> Iterator[slice]:
    """Yield the blocks of ``rows`` rows."""
    for first in range(0, rows, ROWS):
        yield slice(first, min(first + ROWS, rows))


def room(shape: tuple[int, ...], dtype: Any = np.float64) -> NDArray[Any]:
    """Return room for columns; rows are the last of ``shape``.

    For more than HELD rows it is a file without a name that is mapped into memory and disappears with the array.
    """
    return np.empty(shape, dtype) if shape[-1] <= HELD else scratch(shape, dtype)


def scratch(shape: tuple[int, ...], dtype: Any) -> NDArray[Any]:
    """Return zeros in a file without a name that is mapped into memory and disappears with the array."""
    with TemporaryFile(prefix="rig-") as file:
        return np.memmap(file, dtype, "w+", shape=shape).view(np.ndarray)


def in_blocks(parts: Iterable[Arrays], size: int | None = None) -> Iterator[list[Any]]:
    """Yield the rows of consecutive ``parts``, ``size`` at a time (ROWS if not given); the last block may be shorter.

    The blocks are copies, because a part may change when the next one is read.
    """
    size, made, held = size or ROWS, list[Any](), 0
    for part in parts:
        rows, first = len(part[0] if part[0] is not None else ()), 0
        while first < rows:
            made = made or [None if array is None else np.empty(size, array.dtype) for array in part]
            count = min(rows - first, size - held)
            _copy(part, first, made, held, count)
            first, held = first + count, held + count
            if held == size:
                yield made
                made, held = [], 0
    if held:
        yield [None if array is None else array[:held] for array in made]


def _copy(part: Arrays, first: int, made: Arrays, at: int, count: int) -> None:
    """Copy the bytes: an assignment of structured arrays goes field by field and promises no padding."""
    for array, whole in zip(part, made, strict=True):
        if array is not None and whole is not None:
            whole[at : at + count].view(np.uint8)[:] = array[first : first + count].view(np.uint8)
