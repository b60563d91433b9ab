"""Rows whose time is out of order: the fewest rows without which time rises, and strays at the ends.

A lone wrong stamp goes and its neighbours stay.  The rows kept are a longest rising subsequence of the stamps; of
several, the one that does not end far ahead of the others, and has the earliest rows.  So the first of rows with equal
stamps is kept.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.log.recordings.bursts import GAP

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
UNIX_S: Final = 1e9  # 2001: a clock that was set counts from 1970
_UNSET_S: Final = 1e8  # a clock that was not set counts from its start
_LONE: Final = 3  # rows at an end, at most, that a jump parts from the others
_LONG_RUN: Final = 100  # rows
_LONG_SHARE: Final = 0.2  # of all rows


class Strays(NamedTuple):
    """Rows at an end of a recording that a jump of time parts from all others."""

    rows: Rows  # counted from 0
    jump_s: float
    before_clock: bool  # they come before the clock was set


def out_of_order(time_s: Floats) -> Rows:
    """Return the fewest rows, from 0, without which ``time_s`` (n,) rises from row to row.  O(n log n)."""
    steps = np.diff(time_s)
    if (steps > 0).all():
        return np.empty(0, np.int64)
    ends = _lengths(time_s)
    last = _last(time_s, ends, steps)
    to_last = np.flatnonzero(time_s < time_s[last])  # without what comes after the last row, or exceeds it
    inside = np.append(to_last[to_last < last], last)
    within = time_s[inside]
    ends = _lengths(within)
    begins = _lengths(-within[::-1])[::-1]
    on_longest = np.flatnonzero(ends + begins == ends.max() + 1)
    kept: list[int] = []
    for row in on_longest.tolist():
        if ends[row] == len(kept) + 1:  # the earliest of its rank; later ones of that rank are not larger
            kept.append(row)
    return np.delete(np.arange(len(time_s)), inside[kept])


def _last(time_s: Floats, ends: Rows, steps: Floats) -> int:
    """Return the last row that is kept: the earliest of those that are not far ahead of the others."""
    candidates = np.flatnonzero(ends == ends.max())
    forward = steps[steps > 0]
    near_s = GAP * float(np.median(forward)) if len(forward) else 0.0
    return int(candidates[time_s[candidates] <= time_s[candidates].min() + near_s][0])


def strays(time_s: Floats) -> Strays | None:
    """Return the rows at an end of rising ``time_s`` (n,) whose stamps are wrong; None: there are none.

    At most a few rows that are farther from the others than these last, or all rows before the clock was set.
    """
    steps = np.diff(time_s)
    if len(steps) < 2 * _LONE:
        return None
    at = int(np.argmax(steps))
    jump_s, rows = float(steps[at]), np.arange(len(time_s))
    first, last = rows[: at + 1], rows[at + 1 :]
    if time_s[at] < _UNSET_S and time_s[at + 1] >= UNIX_S and len(first) < len(last):
        return Strays(first, jump_s, True)
    fewer = min(first, last, key=len)
    if len(fewer) <= _LONE and jump_s > float(time_s[-1] - time_s[0]) - jump_s:
        return Strays(fewer, jump_s, False)
    return None


def long_run(dropped: Rows, time_s: Floats) -> tuple[int, int] | None:
    """Return the first and last row of a run of dropped rows that are no lone stamps; None: there is none.

    A clock that was set back parts a recording in two.  Rows that repeat one stamp are no such run.
    """
    if len(dropped) == 0:
        return None
    parts = np.split(dropped, np.flatnonzero(np.diff(dropped) > 1) + 1)
    longest = max(parts, key=len)
    distinct = len(np.unique(time_s[longest]))
    if distinct < max(_LONG_RUN, _LONG_SHARE * len(time_s)):
        return None
    return int(longest[0]), int(longest[-1])


def _lengths(time_s: Floats) -> Rows:
    """Return (n,) the length of the longest rising subsequence that ends in each row."""
    tails: list[float] = []
    lengths = np.empty(len(time_s), np.int64)
    for row, stamp in enumerate(time_s.tolist()):
        at = bisect_left(tails, stamp)
        if at == len(tails):
            tails.append(stamp)
        else:
            tails[at] = stamp
        lengths[row] = at + 1
    return lengths
