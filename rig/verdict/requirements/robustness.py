"""Verdict and robustness of a formula over frames that are held: windows by sliding minima, linear in time.

Values of a condition are (2, C, n) of C channels at once, (2, 1, n) of what is the same on each: its verdict as 1 or
-1, and its robustness; NaN where nothing was flown to decide on.
Robustness: (b - a) / scale of ``a < b``, -|a - b| / scale of ``==``; ``not`` negates, ``and`` and ``always`` take the
least, ``or`` and ``eventually`` the largest; +-1 of a yes or no; +-MOST of a state; within +-MOST.  A number that is
NaN violates.  A met requirement has a robustness of 0 or more, a violated one -LEAST or less.

Sources: Donze and Maler 2010, 'Robust satisfaction of temporal logic over real-valued signals'; ``until`` by
Donze, Ferrere and Maler 2013, 'Efficient robust monitoring for STL': p until[a, b] q is the least of eventually[a, b] q
and of the unbounded until from a on.  The rule for a lost aircraft is this project's.
"""

from __future__ import annotations

from functools import lru_cache
from math import isfinite
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import to_frame
from rig.core.kernels import kernel
from rig.verdict.requirements.formula import COMPARISONS, Node
from rig.world.faults.grammar import Op

Floats = NDArray[np.float64]
MOST: Final = 1000.0  # JSON has no infinity; that of a state, which has no distance
LEAST: Final = 1e-9  # a robustness is never nearer below 0: met is 0 and above, violated is below 0
_TINY: Final = 1e-6  # below which a robustness under 0 is shown as that of a strict comparison of equals
_STRICT: Final = (Op.LESS, Op.GREATER, Op.NOT_EQUAL)
_ARITHMETIC: Final[dict[Op, Any]] = {
    **{Op.NEGATE: np.negative, Op.ABS: np.abs, Op.ADD: np.add, Op.SUBTRACT: np.subtract, Op.MULTIPLY: np.multiply},
    **{Op.MIN: np.minimum, Op.MAX: np.maximum},
    Op.DIVIDE: lambda a, b: np.where(np.equal(b, 0.0), np.nan, np.divide(a, b)),  # as in a trigger
}


class Held(NamedTuple):
    """Columns (Q, n) of the frames from ``first`` on, the rows of a formula's names in them, and the flight's end.

    rows : of each name its row, or one for each channel
    frames : flown, None during the flight; lost : the aircraft was
    """

    columns: Floats
    first: int
    rows: tuple[NDArray[np.intp], ...]
    scales: tuple[float, ...]  # of its comparisons
    rate_hz: float
    frames: int | None = None
    lost: bool = False
    channel: int | None = None  # None: all
    seen: dict[int, tuple[int, Floats]] | None = None  # values of nodes from a frame on, of all channels

    @property
    def end(self) -> int:
        """Frame after the last that is held."""
        return self.first + self.columns.shape[1]

    def on(self, channel: int) -> Held:
        """Return what is held of one channel."""
        rows = tuple(row[min(channel, len(row) - 1) :][:1] for row in self.rows)
        return self._replace(rows=rows, channel=channel)

    def of(self, place: int, a: int, b: int) -> Floats:
        """Return a quantity in the frames ``a`` to ``b``, (1, n) or (C, n)."""
        return self.columns[self.rows[place], a - self.first : b + 1 - self.first]


def frames_of(node: Node, rate_hz: float) -> tuple[int, int]:
    """Return the first and last frame of a window, counted from its instant; both ends are included."""
    return _frames(node.window, rate_hz)


@lru_cache(maxsize=1024)
def _frames(window: tuple[float, float], rate_hz: float) -> tuple[int, int]:
    return to_frame(window[0], rate_hz), -to_frame(-window[1], rate_hz)


def refuse_empty_windows(root: Node, rate_hz: float) -> None:
    """BadInput: a window between two frames."""
    for node in root.walk():
        first, last = frames_of(node, rate_hz)
        if last < first:
            begin_s, end_s = node.window
            raise BadInput(f"[{begin_s:g}, {end_s:g}]: the window contains no frame at {rate_hz:g} frames a second")


def frames_reach(node: Node, rate_hz: float) -> tuple[int, int]:
    """Return how many frames a formula looks back and ahead."""
    below = [frames_reach(part, rate_hz) for part in node.parts]
    back, ahead = (max((each[i] for each in below), default=0) for i in (0, 1))
    last = frames_of(node, rate_hz)[1]
    return (back + last, ahead) if node.op == Op.ONCE else (back, ahead + last)


def values(node: Node, lo: int, hi: int, held: Held) -> Floats:
    """Return (2, C, hi - lo + 1) of a condition in the frames ``lo`` to ``hi``; NaN in those that are not held."""
    a, b = max(lo, held.first), min(hi, held.end - 1)
    if a > b:
        return np.full((2, 1, hi - lo + 1), np.nan)
    found = _seen(node, a, b, held)
    out = found if (a, b) == (lo, hi) else np.full((2, found.shape[1], hi - lo + 1), np.nan)
    out[..., a - lo : b + 1 - lo] = found
    return out


