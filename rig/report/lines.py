"""What is drawn of a line: all of a short one, the extremes of each stretch of a long one, which may come in blocks."""

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
    chosen = thinned(values)
    return Line(time_s[chosen], values[chosen], *_extremes(values))


def thinned(values: Array) -> NDArray[np.intp]:
    """Return which of ``values`` (n,) are drawn: all, or the extremes of each of MOST_POINTS / 2 stretches."""
    return _chosen(values, _edges(len(values)))


def _edges(frames: int) -> NDArray[np.intp]:
    """Return the ends of the stretches of a line; none where all of it is drawn."""
    if frames <= MOST_POINTS:
        return np.empty(0, np.intp)
    return np.linspace(0, frames, MOST_POINTS // 2 + 1).astype(np.intp)


def _chosen(values: Array, edges: NDArray[np.intp]) -> NDArray[np.intp]:
    if not len(edges):
        return np.arange(len(values))
    low, high = np.nan_to_num(values, nan=np.inf), np.nan_to_num(values, nan=-np.inf)
    found = [[a + low[a:b].argmin(), a + high[a:b].argmax()] for a, b in pairwise(edges.tolist())]
    return np.unique(np.array(found, np.intp))


def _extremes(values: Array) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf))


class Thinning:
    """Makes the Line of values that come block by block: the points that ``thinned`` chooses of the whole.

    frames : how many values will come
    """

    def __init__(self, frames: int) -> None:
        self._edges, self._held, self._first = _edges(frames), np.empty(0), 0  # held back, from row ``first`` on
        self._rows: list[NDArray[np.intp]] = []
        self._values: list[Array] = []
        self._least, self._most = np.inf, -np.inf

    def add(self, values: Array) -> None:
        """Take the next values (n,)."""
        least, most = _extremes(values)
        self._least, self._most = min(self._least, least), max(self._most, most)
        held = np.concatenate([self._held, values])
        whole = self._edges[(self._edges >= self._first) & (self._edges <= self._first + len(held))] - self._first
        done = int(whole[-1]) if len(whole) else 0 if len(self._edges) else len(held)
        chosen = _chosen(held[:done], whole) if done else np.empty(0, np.intp)
        self._rows.append(chosen + self._first)
        self._values.append(held[chosen])
        self._held, self._first = held[done:], self._first + done

    def line(self, rate_hz: float) -> Line:
        """Return the line of all that came, at ``rate_hz`` rows a second."""
        rows = np.concatenate([np.empty(0, np.intp), *self._rows])
        return Line(rows / rate_hz, np.concatenate([np.empty(0), *self._values]), self._least, self._most)
