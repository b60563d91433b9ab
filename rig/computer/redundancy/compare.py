"""Cross-channel comparison: which samples count, how they are ranked, which pattern they make.

Source: Zhang 2023, section 2 (what a miscompare is) and section 3 with figures 2 and 3 (splits).
Added: thresholds by the number of samples, what is not comparable.
"""

from __future__ import annotations

from rig.core.frame import CHANNELS, Pattern
from rig.core.kernels import kernel
from rig.core.units.angles import difference


@kernel
def rank(samples, valid, base, p, st):
    """Put the samples that may be compared into ascending order; return their number.

    samples : (4,) this frame's channels; valid : (4,) 0 when the sensor flags the sample
    base : an angle is taken within half a turn of it; p, st : a PARAMS and a STATE record
    Reads ``failed`` and ``stale``, a bit for each channel whose sample repeats; writes ``x`` (4,), comparable values by
    channel, ``order`` (4,), channels by ascending value.
    """
    failed, stale, x, order = st["failed"], st["stale"], st["x"], st["order"]
    low, high, wraps = p["low"], p["high"], p["wraps"]
    n = 0
    for c in range(p["fitted"]):
        sample = samples[c]
        if failed[c] or (stale >> c) & 1 or not comparable(sample, valid[c], low, high):
            continue
        x[c] = base + difference(sample, base, wraps) if wraps else sample
        order[n] = c
        n += 1
    sort(x, order, n)
    return n


@kernel
def comparable(sample, valid, low, high):
    """Return True if a sample may be compared and voted: flagged valid, a number, within the sensor's range."""
    return valid != 0 and low <= sample <= high


@kernel
def threshold(n, p):
    """Return within what two of ``n`` comparable samples agree, unit of the signal (section 2; by level: added)."""
    if n == CHANNELS:
        return p["threshold"]
    return p["threshold_triplex"] if n == 3 else p["threshold_duplex"]


@kernel
def sort(x, order, n):
    """Put the first ``n`` channels of ``order`` into ascending order of ``x``.

    Five exchanges sort four; in noise no branch is predictable, so there is none to mispredict.
    """
    if n == CHANNELS:
        exchange(x, order, 0, 1)
        exchange(x, order, 2, 3)
        exchange(x, order, 0, 2)
        exchange(x, order, 1, 3)
        exchange(x, order, 1, 2)
    else:
        sort_again(x, order, n)


@kernel
def sort_again(x, order, n):
    """Put the first ``n`` channels of ``order`` into ascending order of ``x``; equals stay as they were."""
    for end in range(n - 1, 0, -1):
        for i in range(end):
            exchange(x, order, i, i + 1)


@kernel
def exchange(x, order, i, j):
    """Swap places i < j of ``order`` when they are out of order."""
    a, b = order[i], order[j]
    swapped = x[a] > x[b]
    order[i] = b if swapped else a
    order[j] = a if swapped else b


@kernel
def classify(x, order, n, threshold, miscomparing):
    """Return the pattern of ``n`` ranked samples (section 3); set ``miscomparing`` where one agrees with no other.

    Neighbours in rank decide: when two neighbours disagree, so do all pairs across the gap.
    One agreeing partner is enough, so chains a~b~c are normal.
    """
    miscomparing[:] = False
    if n == 0:
        return Pattern.LOST
    gaps, apart = 0, 0  # gaps: bit i is set when rank i and rank i + 1 disagree
    for i in range(n - 1):
        if not (x[order[i + 1]] - x[order[i]] <= threshold):
            gaps |= 1 << i
            apart += 1
    if apart == 0:
        return Pattern.NORMAL
    for i in range(n):
        below = i == 0 or (gaps >> (i - 1)) & 1 == 1
        above = i == n - 1 or (gaps >> i) & 1 == 1
        miscomparing[order[i]] = below and above
    return split_of(n, gaps, apart)


@kernel
def split_of(n, gaps, apart):
    """Return the split that the gaps make, or Pattern.ISOLATED (section 3, figures 2 and 3)."""
    if n == 4 and gaps == 0b010:
        return Pattern.P2_2
    if apart < n - 1:
        return Pattern.ISOLATED
    if n == 4:
        return Pattern.P1_1_1_1
    return Pattern.P1_1_1 if n == 3 else Pattern.P1_1


@kernel
def is_split(pattern):
    """Return True if no majority exists."""
    return Pattern.P2_2 <= pattern <= Pattern.P1_1


@kernel
def off_majority(order, n, miscomparing):
    """Return True if one of the samples in the middle miscompares: two channels are off, by different amounts."""
    return miscomparing[order[(n - 1) // 2]] != 0 or miscomparing[order[n // 2]] != 0
