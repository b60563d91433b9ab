"""The low-pass of the monitor: channels are compared by it, and never voted by it.

Vibration that the channels do not share makes samples of one frame differ more than the faults that are to be found.
y(k) = y(k-1) + gain d, d = x(k) - y(k-1) within +-3 thresholds, with the first comparable sample as first value, and
again after one that is not.  The limit keeps one bad sample, however large, from being seen for a persistence.
Ours: docs/redundancy.md, 'A filter before the comparison'.
"""

from __future__ import annotations

from math import expm1
from typing import Final

import numpy as np

from rig.computer.redundancy.compare import comparable, sort
from rig.kernels import kernel
from rig.units.angles import difference

LARGEST_STEP: Final = 3.0  # thresholds: what one sample may tell the low-pass


def gain(filter_s: float, rate_hz: float) -> float:
    """Return the share of a new sample for a time constant, exact for a signal held between frames; 0: no filter."""
    return -expm1(-1.0 / (rate_hz * filter_s)) if filter_s > 0.0 else 0.0


@kernel
def follow(last, x, base, p):
    """Return the next value of the low-pass, an angle within half a turn of ``base``; starts with ``x`` after NaN."""
    if np.isnan(last):
        return x
    step, limit = difference(x, last, p["wraps"]), LARGEST_STEP * p["threshold"]
    if np.isfinite(step) and abs(step) > limit:
        step = np.copysign(limit, step)
    y = last + p["filter_gain"] * step
    if p["wraps"]:
        y = base + difference(y, base, p["wraps"])
    return y if np.isfinite(y) else x


@kernel
def smooth_channels(samples, valid, base, n, p, st):
    """Move the low-pass of every channel by a frame, and rank the ``n`` comparable ones of it.

    Writes ``smooth`` (4,), NaN where the sample cannot be compared, and ``smooth_order``.
    """
    smooth, order, raw_order = st["smooth"], st["smooth_order"], st["order"]
    for c in range(p["fitted"]):
        if comparable(samples[c], valid[c], p["low"], p["high"]):
            x = base + difference(samples[c], base, p["wraps"]) if p["wraps"] else samples[c]
            smooth[c] = follow(smooth[c], x, base, p)
        else:
            smooth[c] = np.nan
    for i in range(n):
        order[i] = raw_order[i]
    sort(smooth, order, n)
