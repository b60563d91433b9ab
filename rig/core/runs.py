"""Runs of equal values and clusters of frames: arithmetic of assessments and tables."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def runs(values: NDArray[Any]) -> NDArray[np.intp]:
    """Return (m, 2) the first row and the row after the last of every run of one value in ``values`` (n,)."""
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    firsts = np.concatenate([np.arange(min(len(values), 1)), edges])
    return np.column_stack([firsts, np.append(firsts[1:], np.full(len(firsts[:1]), len(values)))])


def runs_where(mask: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return (m, 2) the first row and the row after the last of every run in which ``mask`` (n,) is true."""
    every = runs(mask)
    return every[mask[every[:, 0]]]


def cluster_starts(frames: NDArray[np.integer[Any]], gap: int = 1) -> NDArray[np.intp]:
    """Return the places in rising ``frames`` (n,) at which a cluster begins: more than ``gap`` after the last frame."""
    return np.flatnonzero(np.diff(frames, prepend=frames[:1] - gap - 1) > gap)