def _seen(node: Node, a: int, b: int, held: Held) -> Floats:
    """Return what ``_condition`` does, from what was measured of all channels where it reaches so far."""
    begin, known = (held.seen or {}).get(id(node), (a, None))
    if known is not None and begin <= a and b < begin + known.shape[2]:
        channel = slice(None) if held.channel is None else slice(min(held.channel, known.shape[1] - 1), None)
        return known[:, channel, a - begin : b + 1 - begin][:, : None if held.channel is None else 1]
    found = _condition(node, a, b, held)
    if held.seen is not None and held.channel is None:
        held.seen[id(node)] = a, found
    return found


def _condition(node: Node, a: int, b: int, held: Held) -> Floats:
    """Return (2, C, b - a + 1) of frames that are held."""
    if node.op == Op.HOLDS:
        column = held.of(node.place, a, b)
        robustness = np.where(np.isnan(column), -node.sign * MOST, np.where(column != 0.0, 1.0, -1.0))
        return np.array([np.sign(robustness), robustness])
    if node.op in COMPARISONS:
        return _compared(node, a, b, held)
    if node.op == Op.NOT:
        negated = -values(node.parts[0], a, b, held)
        return np.where(negated == 0.0, -LEAST, negated)  # of robustness alone: what was met by 0 is violated
    if node.op == Op.STATE:
        verdicts, _ = values(node.parts[0], a, b, held)
        return np.stack([verdicts, MOST * verdicts])
    if node.op in (Op.AND, Op.OR):
        least = np.fmin if node.op == Op.AND else np.fmax  # what was not flown does not count
        return least(*(values(part, a, b, held) for part in node.parts))
    first, last = frames_of(node, held.rate_hz)
    if node.op == Op.UNTIL:
        return _until(node, a, b, held)
    lo, hi = (a - last, b - first) if node.op == Op.ONCE else (a + first, b + last)
    found = extremes(values(node.parts[0], lo, hi, held), last - first + 1, 1.0 if node.op == Op.ALWAYS else -1.0)
    return _cut(found, a, b, (first, last), held) if node.op == Op.ALWAYS else found


@kernel
def robustness_of_comparison(apart, strict, scale, sign, out):
    """Fill ``out`` (2, C, n) with verdict and robustness of a comparison whose sides are ``apart`` (C, n).

    strict : they must be, by more than nothing, and equals are violated by LEAST
    sign : -1 where it is negated; no number violates, whatever is negated
    """
    for c in range(apart.shape[0]):
        for k in range(apart.shape[1]):
            of = apart[c, k]
            robustness = of / scale
            wrong = np.isnan(robustness)
            met = of > 0.0 if strict else of >= 0.0
            out[0, c, k] = -sign if wrong else (1.0 if met else -1.0)
            robustness = min(max(robustness, 0.0), MOST) if met else min(max(robustness, -MOST), -LEAST)
            out[1, c, k] = -sign * MOST if wrong else robustness


def _compared(node: Node, a: int, b: int, held: Held) -> Floats:
    left, right = (number(part, a, b, held) for part in node.parts)
    apart = right - left if node.op in (Op.LESS, Op.LESS_EQUAL) else left - right
    if node.op in (Op.EQUAL, Op.NOT_EQUAL):
        apart = np.abs(apart) if node.op == Op.NOT_EQUAL else -np.abs(apart)
    apart = apart if isinstance(apart, np.ndarray) else np.full((1, b - a + 1), apart)  # of two numbers
    out = np.empty((2, *apart.shape))
    robustness_of_comparison(apart, node.op in _STRICT, held.scales[node.place], node.sign, out)
    return out


def number(node: Node, a: int, b: int, held: Held) -> Floats | float:
    """Return a number in the frames ``a`` to ``b``; errors of arithmetic are the caller's to ignore."""
    if node.op == Op.NUMBER:
        return node.value
    if node.op == Op.QUANTITY:
        return held.of(node.place, a, b)
    return _ARITHMETIC[node.op](*(number(part, a, b, held) for part in node.parts))


@kernel
def least_of_windows(of, width, sign, kept, out):
    """Fill ``out`` (2, C, n - width + 1) with the least of ``of`` (2, C, n) in each window; sign : -1 the largest.

    kept : (n,) scratch: the frames of the window that are less than all later ones, in order of time
    """
    for i in range(of.shape[0]):
        for c in range(of.shape[1]):
            first = end = 0  # of what is kept
            for k in range(of.shape[2]):
                value = sign * of[i, c, k]
                if not np.isnan(value):
                    while end > first and sign * of[i, c, kept[end - 1]] >= value:
                        end -= 1
                    kept[end] = k
                    end += 1
                if k >= width - 1:
                    if end > first and kept[first] <= k - width:
                        first += 1
                    out[i, c, k - width + 1] = of[i, c, kept[first]] if end > first else np.nan


