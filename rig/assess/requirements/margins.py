"""Verdict and margin of a formula over frames that are held: windows by sliding minima, linear in time.

Values of a condition are (2, C, n) of C channels at once, (2, 1, n) of what is the same on each: its verdict as 1 or
-1, and its margin; NaN where nothing was flown to decide on.
Margins: (b - a) / scale of ``a < b``, -|a - b| / scale of ``==``; ``not`` negates, ``and`` and ``always`` take the
least, ``or`` and ``eventually`` the largest; +-1 of a yes or no; +-MOST of a state; within +-MOST.  A number that is
NaN violates.  What is met has a margin of 0 or more, what is violated one of -LEAST or less.

Sources: Donze and Maler 2010, 'Robust satisfaction of temporal logic over real-valued signals'; ``until`` by
Donze, Ferrere and Maler 2013, 'Efficient robust monitoring for STL': p until[a, b] q is the least of eventually[a, b] q
and of the unbounded until from a on.  The rule for a lost aircraft is ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.requirements.formula import COMPARISONS, Node
from rig.assess.requirements.margin_kernels import (
    LEAST,
    MOST,
    least_of_windows,
    margins_of_comparison,
    margins_of_flags,
    until_backwards,
)
from rig.errors import BadInput
from rig.faults.grammar import Op
from rig.frame import to_frame

Floats = NDArray[np.float64]
_REMEMBERED: Final = 8192  # frames of a condition, so that memory stays bounded


class Held(NamedTuple):
    """Columns (Q, n) of the frames from ``first`` on, the rows of a formula's names in them, and the flight's end.

    rows : of each name its row, or one for each channel
    frames : flown, None while it goes on; lost : the aircraft was
    seen : conditions by identity, and from which frame on, of all channels
    """

    columns: Floats
    first: int
    rows: list[slice | list[int]]
    scales: list[float]  # of its comparisons
    rate_hz: float
    frames: int | None = None
    lost: bool = False
    seen: dict[int, tuple[int, Floats]] | None = None
    channel: int = -1  # the one that is measured, from 0; -1: all

    def on(self, channel: int) -> Held:
        """Return what is held of one channel."""
        rows = [_row(of, channel) for of in self.rows]
        return self._replace(rows=rows, channel=channel)

    def known(self, node: Node, a: int, b: int) -> Floats | None:
        """Return a condition in the frames ``a`` to ``b`` as it was seen, None if it was not."""
        if self.seen is None or id(node) not in self.seen:
            return None
        first, of = self.seen[id(node)]
        if a < first or b >= first + of.shape[-1]:
            return None
        part = of[..., a - first : b + 1 - first]
        return part if self.channel < 0 or part.shape[1] == 1 else part[:, self.channel : self.channel + 1]

    @property
    def end(self) -> int:
        """Frame after the last that is held."""
        return self.first + self.columns.shape[1]

    def of(self, place: int, lo: int, hi: int) -> Floats:
        """Return the quantity in the frames ``lo`` to ``hi``, (1, n) or (C, n)."""
        return self.columns[self.rows[place], lo - self.first : hi + 1 - self.first]


def _row(rows: slice | list[int], channel: int) -> slice:
    """Return the row of one channel; rows : of each, or one that all have in common."""
    if isinstance(rows, list):
        row = rows[channel]
    else:
        row = rows.start if rows.stop - rows.start == 1 else rows.start + channel
    return slice(row, row + 1)


def frames_of(node: Node, rate_hz: float) -> tuple[int, int]:
    """Return the first and last frame of a window, counted from its instant; both ends are included."""
    begin_s, end_s = node.window
    return to_frame(begin_s, rate_hz), -to_frame(-end_s, rate_hz)


def refuse_empty_windows(root: Node, rate_hz: float) -> None:
    """BadInput: a window between two frames."""
    for node in root.walk():
        first, last = frames_of(node, rate_hz)
        if last < first:
            begin_s, end_s = node.window
            raise BadInput(f"[{begin_s:g}, {end_s:g}]: no frame is in this window at {rate_hz:g} frames a second")


def frames_reach(node: Node, rate_hz: float) -> tuple[int, int]:
    """Return how many frames a formula looks back and ahead."""
    below = [frames_reach(part, rate_hz) for part in node.parts]
    back, ahead = max((b for b, _ in below), default=0), max((a for _, a in below), default=0)
    last = frames_of(node, rate_hz)[1]
    return (back + last, ahead) if node.op == Op.ONCE else (back, ahead + last)


def values(node: Node, lo: int, hi: int, held: Held) -> Floats:
    """Return (2, C, hi - lo + 1) of a condition in the frames ``lo`` to ``hi``; NaN in those that are not held."""
    a, b = max(lo, held.first), min(hi, held.end - 1)
    if a == lo and b == hi:
        return _condition(node, a, b, held)
    if a > b:
        return np.full((2, 1, hi - lo + 1), np.nan)
    of_range = _condition(node, a, b, held)
    out = np.full((2, of_range.shape[1], hi - lo + 1), np.nan)
    out[..., a - lo : b + 1 - lo] = of_range
    return out


def _condition(node: Node, a: int, b: int, held: Held) -> Floats:
    """Return (2, C, b - a + 1) of frames that are held, and remember it."""
    remembered = held.known(node, a, b)
    if remembered is not None:
        return remembered
    measured = _measured(node, a, b, held)
    if held.seen is not None and held.channel < 0 and b - a < _REMEMBERED:
        held.seen[id(node)] = a, measured
    return measured


def _measured(node: Node, a: int, b: int, held: Held) -> Floats:
    if node.op == Op.HOLDS:
        return _yes_no(held.of(node.place, a, b), node.sign)
    if node.op in COMPARISONS:
        return _compared(node, a, b, held)
    if node.op == Op.NOT:
        negated = -values(node.parts[0], a, b, held)
        return np.where(negated == 0.0, -LEAST, negated)  # of margins alone: what was met by 0 is violated
    if node.op == Op.STATE:
        verdicts, _ = values(node.parts[0], a, b, held)
        return np.stack([verdicts, MOST * verdicts])
    if node.op in (Op.AND, Op.OR):
        least = np.fmin if node.op == Op.AND else np.fmax  # what was not flown does not count
        return least(*(values(part, a, b, held) for part in node.parts))
    first, last = frames_of(node, held.rate_hz)
    if node.op == Op.ALWAYS:
        return _cut(_in_window(node, a + first, b + last, last - first + 1, held), a, b, node, held)
    if node.op == Op.EVENTUALLY:
        return _in_window(node, a + first, b + last, last - first + 1, held)
    if node.op == Op.ONCE:
        return _in_window(node, a - last, b - first, last - first + 1, held)
    return _until(node, a, b, held)


def _in_window(node: Node, lo: int, hi: int, width: int, held: Held) -> Floats:
    """Return (2, C, n) of n windows that begin from frame ``lo`` on and end up to ``hi``."""
    part, least = node.parts[0], node.op == Op.ALWAYS
    if hi - lo + 1 > width:
        return (least_of if least else largest_of)(values(part, lo, hi, held), width)
    a, b = max(lo, held.first), min(hi, held.end - 1)
    if a > b:
        return np.full((2, 1, 1), np.nan)
    return (np.fmin if least else np.fmax).reduce(_condition(part, a, b, held), axis=-1, keepdims=True)


def values_at(node: Node, instants: Sequence[int], channels: int, held: Held) -> Floats:
    """Return (2, channels, m) of a condition at m instants, in order: windows between them are not gone through."""
    out = np.empty((2, channels, len(instants)))
    if node.op in (Op.ALWAYS, Op.EVENTUALLY):
        first, last = frames_of(node, held.rate_hz)
        a, b = max(instants[0] + first, held.first), min(instants[-1] + last, held.end - 1)
        if b - a >= _REMEMBERED:
            out[:] = values(node, instants[0], instants[-1], held)[..., np.array(instants) - instants[0]]
            return out
        if a <= b:
            _condition(node.parts[0], a, b, held)  # remembered
    for i, k in enumerate(instants):
        out[..., i] = values(node, k, k, held)[..., 0]
    return out


def _yes_no(column: Floats, sign: int) -> Floats:
    out = np.empty((2, *column.shape))
    margins_of_flags(column, sign, out)
    return out


def _compared(node: Node, a: int, b: int, held: Held) -> Floats:
    left, right = (number(part, a, b, held) for part in node.parts)
    apart = right - left if node.op in (Op.LESS, Op.LESS_EQUAL) else left - right
    if node.op in (Op.EQUAL, Op.NOT_EQUAL):
        apart = np.abs(apart) if node.op == Op.NOT_EQUAL else -np.abs(apart)
    if not isinstance(apart, np.ndarray):  # of two numbers
        apart = np.full((1, b - a + 1), apart)
    out = np.empty((2, *apart.shape))
    strict = node.op in (Op.LESS, Op.GREATER, Op.NOT_EQUAL)
    margins_of_comparison(apart, strict, held.scales[node.place], node.sign, out)
    return out


def number(node: Node, a: int, b: int, held: Held) -> Floats | float:
    """Return a number in the frames ``a`` to ``b``; errors of arithmetic are the caller's to ignore."""
    if node.op == Op.NUMBER:
        return node.value
    if node.op == Op.QUANTITY:
        return held.of(node.place, a, b)
    of = [number(part, a, b, held) for part in node.parts]
    match node.op:
        case Op.NEGATE:
            return -of[0]
        case Op.ABS:
            return np.abs(of[0])
        case Op.ADD:
            return of[0] + of[1]
        case Op.SUBTRACT:
            return of[0] - of[1]
        case Op.MULTIPLY:
            return of[0] * of[1]
        case Op.DIVIDE:
            return np.where(np.equal(of[1], 0.0), np.nan, np.divide(of[0], of[1]))  # as in a trigger
        case Op.MIN:
            return np.minimum(of[0], of[1])
    return np.maximum(of[0], of[1])


