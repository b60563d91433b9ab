"""What is drawn of a line: all of a short one, the extremes of each stretch of a long one."""

from __future__ import annotations

from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MOST_POINTS: Final = 2000  # of one line; of more, the smallest and largest of each stretch are drawn


class Line(NamedTuple):
    """The points (n,) of a line that are drawn, and the finite extremes of all of it; least > most: there are none."""

    time_s: Array
    values: Array
    least: float
    most: float

    @property
    def drawn(self) -> bool:
        """There is a number in it."""
        return self.least <= self.most


def line(time_s: Array, values: Array) -> Line:
    """Return the line of ``values`` (n,) at ``time_s`` (n,), s."""
    chosen, finite = thinned(values), values[np.isfinite(values)]
    return Line(time_s[chosen], values[chosen], float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf)))


def thinned(values: Array) -> NDArray[np.intp]:
    """Return which of ``values`` (n,) are drawn: all, or the extremes of each of MOST_POINTS / 2 stretches."""
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), MOST_POINTS // 2 + 1).astype(np.intp).tolist()
    low, high = np.nan_to_num(values, nan=np.inf), np.nan_to_num(values, nan=-np.inf)
    found = [[a + low[a:b].argmin(), a + high[a:b].argmax()] for a, b in pairwise(edges)]
    return np.unique(np.array(found, np.intp))
