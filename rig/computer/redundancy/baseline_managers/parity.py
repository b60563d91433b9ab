"""Parity space: differences of the samples without the quantity that they measure.

p = V x with V V' = I and V H = 0, H ones: then p'p is the sum of squares about the mean, and for the column v_c of V
(v_c'p)^2 / v_c'v_c is (x_c - mean)^2 / (1 - 1/n).  p'p above the limit of n samples, in ``persistence`` frames in a row
that point to one channel, fails that along which p is largest; published at once, without a persistence.  For two
camps that are as far off, the one that is further from the usable reference fails (added).

Sources: Potter and Suman 1977, Thresholdless redundancy management with arrays of skewed instruments; Daly, Gai and
Harrison 1979, Generalized likelihood test for FDI in redundant sensor configurations.
"""

from __future__ import annotations

from rig.computer.redundancy.baseline_managers import step
from rig.computer.redundancy.baselines import mean_of
from rig.core.kernels import kernel


@kernel
def parity(bus, fcc, s, p, st, on):
    """Compare the parity vector of signal s with its limit, and vote the mean of those in use."""
    if on is None:  # not chosen
        return
    at = step.begin(bus, fcc, s, p, st)
    length = project(at, p, st) if at.n > 1 else 0.0
    worst = blamed(at, st) if length > step.limit_of(at.n, p) else step.NO_CHANNEL
    voted = at.middle if p["votes_middle"] or at.n == 0 else mean_of(st, at.n)
    step.end(bus, fcc, s, at, step.slow_faults(worst, p, st), voted, p, st)


@kernel
def project(at, p, st):
    """Write (v_c'p)^2 / v_c'v_c of each channel, square thresholds; return p'p."""
    n, unit, mean, length = at.n, p["threshold"], 0.0, 0.0
    for i in range(n):
        mean += step.residual(st["order"][i], at, unit, st) / n
    for i in range(n):
        c = st["order"][i]
        off = step.residual(c, at, unit, st) - mean
        st["statistic"][c] = off * off / (1.0 - 1.0 / n)
        length += off * off
    return length


@kernel
def blamed(at, st):
    """Return the channel along which p is largest; for an even split one of the half far from the reference."""
    order, statistic, worst = st["order"], st["statistic"], st["order"][0]
    for i in range(at.n):
        if statistic[order[i]] > statistic[worst]:
            worst = order[i]
    if not at.usable or not step.even_split(at, statistic[worst], st):
        return worst
    half, low, high = at.n // 2, st["x"][order[0]], st["x"][order[at.n - 1]]
    near_low = abs(at.reference - low) < abs(at.reference - high)
    worst = order[half] if near_low else order[0]
    for i in range(half):
        c = order[half + i] if near_low else order[i]
        if statistic[c] > statistic[worst]:
            worst = c
    return worst