def least_of(of: Floats, width: int) -> Floats:
    """Return (2, C, n) the least of each ``width`` neighbours of (2, C, n + width - 1); NaN only where all are."""
    return _extremes(of, width, 1.0)


def largest_of(of: Floats, width: int) -> Floats:
    """Return what ``least_of`` does, of the largest."""
    return _extremes(of, width, -1.0)


def _extremes(of: Floats, width: int, sign: float) -> Floats:
    if width == 1:
        return of
    out = np.empty((*of.shape[:2], of.shape[2] - width + 1))
    least_of_windows(of, width, sign, np.empty(of.shape[2], np.int64), out)
    return out


def _cut(out: Floats, a: int, b: int, node: Node, held: Held) -> Floats:
    """Violate each ``always`` that a lost aircraft cuts: at most -1 minus the share that was not flown."""
    if not held.lost or held.frames is None:
        return out
    first, last = frames_of(node, held.rate_hz)
    width = last - first + 1
    missing = np.clip(np.arange(a, b + 1) + last - (held.frames - 1), 0, width)
    cut = missing > 0
    if not cut.any():
        return out
    out = out.copy()
    out[0][:, cut], out[1][:, cut] = -1.0, np.fmin(out[1][:, cut], -1.0 - missing[cut] / width)
    return out


