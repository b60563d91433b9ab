"""The median vote, never with a suspect in it.

Source: Zhang 2023, section 4, item 2 (means and weights, no suspect in them), section 5 (why the median).
"""

from __future__ import annotations

from rig.core.kernels import kernel


@kernel
def median(x, order, n, miscomparing, weight_high):
    """Return the mid-value of ``n`` ranked samples (n >= 1) when a majority exists.

    four, two: mean of the two middle ranks, or one of them when the other is a suspect, the lower when both are
    three: the middle one; one: itself
    x : (4,) values by channel; order : (4,) channels by ascending value; miscomparing : (4,) 1 for a suspect
    weight_high : share of the larger of the two values in a mean, 0.5 when plain
    """
    if n == 1:
        return x[order[0]]
    if n == 3:
        return x[order[1]]
    low, high = order[n // 2 - 1], order[n // 2]
    if miscomparing[high]:
        return x[low]
    if miscomparing[low]:
        return x[high]
    return mean(x[low], x[high], weight_high)


@kernel
def mean(low, high, weight_high):
    """Return the weighted mean, which stays within [low, high] whatever the rounding."""
    value = low + weight_high * (high - low)
    return min(max(value, low), high)


@kernel
def between(a, b, share_b):
    """Return a + share_b (b - a), never outside of the two; behind a filter ranks need not be in order."""
    return mean(b, a, 1.0 - share_b) if a > b else mean(a, b, share_b)


@kernel
def trend_weight(rise_high, rise_low, rise_vote):
    """Return the share of the larger value in a trend-weighted mean, 0 to 1 (section 4, item 2).

    The value whose last change is nearer to the vote's last change weighs more; when the two did not move
    the same way, both weigh the same.
    """
    if not rise_high * rise_low > 0.0:
        return 0.5
    off_high, off_low = abs(rise_high - rise_vote), abs(rise_low - rise_vote)
    total = off_high + off_low
    return off_low / total if total else 0.5