def extremes(of: Floats, width: int, sign: float) -> Floats:
    """Return (2, C, n) the least of each ``width`` neighbours of (2, C, n + width - 1); sign : -1 the largest.

    NaN only where all are.
    """
    out = np.empty((*of.shape[:2], of.shape[2] - width + 1))
    least_of_windows(of, width, sign, np.empty(of.shape[2], np.int64), out)
    return out


def _cut(out: Floats, a: int, b: int, window: tuple[int, int], held: Held) -> Floats:
    """Violate each ``always`` that a lost aircraft cuts: at most -1 minus the share that was not flown."""
    if not held.lost or held.frames is None:
        return out
    width = window[1] - window[0] + 1
    missing = np.clip(np.arange(a, b + 1) + window[1] - (held.frames - 1), 0, width)
    share = np.fmin(out, np.array([np.full(len(missing), -1.0), -1.0 - missing / width])[:, None])
    return np.where(missing > 0, share, out)


@kernel
def until_backwards(p, q, out):
    """Fill ``out`` (m, n) with p until q to the end of the rows, p and q (m, n)."""
    for i in range(p.shape[0]):
        last = -np.inf
        for k in range(p.shape[1] - 1, -1, -1):
            last = max(q[i, k], min(p[i, k], last))
            out[i, k] = last


def _until(node: Node, a: int, b: int, held: Held) -> Floats:
    """Return the least of: eventually q; p up to the window; and p until q, without a bound, from there on."""
    first, last = frames_of(node, held.rate_hz)
    left, right = (values(part, a, b + last, held) for part in node.parts)
    reached = extremes(right[..., first:], last - first + 1, -1.0)
    p, q = np.broadcast_arrays(np.where(np.isnan(left), np.inf, left), np.where(np.isnan(right), -np.inf, right))
    unbounded = np.empty(p.shape)
    until_backwards(*(of.reshape(-1, right.shape[-1]) for of in (p, q, unbounded)))
    out = np.minimum(reached, unbounded[..., first : first + b - a + 1])  # NaN where nothing was flown stays
    if first > 0:
        before = extremes(p[..., : b - a + first], first, 1.0)
        out = np.fmin(out, np.where(np.isnan(reached), np.nan, before))
    return out


def decisive(node: Node, k: int, held: Held) -> int:
    """Return the frame whose numbers give the robustness of a condition in frame ``k``, on one channel."""
    if node.op == Op.HOLDS or node.op in COMPARISONS:
        return k
    if node.op in (Op.NOT, Op.STATE):
        return decisive(node.parts[0], k, held)
    if node.op in (Op.AND, Op.OR):
        robustness = np.array([values(part, k, k, held)[1, 0, 0] for part in node.parts])
        chosen = _extreme(robustness, node.op == Op.AND)
        return k if chosen is None else decisive(node.parts[chosen], k, held)
    if node.op == Op.UNTIL:
        return _decisive_until(node, k, held)
    first, last = frames_of(node, held.rate_hz)
    lo, hi = (k - last, k - first) if node.op == Op.ONCE else (k + first, k + last)
    lo = max(lo, held.first)
    robustness = values(node.parts[0], lo, max(lo, hi), held)[1, 0]
    chosen = _extreme(robustness, node.op == Op.ALWAYS)
    cut = node.op == Op.ALWAYS and held.lost and held.frames is not None and hi >= held.frames
    if chosen is None or (cut and robustness[chosen] > -1.0):
        return min(hi, held.end - 1)
    return decisive(node.parts[0], lo + chosen, held)


def _extreme(robustness: Floats, least: bool) -> int | None:
    """Return the place of the least or largest robustness; None where none is a number."""
    return None if np.isnan(robustness).all() else int((np.nanargmin if least else np.nanargmax)(robustness))


def _decisive_until(node: Node, k: int, held: Held) -> int:
    first, last = frames_of(node, held.rate_hz)
    p, q = (values(part, k, k + last, held)[1, 0] for part in node.parts)
    p, q = np.where(np.isnan(p), np.inf, p), np.where(np.isnan(q), -np.inf, q)
    before = np.minimum.accumulate(np.concatenate([[np.inf], p[:-1]]))
    j = first + int(np.argmax(np.minimum(q, before)[first:]))
    if not np.isfinite(q[j]):
        return min(k + last, held.end - 1)
    if q[j] <= before[j]:
        return decisive(node.parts[1], k + j, held)
    return decisive(node.parts[0], k + int(np.argmin(p[:j])), held)


def number_of(robustness: float) -> float | None:
    """Return a robustness, None where it has no number: decided by a state alone, beyond the bound, not applicable."""
    return robustness if isfinite(robustness) and abs(robustness) < MOST else None


def robustness_text(robustness: float) -> str:
    """Return a robustness for a table: ``0.42``, ``<0`` of a strict comparison of equals, "" where it has no number."""
    number = number_of(robustness)
    if number is None:
        return ""
    return "<0" if -_TINY < number < 0.0 else f"{number:.3g}"
