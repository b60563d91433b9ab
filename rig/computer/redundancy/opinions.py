"""Answers of single tie-break rules when no majority exists: in-line monitor, trend, reference.

For two halves an answer is the set of faulty sides, as bits: HIGH_SIDE the larger half of the samples,
LOW_SIDE the smaller.  Where no two channels agree it is the one channel to keep.  NO_ANSWER when a
rule cannot tell.
Source: Zhang 2023, section 2 (ILM), section 6 with figure 7 and Table 1 (trend), section 7 with figure 8 (reference).
Added: ILM and reference where no two channels agree; a side that does not move has no trend.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.core.frame import Ilm
from rig.core.kernels import kernel
from rig.core.units.angles import difference

NO_ANSWER: Final = -1
LOW_SIDE: Final = 1
HIGH_SIDE: Final = 2
SMALLER_TRUE, LARGER_TRUE, BOTH_FALSE = 0, 1, 2  # what trend bytes say


@kernel
def by_ilm(ilm, order, n):
    """Return the side that the in-line monitors find faulty, if they follow the pairing, or NO_ANSWER (section 2).

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
def by_lanes(lanes, order, n):
    """Return the half whose computers failed, if those of the other half are healthy, or NO_ANSWER (section 6).

    lanes : a bit for each channel whose computer failed
    """
    low, high = False, False
    for i in range(n // 2):
        low |= (lanes >> order[i]) & 1 != 0
        high |= (lanes >> order[n // 2 + i]) & 1 != 0
    if low == high:
        return NO_ANSWER
    return LOW_SIDE if low else HIGH_SIDE


@kernel
def by_trend(track, p):
    """Return the side that is faulty by the trend bytes of the two voting ranks (section 6, figure 7).

    Both halves are faulty only for the pair that extremes have left, by changes against each other (section 8).
    """
    says = track["trend_says"]
    if p["trend_tumbles"] == 0:  # over ``trend_frames`` or, of changes of at most ``trend_small``, over one
        small = abs(track["rise_high"]) <= p["trend_small"] and abs(track["rise_low"]) <= p["trend_small"]
        says = trend_verdict(track, 1 if small else p["trend_frames"])
    if says == BOTH_FALSE:
        return LOW_SIDE | HIGH_SIDE if track["after_extremes"] else NO_ANSWER
    if says == LARGER_TRUE:
        return LOW_SIDE
    return HIGH_SIDE if says == SMALLER_TRUE else NO_ANSWER


@kernel
def by_reference(high, low, reference, threshold):
    """Return who of the triplex {high, low, reference} is not its middle, or too far from it (section 7, figure 8)."""
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
    """Return the middle value of {high, low, reference} (section 7, figure 8); high >= low but behind a filter."""
    if low > high:
        high, low = low, high
    return min(max(reference, low), high)


@kernel
def only_good(ilm, order, n):
    """Return the one channel whose in-line monitor is good while all others are bad, or NO_ANSWER (added)."""
    good, bad, kept = 0, 0, NO_ANSWER
    for i in range(n):
        c = order[i]
        bad += ilm[c] == Ilm.BAD
        if ilm[c] == Ilm.GOOD:
            good, kept = good + 1, c
    return kept if good == 1 and bad == n - 1 else NO_ANSWER


@kernel
def only_near(x, order, n, reference, threshold, wraps):
    """Return the one channel within the threshold of the reference; NO_ANSWER for none or several (added)."""
    near, kept = 0, NO_ANSWER
    for i in range(n):
        c = order[i]
        if abs(difference(x[c], reference, wraps)) <= threshold:
            near, kept = near + 1, c
    return kept if near == 1 else NO_ANSWER


@kernel
def update_trend(track, high, low, n, p):
    """Shift this frame's two bits into the trend bytes (section 6); start again with another number of samples.

    A variation data byte (VDB) shifts left each frame; D0 is 1 when this frame's value of the rank is larger than the
    last frame's.  Only this frame's and the last frame's values are stored.  With tumbling windows the bytes begin
    again every ``trend_frames`` changes, and the result of a whole one stands until the next.

    track : one manager.STATE record; high, low : values of the two voting ranks; n : number of valid samples
    Writes rise_high, rise_low, trend_high, trend_low, trend_seen, still_high, still_low, last_high, last_low, last_n.
    """
    if n == track["last_n"] and n > 0:
        frames, wraps = p["trend_frames"], p["wraps"]
        track["rise_high"] = difference(high, track["last_high"], wraps)
        track["rise_low"] = difference(low, track["last_low"], wraps)
        mask = (1 << frames) - 1
        up_high = 1 if track["rise_high"] > 0.0 else 0
        up_low = 1 if track["rise_low"] > 0.0 else 0
        if p["trend_tumbles"] != 0 and track["trend_seen"] % frames == 0:
            track["trend_high"] = track["trend_low"] = 0
        track["trend_high"] = ((track["trend_high"] << 1) | up_high) & mask
        track["trend_low"] = ((track["trend_low"] << 1) | up_low) & mask
        track["trend_seen"] += 1
        track["still_high"] = track["still_high"] + 1 if track["rise_high"] == 0.0 else 0
        track["still_low"] = track["still_low"] + 1 if track["rise_low"] == 0.0 else 0
        if p["trend_tumbles"] != 0 and track["trend_seen"] % frames == 0:
            track["trend_says"] = trend_verdict(track, frames)
    else:
        track["trend_high"] = track["trend_low"] = track["trend_seen"] = 0
        track["rise_high"] = track["rise_low"] = 0.0
        track["still_high"] = track["still_low"] = 0
        track["trend_says"] = NO_ANSWER
    track["last_high"], track["last_low"], track["last_n"] = high, low, n


@kernel
def trend_verdict(track, frames):
    """Return what the last ``frames`` changes of the two ranks show (Table 1, figure 7).

    LARGER_TRUE: both ranks rose throughout.  SMALLER_TRUE: neither rose once.  BOTH_FALSE: the larger never rose, and
    the smaller did throughout: each changes against itself.  NO_ANSWER: anything else, fewer changes seen, or one
    rank frozen while the other moves: a frozen one does not fall (added).
    """
    rising = (1 << frames) - 1
    high, low = track["trend_high"] & rising, track["trend_low"] & rising
    frozen_high, frozen_low = track["still_high"] >= frames, track["still_low"] >= frames
    if track["trend_seen"] < frames or frozen_high != frozen_low:
        return NO_ANSWER
    if high == 0 and low == rising:
        return BOTH_FALSE
    if high != low:
        return NO_ANSWER
    if high == rising:
        return LARGER_TRUE
    return SMALLER_TRUE if high == 0 else NO_ANSWER
