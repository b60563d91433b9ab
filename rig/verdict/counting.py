"""Frames that a monitor counted before it isolated a channel, and the fault that it was isolated for.

The count is that of persistence.py, made again from the samples as the cross-channel comparison sees them when no
low-pass is set before it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.core.frame import DISCRETE_INDEX, INDEX
from rig.core.settings import in_frames
from rig.verdict.context import Agreement, Bools, Context, agreement_of, in_split
from rig.verdict.score_records import FaultScore

COMPARISON = "comparison"


class Climb(NamedTuple):
    """The last rise of a channel's count from zero: m frames, of which some were ``counted``."""

    first: int  # frame
    alone: Bools  # (m,) it miscompared
    counted: Bools  # (m,) and that was counted


def climb(fault: FaultScore, context: Context) -> Climb:
    """Return how the count rose that failed the channel of ``fault``; empty where its last frame was not counted."""
    onset, end = fault.onset_frame or 0, (fault.failed_frame or 0) + 1
    near, p = agreement_of(fault, context, onset, end), context.params[INDEX[fault.signal]]
    still = stands_still(near, int(p["split_persistence"]))
    counted = ~near.usable | (near.alone & ~still)
    taken_off = 1.0 if p["filter_gain"] > 0 else float(p["count_down"]) or len(still) + 1.0
    total = np.cumsum([0.0, *np.where(counted, 1.0, np.where(still, 0.0, -taken_off))])
    first = int(np.flatnonzero(total <= np.minimum.accumulate(total))[-1])  # where the count was zero for the last time
    return Climb(onset + first, near.alone[first:], counted[first:])


def stands_still(near: Agreement, split_persistence: int) -> Bools:
    """Return (m,) whether counts were frozen: without a majority, and after it for the time that persistence.py has."""
    without = in_split(near.pattern)
    still = without.copy()
    edges = np.flatnonzero(np.diff([False, *without, False]))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        after = slice(end, end + min(end - first, split_persistence))
        still[after] |= near.many[after] != 1
    return still


def another(fault: FaultScore, context: Context) -> FaultScore | None:
    """Return the later fault for which the channel of ``fault`` was isolated; None: ``fault`` itself, or not known.

    The miscompares that isolated the channel began with that fault, and not before.
    """
    if fault.failed_frame is None or fault.onset_frame is None:
        return None
    later = [
        other
        for other in context.score.faults
        if (other.signal, other.channel, other.failed_frame) == (fault.signal, fault.channel, fault.failed_frame)
        and other.onset_frame is not None
        and other.onset_frame > fault.onset_frame
    ]
    began = _began(fault, context) if later else None
    if began is None:
        return None
    linger = _linger(fault, context)
    return next((other for other in later if 0 <= began - (other.onset_frame or 0) <= linger), None)


def _began(fault: FaultScore, context: Context) -> int | None:
    """Return the first frame of what failed the channel of ``fault``."""
    failed = fault.failed_frame or 0
    if fault.signal in DISCRETE_INDEX:
        return failed + 1 - _linger(fault, context)
    if fault.signal not in INDEX:
        return None
    if fault.decided_by == "box":
        return failed + 1 - context.scenario.redundancy.box_persistence
    if fault.decided_by == COMPARISON and context.compares(fault):
        found = climb(fault, context)
        return found.first if len(found.counted) else fault.exceeded_frame
    return fault.exceeded_frame


def _linger(fault: FaultScore, context: Context) -> int:
    """Return for how many frames a fault must last to be found."""
    if fault.signal in INDEX:
        p = context.params[INDEX[fault.signal]]
        return max(int(p["persistence"]), int(p["split_persistence"]))
    redundancy = context.scenario.redundancy
    own = getattr(redundancy.discretes, fault.signal)
    return in_frames(own.persistence or redundancy.discrete_persistence, own.persistence_s, context.rate_hz)
