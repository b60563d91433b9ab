"""A column of values that are scattered over a file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def numbers(values: NDArray[Any]) -> NDArray[np.float64]:
    """Return values as numbers; what is none, or only signals to be none, becomes NaN without a warning."""
    with np.errstate(all="ignore"):
        return values.astype(np.float64)


def gathered(data: bytes, at: NDArray[np.int64], offset: int, kind: np.dtype[Any]) -> NDArray[Any]:
    """Return the values (n,) of ``kind`` that begin ``offset`` bytes after ``at`` (n,) in ``data``."""
    whole = np.frombuffer(data, np.uint8)
    out = np.empty((len(at), kind.itemsize), np.uint8)
    for byte in range(kind.itemsize):
        out[:, byte] = whole[at + (offset + byte)]
    return out.view(kind)[:, 0]
