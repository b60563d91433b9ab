"""The short way through a frame, of a signal all of whose channels agree: the same bits as the long one, sooner.

In such a frame no channel is suspect, counted or faded, and all fitted channels are ranked.
"""

from __future__ import annotations

import numpy as np

from rig.computer.redundancy.compare import threshold
from rig.computer.redundancy.slow_faults import CALM, NO_CHANNEL, largest_sum, learn_one, outlier_limit, sum_one
from rig.core.frame import CHANNELS, Pattern
from rig.core.kernels import kernel


@kernel
def is_quiet(n, p, st):
    """Return True if all channels of the signal agree, and nothing of earlier frames is pending.

    Then no channel is suspect, counted or faded, which is nearly every frame of a flight.  Where channels are
    compared without biases all must be near each other; a chain that is longer takes the long way.
    """
    if n < 2 or n != p["fitted"] or n != st["level"] or st["pattern"] != Pattern.NORMAL or not st["started"]:
        return False
    if p["filter_gain"] > 0.0 or st["split_run"] != 0 or st["freeze"] != 0 or st["fade_left"] != 0:
        return False
    within, outlier = threshold(n, p), outlier_limit(n, p, st)
    if outlier > 0.0:
        within = min(within, outlier)
    if p["equalise_bound"] > 0.0:
        if not spread_without_bias(n, st) <= within:
            return False
    else:
        x, order = st["x"], st["order"]
        for i in range(n - 1):
            if not x[order[i + 1]] - x[order[i]] <= within:  # True for NaN, of an angle near the largest number
                return False
    pending = False
    for c in range(CHANNELS):
        pending |= st["count"][c] != 0 or st["miscomparing"][c] != 0 or st["blamed"][c] != 0
    return not pending


@kernel
def spread_without_bias(n, st):
    """Return how far the samples of the first ``n`` channels, n >= 1, are apart without their biases; NaN if one is."""
    x, bias = st["x"], st["bias"]
    low = high = x[0] - bias[0]
    number = True
    for c in range(1, n):
        value = x[c] - bias[c]
        number &= not np.isnan(value)
        low, high = min(low, value), max(high, value)
    return high - low if number else np.nan


@kernel
def at_rest(m, n, p, st):
    """Return True if the sums of the first ``n`` channels are zero, and stay so."""
    x, bias, above, below, allowance, rest = st["x"], st["bias"], st["above"], st["below"], p["slow_allowance"], True
    for c in range(n):
        rest &= (abs(x[c] - bias[c] - m) <= allowance) & (above[c] + below[c] <= 0.0)
    return rest


@kernel
def last_quiet(m, n, learns, p, st):
    """Sum and learn of a quiet signal, all of whose ``n`` channels are ranked and none suspected; same bits.

    Returns the channel that the sums fail, or ``NO_CHANNEL``; it has learned then, if it ``learns``.
    """
    limit = p["slow_limit"]
    if limit > 0.0 and n >= 3 and not at_rest(m, n, p, st):
        calm, largest, most = 0, 0.0, limit / (p["persistence"] - 0.5)
        for c in range(n):
            reached = sum_one(c, m, most, p, st)
            calm += reached < CALM * limit
            largest = max(largest, reached)
        if largest > limit and 2 * calm > n:
            return largest_sum(n, limit, st)
    if learns and p["equalise_bound"] > 0.0:
        for c in range(n):
            learn_one(c, m, p, st)
    return NO_CHANNEL
