"""Sums of small deviations, and samples that repeat.

Both are added (docs/explanation/decisions.md, 'Slow faults').  Nothing here moves a vote: channels are isolated, or
left out of the comparison.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.redundancy import median_vote as vote
from rig.computer.redundancy import opinions
from rig.computer.redundancy.compare import comparable, is_split
from rig.computer.redundancy.reference_monitor import REFERENCE_MARGIN, reference_threshold
from rig.computer.redundancy.slow_tests import middle_without_bias
from rig.core.kernels import kernel
from rig.core.units.angles import difference

NO_CHANNEL: Final = -1
CALM: Final = 0.5  # of the limit: what a strict majority must be below, or the sums cannot tell who is right


@kernel
def lasts(p):
    """Return True if residuals of a signal are summed or tested."""
    return p["slow_limit"] > 0.0 or p["slow_means"] > 0.0


@kernel
def summed_from(n, reference, p, st):
    """Return what the summed residuals of ``n`` ranked samples, n >= 1, are measured from.

    With slow-fault tests it is the median of the samples without their biases; without tests ``middle``.
    """
    if p["slow_means"] > 0.0:
        return middle_without_bias(n, st, st["tests"])
    return middle(st["x"], st["order"], n, reference if st["reference_usable"] else np.nan)


@kernel
def middle(values, order, n, reference):
    """Return the middle of ``n`` ranked values, n >= 1: their median, or for an even number a usable reference.

    The reference is limited to the range between the two middle ones; NaN where there is none, or none is usable.
    """
    low, high = values[order[(n - 1) // 2]], values[order[n // 2]]
    if n % 2 == 0 and not np.isnan(reference):
        return opinions.middle(high, low, reference)
    return vote.mean(low, high, 0.5)


@kernel
def watch_sums(m, n, p, st):
    """Sum what each residual exceeds the allowance by, upwards and downwards; return which fails, or ``NO_CHANNEL``.

    Page 1954, with a step of at most limit / (persistence - 1/2): an error shorter than the persistence isolates no
    channel, however large.  At most one channel a frame, and none without a strict majority that is calm.
    m : the middle of the ``n`` ranked samples, n >= 3; the signal has a limit
    """
    limit = p["slow_limit"]
    if is_split(st["pattern"]):
        return NO_CHANNEL
    calm, most = 0, limit / (p["persistence"] - 0.5)
    for i in range(n):
        calm += sum_one(st["order"][i], m, most, p, st) < CALM * limit
    return largest_sum(n, limit, st) if 2 * calm > n else NO_CHANNEL


@kernel
def sum_one(c, m, most, p, st):
    """Move the two sums of a channel by a frame; return the larger one."""
    above, below, allowance = st["above"], st["below"], p["slow_allowance"]
    residual = st["x"][c] - st["tests"]["bias"][c] - m
    above[c] = _sum(above[c], residual - allowance, most)
    below[c] = _sum(below[c], -residual - allowance, most)
    return max(above[c], below[c])


@kernel
def _sum(last, excess, most):
    step = min(excess, most)
    return max(last + step, 0.0) if np.isfinite(step) else 0.0


@kernel
def largest_sum(n, limit, st):
    """Return the channel with the largest sum beyond the limit, or ``NO_CHANNEL``; of equals the least sample's."""
    worst = NO_CHANNEL
    for i in range(n):
        c = st["order"][i]
        reached = max(st["above"][c], st["below"][c])
        if reached > limit:
            worst, limit = c, reached
    return worst


@kernel
def begin_sums(st):
    """Set all sums of a signal to zero: another number of channels has another middle."""
    st["above"][:] = st["below"][:] = 0.0


@kernel
def count_repeats(samples, valid, reference, seen, p, st):
    """Count the frames in which each channel's sample was the last one again, bit for bit, while most others moved.

    A frame without a sample counts neither way.  Nothing is told by a sample at the end of the range, nor where most
    repeat alike: sensors at their stop, or at rest with a coarse quantum, are in order, unless a usable reference
    contradicts them.  Beside the only channel in use its reference is what moves.
    reference, seen : as it is, and as the sensors could read it
    Writes ``repeats``, and with ``stale_frames`` also ``standing`` and ``stale``, a bit for each channel that
    has repeated that often.
    """
    frames, repeats, last, failed = p["stale_frames"], st["repeats"], st["last_sample"], st["failed"]
    if frames == 0 and p["slow_means"] <= 0.0:
        return
    low, high, in_use, moving, repeating = p["low"], p["high"], 0, 0, 0
    for c in range(p["fitted"]):  # no branch here: with a coarse quantum none is predictable
        x, working = samples[c], not failed[c]
        there = comparable(x, valid[c], low, high)
        moved = there & (x != last[c])
        repeats[c] = 0 if moved else repeats[c]
        last[c] = x if moved else last[c]
        repeating |= np.int64(there != moved) << c
        moving += moved & working
        in_use += there & working
    reference_moved = np.isfinite(reference) and reference != st["last_reference"]
    st["last_reference"], st["stale"], st["standing"] = reference, 0, frames > 0 and moving == 0
    if repeating == 0:
        return
    stale = 0
    for c in range(p["fitted"]):
        if (repeating >> c) & 1 == 0:
            continue
        others = in_use - (not failed[c])
        at_stop = p["wraps"] == 0 and (samples[c] <= low or samples[c] >= high)
        beside_movers = reference_moved if others == 0 else 2 * moving >= others
        if (beside_movers and not at_stop) or contradicts(seen, samples[c], p, st):
            repeats[c] += 1
        elif at_stop:
            repeats[c] = 0
        stale |= np.int64(repeats[c] >= frames and frames > 0) << c
    st["stale"] = stale


@kernel
def contradicts(seen, sample, p, st):
    """Return True if a usable reference is off a sample that repeats; seen : NaN where there is none."""
    off = abs(difference(sample, seen, p["wraps"]))
    return st["reference_usable"] != 0 and off > REFERENCE_MARGIN * reference_threshold(seen, p)


@kernel
def is_stale(c, st):
    """Return True if a channel's sample has repeated for ``stale_frames``."""
    return (st["stale"] >> c) & 1 != 0
