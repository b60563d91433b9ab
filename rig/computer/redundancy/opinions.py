"""Answers of single resolvers when no majority exists: in-line monitor, trend, reference.

Of two halves an answer is a set of sides to be failed, as bits: HIGH_SIDE the larger half of the samples,
LOW_SIDE the smaller.  Where nobody agrees with anybody it is the one channel to be kept.  NO_ANSWER when a
resolver cannot tell.
Source: Zhang 2023, section 2 (ILM), section 6 with figure 7 and Table 1 (trend), section 7 with figure 8 (reference).
Ours: ILM and reference where nobody agrees with anybody.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.frame import Ilm
from rig.kernels import kernel
from rig.units.angles import difference

NO_ANSWER: Final = -1
LOW_SIDE: Final = 1
HIGH_SIDE: Final = 2


@kernel
def by_ilm(ilm, order, n):
    """Return what the channels' own monitors blame, if they follow the pairing; else NO_ANSWER (section 2).

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
    """Return what the trend bytes of the two voting ranks blame (section 6, figure 7)."""
    rising = trend_verdict(track["trend_high"], track["trend_low"], track["trend_seen"], frames)
    if rising == 1:
        return LOW_SIDE
    return HIGH_SIDE if rising == 0 else NO_ANSWER


@kernel
def by_reference(high, low, reference, threshold):
    """Return who of the triplex {high, low, reference} is not its middle, or too far from it (section 7, figure 8)."""
    if np.isnan(reference) or low > high:  # the halves are told apart by less than they are biased
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
    """Return the middle value of {high, low, reference} (section 7, figure 8); high >= low but behind a filter."""
    if low > high:
        high, low = low, high
    return min(max(reference, low), high)


@kernel
def only_good(ilm, order, n):
    """Return the one channel whose own monitor says good while all others say bad; else NO_ANSWER (ours)."""
    good, bad, kept = 0, 0, NO_ANSWER
    for i in range(n):
        c = order[i]
        bad += ilm[c] == Ilm.BAD
        if ilm[c] == Ilm.GOOD:
            good, kept = good + 1, c
    return kept if good == 1 and bad == n - 1 else NO_ANSWER


@kernel
def only_near(x, order, n, reference, threshold, wraps):
    """Return the one channel within the threshold of the reference; NO_ANSWER for none or several (ours)."""
    near, kept = 0, NO_ANSWER
    for i in range(n):
        c = order[i]
        if abs(difference(x[c], reference, wraps)) <= threshold:
            near, kept = near + 1, c
    return kept if near == 1 else NO_ANSWER


@kernel
def update_trend(track, high, low, n, frames, wraps):
    """Shift this frame's two bits into the trend bytes (section 6); start again with another number of samples.

    A variation data byte (VDB) shifts left each frame; D0 is 1 when this frame's value of the rank is larger than the
    last frame's.  Only this frame's and the last frame's values are stored.

    track : one manager.STATE record; high, low : values of the two voting ranks
    n : number of valid samples; frames : length of the byte, 1 to 8
    Writes rise_high, rise_low, trend_high, trend_low, trend_seen, last_high, last_low, last_n.
    """
    if n == track["last_n"] and n > 0:
        track["rise_high"] = difference(high, track["last_high"], wraps)
        track["rise_low"] = difference(low, track["last_low"], wraps)
        mask = (1 << frames) - 1
        up_high = 1 if track["rise_high"] > 0.0 else 0
        up_low = 1 if track["rise_low"] > 0.0 else 0
        track["trend_high"] = ((track["trend_high"] << 1) | up_high) & mask
        track["trend_low"] = ((track["trend_low"] << 1) | up_low) & mask
        track["trend_seen"] += 1
    else:
        track["trend_high"] = track["trend_low"] = track["trend_seen"] = 0
        track["rise_high"] = track["rise_low"] = 0.0
    track["last_high"], track["last_low"], track["last_n"] = high, low, n


@kernel
def trend_verdict(trend_high, trend_low, seen, frames):
    """Return what two trend bytes show (Table 1, figure 7).

    1: both ranks rose throughout, the larger side is good.  0: neither rose once, the smaller is good.
    -1: no answer (mixed, or fewer than ``frames`` changes seen).
    """
    rising = (1 << frames) - 1
    if seen < frames or trend_high != trend_low:
        return -1
    if trend_high == rising:
        return 1
    return 0 if trend_high == 0 else -1
