"""Roll-over of a recorder's clock: a counter of 16 or 32 bits, a time of day, or a time of the week begins again.

Time steps back by a known amount, less a usual step, and rises as before.  It is then unrolled, and told.
Two signs make a roll-over unmistakable: the stamps before and after are at the two ends of what the clock can show,
or the steps before, across and after it are usual ones.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
GAP: Final = 5.0  # usual steps, at most, across a roll-over
_PAUSE: Final = 1e-3  # of the whole turn: a longer step across it, if the stamps are at its ends
_FEW: Final = 4  # rows in which no roll-over can be told
_NAMED: Final = 5  # rows that are named
_DAY_S, _WEEK_S = 86_400.0, 604_800.0
_BITS: Final = (16, 32)
_TICKS_S: Final = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}


class _Turn(NamedTuple):
    """A clock that begins again after ``whole_s``."""

    name: str
    whole_s: float
    least_steps: float = 500.0  # usual steps in it, at least; of a counter in the unit of the file fewer will do


class _Found(NamedTuple):
    turn: _Turn
    shift: NDArray[np.int64]  # (n - 1,) turns that the step from each row to the next is short of


def unrolled(
    source: str, time_s: Floats, tick_s: float = 1.0, unit: str = "s", zero_s: float = 0.0
) -> tuple[Floats, list[str]]:
    """Return ``time_s`` (n,) without roll-overs, and a line that names the roll-over and its rows; none: as given.

    tick_s, unit : of the numbers in the file, s; zero_s : what the clock showed at time 0, s
    """
    steps = np.diff(time_s)
    forward = steps[steps > 0]
    if len(time_s) < _FEW or len(forward) == 0 or not np.isfinite(time_s).all() or (steps >= 0).all():
        return time_s, []
    usual_s = float(np.median(forward))
    turns = [turn for turn in _turns(tick_s, unit) if turn.whole_s >= turn.least_steps * usual_s]
    found = [made for turn in turns if (made := _of(turn, time_s + zero_s, steps, usual_s)) is not None]
    if not found:
        return time_s, []
    best = max(found, key=lambda made: int((made.shift > 0).sum()))
    past = np.concatenate([[0], np.cumsum(best.shift)])
    rows = np.flatnonzero(best.shift > 0) + 2  # counted from 1, the first after it
    return time_s + past * best.turn.whole_s, [_told(source, best.turn, rows.tolist())]


def _turns(tick_s: float, unit: str) -> list[_Turn]:
    """Return the clocks that are known, without two of one length; those in the unit of the file first."""
    ticks = {unit: tick_s, **_TICKS_S}
    counters = [
        _Turn(f"2^{bits} {name}", 2.0**bits * tick, 2.0 if name == unit else _Turn._field_defaults["least_steps"])
        for name, tick in ticks.items()
        for bits in _BITS
    ]
    turns = [*counters[: len(_BITS)], _Turn("a day", _DAY_S), _Turn("a week", _WEEK_S), *counters[len(_BITS) :]]
    return [turn for i, turn in enumerate(turns) if all(turn.whole_s != other.whole_s for other in turns[:i])]


def _of(turn: _Turn, shown_s: Floats, steps: Floats, usual_s: float) -> _Found | None:
    """Return the roll-overs of one clock; None: there are none.  shown_s : (n,) what the clock showed."""
    whole_s, few_s = turn.whole_s, GAP * usual_s
    after = steps + whole_s
    ends = _at_ends(shown_s, whole_s, min(max(few_s, _PAUSE * whole_s), 0.5 * whole_s))
    is_usual = (steps > 0) & (steps <= few_s)
    before_usual = np.concatenate([[True], is_usual[:-1]])
    next_usual = np.concatenate([is_usual[1:], [True]])
    inner = np.ones(len(steps), bool)
    inner[[0, -1]] = False  # of the first and the last row there is one step only
    smooth = (after > 0) & (after <= few_s) & before_usual & next_usual & inner & (whole_s > 100.0 * few_s)
    back = (steps < 0) & (after > 0) & (ends.back | smooth)
    if not back.any():
        return None
    again = (steps > 0) & (steps - whole_s < 0) & ends.forward & (np.abs(steps - whole_s) <= few_s)
    return _Found(turn, back.astype(np.int64) - again)


class _Ends(NamedTuple):
    back: NDArray[np.bool_]  # (n - 1,) from the upper end to the lower
    forward: NDArray[np.bool_]  # and from the lower to the upper: two rows in the wrong order


def _at_ends(shown_s: Floats, whole_s: float, near_s: float) -> _Ends:
    """Return the steps between the ends of what a clock can show, unsigned or signed."""
    back, forward = np.zeros((2, len(shown_s) - 1), bool)
    for low in (0.0, -0.5 * whole_s):
        high = low + whole_s
        if shown_s.min() < low or shown_s.max() > high:
            continue
        is_low, is_high = shown_s - low <= near_s, high - shown_s <= near_s
        back |= is_high[:-1] & is_low[1:]
        forward |= is_low[:-1] & is_high[1:]
    return _Ends(back, forward)


def _told(source: str, turn: _Turn, rows: list[int]) -> str:
    named = ", ".join(map(str, rows[:_NAMED])) + (", ..." if len(rows) > _NAMED else "")
    where = f"in row {named}" if len(rows) == 1 else f"{len(rows)} times, in rows {named}"
    return f"{source}: the time rolls over after {turn.name} ({turn.whole_s:.12g} s) {where}: unrolled"
