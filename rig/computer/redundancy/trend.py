"""Trend bytes: whether the two voting ranks have risen in each of the last few frames.

A variation data byte (VDB) shifts left each frame; D0 is 1 when this frame's value of the rank is larger
than the last frame's.  Only this frame's and the last frame's values are stored.
Source: Zhang 2023, section 6 and Table 1.
"""

from __future__ import annotations

from rig.kernels import kernel
from rig.units.angles import difference


@kernel
def update(track, high, low, n, frames, wraps):
    """Shift this frame's two bits in; start again when the number of valid samples changed.

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
def verdict(trend_high, trend_low, seen, frames):
    """1: both ranks rose throughout, the larger side is good.  0: neither rose once, the smaller is good.

    -1: no answer (mixed, or fewer than ``frames`` changes seen).
    """
    rising = (1 << frames) - 1
    if seen < frames or trend_high != trend_low:
        return -1
    if trend_high == rising:
        return 1
    return 0 if trend_high == 0 else -1
