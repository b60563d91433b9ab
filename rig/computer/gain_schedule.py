"""Designed numbers by dynamic pressure: gains of the control law, coefficients of the references.

A design gives them at a few flight points; in flight they are looked up every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rig.core.kernels import kernel


class Point(Protocol):
    """A flight point; its other attributes are the designed numbers there."""

    @property
    def dynamic_pressure_pa(self) -> float: ...  # noqa: D102


def check_rising(points: Sequence[Point]) -> None:
    """Raise ValueError unless every point is at a higher dynamic pressure than the one before it."""
    if any(b.dynamic_pressure_pa <= a.dynamic_pressure_pa for a, b in pairwise(points)):
        raise ValueError("points must be in the order of rising dynamic pressure")


def table(points: Sequence[Point], columns: Sequence[str]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return dynamic pressures (P,) [Pa] and the numbers there (P, len(columns))."""
    rows = [[getattr(point, name) for name in columns] for point in points]
    return np.array([point.dynamic_pressure_pa for point in points]), np.array(rows)


@kernel
def look_up(pressures, table, dynamic_pressure, out):
    """Write the numbers at ``dynamic_pressure`` [Pa] to ``out``: linear between the points, constant beyond the ends.

    pressures : (P,) rising; table : (P, C); out : (C,)
    """
    last = len(pressures) - 1
    low = 0
    while low < last - 1 and pressures[low + 1] <= dynamic_pressure:
        low += 1
    high, share = min(low + 1, last), 0.0
    if high > low:
        share = (dynamic_pressure - pressures[low]) / (pressures[high] - pressures[low])
    share = min(max(share, 0.0), 1.0)
    for i in range(len(out)):
        out[i] = table[low, i] + share * (table[high, i] - table[low, i])
