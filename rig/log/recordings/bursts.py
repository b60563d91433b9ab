"""Times in bursts: a recorder that stamps messages when a buffer is emptied, not when they were sampled.

Most of the time is between the bursts, and the steps within one are not those of the sampling.  The samples of a burst
were taken since the one before: for the search of the nearest sample they are spread over that time.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
GAP: Final = 5.0  # usual steps from which a pause is told
_BETWEEN: Final = 0.8  # of the time, at least, lies between bursts
_FEW: Final = 5  # bursts in which no verdict is possible
_ALIKE: Final = 3.0  # of the pauses: the longest tenth against the shortest
_ROWS: Final = 1.5  # of a burst, at least


class Bursts(NamedTuple):
    """Usual bursts of a recorder."""

    rows: float
    every_s: float
    longest_s: float  # usual step between two bursts
    starts: NDArray[np.int64]  # first row of each, from 0


def bursts(time_s: Floats) -> Bursts | None:
    """Return the bursts of the rising ``time_s`` (n,); None: it has none."""
    steps = np.diff(time_s)
    if len(steps) < 2 * _FEW:
        return None
    long = steps > GAP * np.median(steps)
    if long.sum() < _FEW or steps[long].sum() < _BETWEEN * steps.sum():
        return None
    shortest_s, longest_s = np.quantile(steps[long], (0.1, 0.9))
    starts = np.concatenate([[0], np.flatnonzero(long) + 1])
    rows = float(np.median(np.diff(starts)))
    if longest_s > _ALIKE * shortest_s or rows < _ROWS:
        return None
    return Bursts(rows, float(np.median(np.diff(time_s[starts]))), float(longest_s), starts)


def spread(time_s: Floats, of: Bursts) -> Floats:
    """Return the times (n,) of rows that are evenly spread from the end of one burst to that of the next."""
    ends = np.append(of.starts[1:], len(time_s)) - 1
    end_s = time_s[ends]
    before_s = np.concatenate([[end_s[0] - of.every_s], end_s[:-1]])
    number = np.repeat(np.arange(len(ends)), np.diff(np.append(of.starts, len(time_s))))
    place = np.arange(len(time_s)) - of.starts[number] + 1.0
    count = (ends - of.starts + 1.0)[number]
    return before_s[number] + (end_s - before_s)[number] * place / count
