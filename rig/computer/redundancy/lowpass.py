"""The low-pass of the monitor: channels are compared by it, and never voted by it.

Vibration that the channels do not share makes samples of one frame differ more than the faults that are to be found.
y(k) = y(k-1) + gain (x(k) - y(k-1)), a step of at most threshold / (persistence - 1/2).  The limit keeps a burst that
is shorter than the persistence, however large, from moving the low-pass by a threshold.  So a low-pass that begins, at
first and after a sample that cannot be compared, begins with no sample, which may be of a burst: where the vote is.
Added: docs/explanation/decisions.md, 'A filter before the comparison'.
"""

from __future__ import annotations

from math import expm1

import numpy as np

from rig.computer.redundancy.compare import comparable, sort_again
from rig.computer.redundancy.median_vote import mean
from rig.computer.redundancy.slow_faults import is_stale
from rig.core.kernels import kernel
from rig.core.units.angles import difference


def gain(filter_s: float, rate_hz: float) -> float:
    """Return the share of a new sample for a time constant, exact for a signal held between frames; 0: no filter."""
    return -expm1(-1.0 / (rate_hz * filter_s)) if filter_s > 0.0 else 0.0


@kernel
def begins_at(n, st):
    """Return where a low-pass begins: at the smoothed vote, at first between the two ranks of ``n`` samples; or NaN."""
    if np.isfinite(st["smooth_vote"]) or n == 0:
        return st["smooth_vote"]
    return mean(st["x"][st["order"][(n - 1) // 2]], st["x"][st["order"][n // 2]], 0.5)


@kernel
def follow(last, x, base, p):
    """Return the next value of the low-pass, an angle within half a turn of ``base``; starts with ``x`` after NaN."""
    if np.isnan(last):
        return x
    step, limit = p["filter_gain"] * difference(x, last, p["wraps"]), p["threshold"] / (p["persistence"] - 0.5)
    if np.isfinite(step) and abs(step) > limit:
        step = np.copysign(limit, step)
    y = last + step
    if p["wraps"]:
        y = base + difference(y, base, p["wraps"])
    return y if np.isfinite(y) else x


@kernel
def smooth_channels(samples, valid, base, start, n, p, st):
    """Move the low-pass of every channel by a frame, and rank the ``n`` comparable ones of it, equals by their samples.

    start : where one begins
    Writes ``smooth`` (4,), NaN where the sample cannot be compared, and ``smooth_order``.
    """
    smooth, order, raw_order = st["smooth"], st["smooth_order"], st["order"]
    for c in range(p["fitted"]):
        if comparable(samples[c], valid[c], p["low"], p["high"]) and not is_stale(c, st):
            x = base + difference(samples[c], base, p["wraps"]) if p["wraps"] else samples[c]
            smooth[c] = follow(start if np.isnan(smooth[c]) else smooth[c], x, base, p)
        else:
            smooth[c] = np.nan
    for i in range(n):
        order[i] = raw_order[i]
    sort_again(smooth, order, n)
