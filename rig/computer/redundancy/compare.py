"""Cross-channel comparison: which samples count, how they are ranked, which pattern they make.

Source: Zhang 2023, sections 2 and 3; redundancy.md, sections 1 and 2.
"""

from __future__ import annotations

from rig.frame import CHANNELS, Pattern
from rig.kernels import kernel
from rig.units.angles import difference


@kernel
def rank(samples, valid, failed, fitted, low, high, wraps, base, x, order):
    """Put the samples that may be compared into ascending order; return their number.

    samples : (4,) this frame's channels; valid : (4,) 0 when the sensor flags the sample
    failed  : (4,) latched failures; fitted : number of channels of the signal
    low, high : range of the sensor, a sample outside is not compared; nor is NaN
    wraps, base : an angle is taken within half a turn of ``base``
    x : (4,) out, comparable values by channel; order : (4,) out, channels by ascending value
    """
    n = 0
    for c in range(fitted):
        sample = samples[c]
        if failed[c] or not comparable(sample, valid[c], low, high):
            continue
        x[c] = base + difference(sample, base, wraps) if wraps else sample
        order[n] = c
        n += 1
    sort(x, order, n)
    return n


@kernel
def comparable(sample, valid, low, high):
    """Whether a sample may be compared and voted: flagged valid, a number, within the sensor's range."""
    return valid != 0 and low <= sample <= high


@kernel
def threshold(n, p):
    """Within what two of ``n`` comparable samples agree, unit of the signal."""
    if n == CHANNELS:
        return p["threshold"]
    return p["threshold_triplex"] if n == 3 else p["threshold_duplex"]


@kernel
def outlier_threshold(n, p):
    """Within what ``n`` samples that all agree must be, unit of the signal; 0: nothing more is asked of them."""
    if n == CHANNELS:
        return p["outlier_threshold"]
    return p["outlier_threshold_triplex"] if n == 3 else 0.0


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
        return
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
def pattern_of(x, order, n, within, p, alone):
    """The pattern of ``n`` ranked samples; ``alone`` as of ``classify``.

    Where all agree ``within`` they are compared once more by the outlier threshold, which a single channel must keep
    to while the others show a majority: without one at that scale nobody is blamed (docs/redundancy.md, 'Outliers').
    """
    pattern = classify(x, order, n, within, alone)
    limit = outlier_threshold(n, p)
    if pattern != Pattern.NORMAL or limit <= 0.0:
        return pattern
    if classify(x, order, n, limit, alone) == Pattern.ISOLATED:
        return Pattern.ISOLATED
    for c in range(CHANNELS):
        alone[c] = False
    return Pattern.NORMAL


@kernel
def classify(x, order, n, threshold, alone):
    """The pattern of ``n`` ranked samples; ``alone[c]`` is 1 where a sample agrees with no other.

    Neighbours in rank decide: when two neighbours disagree, so do all pairs across the gap.
    One agreeing partner is enough, so chains a~b~c are normal.
    """
    for c in range(CHANNELS):
        alone[c] = False
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
        alone[order[i]] = below and above
    return singular(n, gaps, apart)


@kernel
def singular(n, gaps, apart):
    """The pattern without a majority that the gaps make, or Pattern.ISOLATED (Zhang, section 3)."""
    if n == 4 and gaps == 0b010:
        return Pattern.P2_2
    if apart < n - 1:
        return Pattern.ISOLATED
    if n == 4:
        return Pattern.P1_1_1_1
    return Pattern.P1_1_1 if n == 3 else Pattern.P1_1


@kernel
def is_singular(pattern):
    """Whether no majority exists."""
    return Pattern.P2_2 <= pattern <= Pattern.P1_1
