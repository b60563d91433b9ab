"""What one resolver answers when no majority exists: in-line monitor, trend or reference.

Of two halves an answer is a set of sides to be failed, as bits: HIGH_SIDE the larger half of the samples,
LOW_SIDE the smaller.  Where nobody agrees with anybody it is the one channel to be kept.  NO_ANSWER when a
resolver cannot tell.
Source: Zhang 2023, sections 4, 6, 7 and 8; redundancy.md, sections 4 to 6.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.redundancy import trend
from rig.frame import Ilm
from rig.kernels import kernel
from rig.units.angles import difference

NO_ANSWER: Final = -1
LOW_SIDE: Final = 1
HIGH_SIDE: Final = 2


@kernel
def by_ilm(ilm, order, n):
    """What the channels' own monitors say, if they follow the pairing; else NO_ANSWER (section 2).

    ilm : (4,) flags by channel; order : (4,) channels by ascending value; n : 4 or 2
    """
    good_low, good_high, bad_low, bad_high = 0, 0, 0, 0
    half = n // 2
    for i in range(half):
        good_low += ilm[order[i]] == Ilm.GOOD
        bad_low += ilm[order[i]] == Ilm.BAD
        good_high += ilm[order[half + i]] == Ilm.GOOD
        bad_high += ilm[order[half + i]] == Ilm.BAD
    if good_low == half and bad_high == half:
        return HIGH_SIDE
    if good_high == half and bad_low == half:
        return LOW_SIDE
    return NO_ANSWER


@kernel
def by_trend(track, frames):
    """What the trend bytes say of the two voting ranks (section 6)."""
    said = trend.verdict(track["trend_high"], track["trend_low"], track["trend_seen"], frames)
    if said == 1:
        return LOW_SIDE
    return HIGH_SIDE if said == 0 else NO_ANSWER


@kernel
def by_reference(high, low, reference, threshold):
    """The triplex {high, low, reference}: who is not its middle, or too far from it (section 7)."""
    if np.isnan(reference):
        return NO_ANSWER
    if reference >= high:
        return LOW_SIDE
    if reference <= low:
        return HIGH_SIDE
    failed = 0
    if high - reference > threshold:
        failed |= HIGH_SIDE
    if reference - low > threshold:
        failed |= LOW_SIDE
    return failed


@kernel
def middle(high, low, reference):
    """The middle value of {high, low, reference}; their ranks say high >= low but behind a filter."""
    if low > high:
        high, low = low, high
    return min(max(reference, low), high)


@kernel
def only_good(ilm, order, n):
    """The one channel whose own monitor says good while all others say bad; else NO_ANSWER."""
    good, bad, kept = 0, 0, NO_ANSWER
    for i in range(n):
        c = order[i]
        bad += ilm[c] == Ilm.BAD
        if ilm[c] == Ilm.GOOD:
            good, kept = good + 1, c
    return kept if good == 1 and bad == n - 1 else NO_ANSWER


@kernel
def only_near(x, order, n, reference, threshold, wraps):
    """The one channel within the threshold of the reference; NO_ANSWER for none, several or no reference."""
    near, kept = 0, NO_ANSWER
    for i in range(n):
        c = order[i]
        if abs(difference(x[c], reference, wraps)) <= threshold:
            near, kept = near + 1, c
    return kept if near == 1 else NO_ANSWER
