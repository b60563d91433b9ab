"""What lasts: a bias that is learned, small deviations summed over seconds, samples that repeat.

All three are ours (docs/redundancy.md, 'What lasts') and off by default.  The residual of a channel is its sample less
the middle of those in use: their median, or of an even number the usable reference between the two in the middle,
else the mean of those.  Nothing here moves a vote: it changes who is compared with whom, and who is failed.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.redundancy import opinions, vote
from rig.computer.redundancy.compare import is_singular, outlier_threshold, sort
from rig.frame import Pattern
from rig.kernels import kernel

NOBODY: Final = -1
_CALM: Final = 0.5  # of the limit: what a strict majority must be below, or the sums cannot tell who is right


@kernel
def middle(n, reference, st):
    """Return the middle of ``n`` ranked samples, n >= 1; reference : NaN where there is none."""
    x, order = st["x"], st["order"]
    low, high = x[order[(n - 1) // 2]], x[order[n // 2]]
    if n % 2 == 0 and st["reference_usable"] and not np.isnan(reference):
        return opinions.middle(high, low, reference)
    return vote.mean(low, high, 0.5)


@kernel
def take_bias_off(values, order, n, st):
    """Write ``compared`` (4,), the ``n`` ranked values less each channel's bias, and ``compared_order``."""
    compared, compared_order, bias = st["compared"], st["compared_order"], st["bias"]
    for i in range(n):
        c = order[i]
        compared[c], compared_order[i] = values[c] - bias[c], c
    sort(compared, compared_order, n)


@kernel
def learn_bias(n, reference, p, st):
    """Move each channel's bias towards its residual, within the bound; nobody's who is suspected.

    The bias is the mean of the residuals for as many frames as the time constant has, then it follows.
    """
    if p["bias_bound"] <= 0.0 or n < 2 or st["pattern"] != Pattern.NORMAL:
        return
    x, order, bias, bound = st["x"], st["order"], st["bias"], p["bias_bound"]
    m = middle(n, reference, st)
    for i in range(n):
        c = order[i]
        if st["miscomparing"][c] or st["blamed"][c] or st["count"][c] != 0:
            continue
        gain = p["bias_gain"]
        if st["learned"][c] * gain < 1.0:
            gain = max(gain, 1.0 / (st["learned"][c] + 1.0))
        bias[c] = min(max(bias[c] + gain * (x[c] - m - bias[c]), -bound), bound)
        st["learned"][c] += 1


@kernel
def has_learned(n, p, st):
    """Return True if the bias of each of the ``n`` ranked channels is a mean over the time constant, or none is on."""
    if p["bias_bound"] <= 0.0:
        return True
    learned = True
    for i in range(n):
        learned &= (st["learned"][st["order"][i]] + 0.5) * p["bias_gain"] >= 1.0
    return learned


@kernel
def outlier_limit(n, p, st):
    """Return the outlier threshold of ``n`` samples; 0, none, until it can be kept to without the biases."""
    limit = outlier_threshold(n, p)
    return limit if limit > 0.0 and has_learned(n, p, st) else 0.0


@kernel
def watch_sums(n, reference, p, st):
    """Sum what each residual exceeds the allowance by, upwards and downwards; return whom that fails, or NOBODY.

    Page 1954, with a step of at most limit / (persistence - 1/2): what lasts less than the persistence fails nobody,
    however large.  At most one channel a frame, and none without a strict majority that is calm.
    """
    if p["slow_limit"] <= 0.0 or n < 3 or is_singular(st["pattern"]):
        return NOBODY
    limit, m, worst, calm, largest = p["slow_limit"], middle(n, reference, st), NOBODY, 0, p["slow_limit"]
    most, allowance = limit / (p["persistence"] - 0.5), p["slow_allowance"]
    for i in range(n):
        c = st["order"][i]
        residual = st["x"][c] - st["bias"][c] - m
        st["above"][c] = _sum(st["above"][c], residual - allowance, most)
        st["below"][c] = _sum(st["below"][c], -residual - allowance, most)
        reached = max(st["above"][c], st["below"][c])
        calm += reached < _CALM * limit
        if reached > largest:
            worst, largest = c, reached
    return worst if 2 * calm > n else NOBODY


@kernel
def _sum(last, excess, most):
    step = min(excess, most)
    return max(last + step, 0.0) if np.isfinite(step) else 0.0


@kernel
def begin_sums(st):
    """Set all sums of a signal to zero: another number of channels has another middle."""
    st["above"][:] = 0.0
    st["below"][:] = 0.0


@kernel
def count_repeats(samples, p, st):
    """Count the frames in a row in which each channel's sample was the last one again, bit for bit."""
    if p["stale_frames"] == 0:
        return
    for c in range(p["fitted"]):
        st["repeats"][c] = st["repeats"][c] + 1 if samples[c] == st["last_sample"][c] else 0
        st["last_sample"][c] = samples[c]


@kernel
def is_stale(c, p, st):
    """Return True if a channel's sample has repeated for ``stale_frames``."""
    return 0 < p["stale_frames"] <= st["repeats"][c]


@kernel
def mark_stale(n, p, st):
    """Let the ranked samples that repeat miscompare."""
    if p["stale_frames"] == 0:
        return
    for i in range(n):
        c = st["order"][i]
        if is_stale(c, p, st):
            st["miscomparing"][c] = True