def _until(node: Node, a: int, b: int, held: Held) -> Floats:
    """Return the least of: eventually q; p up to the window; and p until q, without a bound, from there on."""
    first, last = frames_of(node, held.rate_hz)
    left, right = (values(part, a, b + last, held) for part in node.parts)
    reached = largest_of(right[..., first:], last - first + 1)
    p, q = np.broadcast_arrays(left, right)
    p = np.where(np.isnan(p), np.inf, p)
    unbounded = np.empty((2, p.shape[1], p.shape[2]))
    q = np.where(np.isnan(q), -np.inf, q)
    until_backwards(*(of.reshape(-1, of.shape[-1]) for of in (p, q, unbounded)))
    out = np.minimum(reached, unbounded[..., first : first + b - a + 1])  # NaN where nothing was flown stays
    if first > 0:
        before = least_of(p[..., : b - a + first], first)
        out = np.fmin(out, np.where(np.isnan(reached), np.nan, before))
    return out


def decisive(node: Node, k: int, held: Held) -> int:
    """Return the frame whose numbers give the margin of a condition in frame ``k``, on one channel."""
    if node.op == Op.HOLDS or node.op in COMPARISONS:
        return k
    if node.op in (Op.NOT, Op.STATE):
        return decisive(node.parts[0], k, held)
    if node.op in (Op.AND, Op.OR):
        margins = [values(part, k, k, held)[1, 0, 0] for part in node.parts]
        chosen = _extreme(np.array(margins), node.op == Op.AND)
        return k if chosen is None else decisive(node.parts[chosen], k, held)
    first, last = frames_of(node, held.rate_hz)
    if node.op == Op.UNTIL:
        return _decisive_until(node, k, held)
    lo, hi = (k - last, k - first) if node.op == Op.ONCE else (k + first, k + last)
    lo, until = max(lo, held.first), min(hi, held.end - 1)
    margins = values(node.parts[0], lo, until, held)[1, 0] if lo <= until else np.empty(0)
    chosen = _extreme(margins, node.op == Op.ALWAYS)
    cut = node.op == Op.ALWAYS and held.lost and held.frames is not None and hi >= held.frames
    if chosen is None or (cut and margins[chosen] > -1.0):
        return min(hi, held.end - 1)
    return decisive(node.parts[0], lo + chosen, held)


def _extreme(margins: Floats, least: bool) -> int | None:
    chosen = int(margins.argmin() if least else margins.argmax()) if len(margins) else -1
    if chosen < 0 or not np.isnan(margins[chosen]):  # numpy finds a NaN first
        return None if chosen < 0 else chosen
    missing = np.isnan(margins)
    return None if missing.all() else _extreme(np.where(missing, np.inf if least else -np.inf, margins), least)


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
