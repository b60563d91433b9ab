"""Two channels that are wrong alike, or one of the last two: halves of the channels against the reference.

D is the difference of two halves: of four channels there are three ways to halve them, of two there is one.  A healthy
reference follows the right half, so beside the median it moves against D if the first half is wrong, with D if the
second is: the slope of (reference less its bias less median) on D over a second decides.  A constant error of the
reference is in its bias.  Where D is no larger than the reference's own healthy error nothing is decided.
Added: docs/explanation/decisions.md, 'Slow-fault tests'.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.core.frame import CHANNELS
from rig.core.kernels import kernel

SLOW: Final = 100.0  # frames of a slow mean
LEARNING: Final = 1000.0  # frames of the mean that a bias is
LEAST: Final = 2.0  # noise of the data sheet over ``slow_noise``, the least that is reckoned with
BURST: Final = 14.0  # frames that the largest steps need to reach a limit
MEANS_FROM: Final = 200  # frames that are learned before a mean tells anything,
SQUARES_FROM: Final = 500  # and before one of squares does
WAYS: Final = 3  # to halve four channels
ALONE: Final = 0.35  # of the largest mean square: what those of other ways are below, if one way is meant
DECIDING: Final = 10  # frames in a row
REFERENCE_FROM: Final = 300  # frames that are learned of a reference before it is asked
LEAST_SLOPE: Final = 0.1
HALVES: Final = (
    ("apart", "f8", (WAYS,)),  # D, first half less second
    ("apart_mean", "f8", (WAYS,)),
    ("apart_energy", "f8", (WAYS,)),  # mean square, of limited steps
    ("apart_whole", "f8", (WAYS,)),  # the same without the allowance for motion
    ("apart_square", "f8", (WAYS,)),  # mean square of what counts in the product
    ("apart_product", "f8", (WAYS,)),  # with the reference's difference from the median
    ("halves_limit", "f8"),  # of a mean, over the deviation of the noise
    ("halves_square", "f8"),  # of a mean square, over its variance, less 1
    ("of_halves", "f8"),  # reciprocal of frames that are learned, at most SLOW
    ("halves_noise", "f8"),  # variance of the way that has least, its mean
    ("halves_shaken", "f8"),  # and of the last second
    ("halves_share", "f8"),  # of its limit, of the way that has most
    ("halves_run", "i8"),  # frames in a row: above zero the second half is wrong, below zero the first
)
NONE: Final = -1


@kernel
def reached(frames, burst):
    """Return the share of a constant that a mean over ``frames`` reaches within ``burst`` frames."""
    return 1.0 - math.exp(-burst / frames)


@kernel
def begin_halves(n, t):
    """Begin the means of all ways again, with ``n`` channels in use."""
    t["halves_run"], t["halves_share"], t["halves_shaken"] = 0, 0.0, 0.0
    t["apart_mean"][:] = t["apart_product"][:] = 0.0
    t["apart_energy"][:] = t["apart_whole"][:] = t["apart_square"][:] = (2.0 if n == 2 else 1.0) * t["halves_noise"]


@kernel
def no_half(t):
    """Suspect no half in this frame; return NONE."""
    t["halves_share"] = 0.0
    return NONE


@kernel
def reference_error(p, t):
    """Return the largest error of a healthy reference without its bias, at a motion unlike that of its bias.

    A reference that remembers the vote follows when a change of level moves it: its bias is known no better than that.
    """
    moved = abs(t["vote_off"] - t["reference_vote"])
    motion = max(t["motion"], abs(t["rate"] - t["reference_rate"]))
    return p["slow_reference"] + p["slow_reference_frames"] * motion + moved


@kernel
def learn_reference(st, t):
    """Move the bias of the reference towards what it is off, in a frame that is learned, while it is usable.

    It counts up to the reference's threshold: one frame that is far off does not make a bias.
    """
    off, most = t["reference_off"], st["reference_threshold"]
    if np.isfinite(off) and st["reference_usable"] != 0:
        gain, off = 1.0 / min(t["reference_learned"] + 1.0, LEARNING), min(max(off, -most), most)
        t["reference_bias"] = min(max(t["reference_bias"] + gain * off, -most), most)
        t["reference_vote"] += gain * (t["vote_off"] - t["reference_vote"])
        t["reference_rate"] += gain * (t["rate"] - t["reference_rate"])
        t["reference_learned"] += 1


@kernel
def known_noise(n, p, t):
    """Return the variance of D of four healthy channels, at least that of ``slow_noise``, with ``n`` channels in use.

    Where four were never in use nothing has shown it: it is the data sheet's then.
    """
    if n != CHANNELS and t["halves_noise"] == 0.0:
        return (p["slow_noise"] * LEAST) ** 2
    return max(t["halves_noise"], p["slow_noise"] ** 2)


@kernel
def suspect_halves(n, allowed, p, t):
    """Move the means of the ways to halve ``n`` channels; return the one that is suspected, or NONE.

    Writes ``halves_share``.  One way is meant if the others have less than ALONE of its mean square.
    """
    if n == 3:
        return no_half(t)
    healthy = (1.0 if n == CHANNELS else 2.0) * max(known_noise(n, p, t), t["halves_shaken"])
    sigma, allowed, ways = math.sqrt(healthy), (1.5 if n == CHANNELS else 2.0) * allowed, write_apart(n, t)
    mean_limit, square_limit = t["halves_limit"] * sigma, t["halves_square"]
    at_once = 1.0 / reached(SLOW, BURST)
    step, square_step = mean_limit * at_once, healthy * (1.0 + square_limit * at_once)
    most, off = max(step, 2.8 * reference_error(p, t)), t["reference_off"]
    square, first, second, least, way = t["apart_square"], 0.0, 0.0, np.inf, 0
    gain = t["of_halves"]
    for w in range(ways):
        d = min(max(t["apart"][w], -most), most)
        t["apart_whole"][w] += (min(d * d, square_step) - t["apart_whole"][w]) * gain
        d = math.copysign(max(abs(d) - allowed, 0.0), d)
        t["apart_mean"][w] += (min(max(d, -step), step) - t["apart_mean"][w]) * (1.0 / SLOW)
        t["apart_energy"][w] += (min(d * d, square_step) - t["apart_energy"][w]) * gain
        square[w] += (d * d - square[w]) * gain
        if np.isfinite(off):
            t["apart_product"][w] += (min(max(off, -most), most) * d - t["apart_product"][w]) * (1.0 / SLOW)
        least = min(least, t["apart_whole"][w])
        if square[w] > first:
            first, second, way = square[w], first, w
        else:
            second = max(second, square[w])
    if n == CHANNELS:
        t["halves_shaken"] = least
        t["halves_noise"] += (least - t["halves_noise"]) * t["of_learned"]
    if t["learned"] < MEANS_FROM:
        return no_half(t)
    by_square = (t["apart_energy"][way] - healthy) / (healthy * square_limit)
    t["halves_share"] = max(abs(t["apart_mean"][way]) / mean_limit, by_square)
    return way if n == 2 or second < ALONE * first else NONE


@kernel
def write_apart(n, t):
    """Write D of each way; return how many ways there are.  The first half has the channel with the least number."""
    value, order = t["value"], t["order"]
    if n == 2:
        t["apart"][0] = value[min(order[0], order[1])] - value[max(order[0], order[1])]
        return 1
    t["apart"][0] = 0.5 * ((value[0] - value[2]) + (value[1] - value[3]))
    t["apart"][1] = 0.5 * ((value[0] - value[1]) + (value[2] - value[3]))
    t["apart"][2] = 0.5 * ((value[0] - value[1]) + (value[3] - value[2]))
    return WAYS


@kernel
def isolate_half(way, n, usable, p, t):
    """Return the bits of the half that the slope has decided against for DECIDING frames in a row; 0 for none.

    way : suspected, or NONE; usable : the reference may be asked
    """
    near, run = reference_error(p, t), 0
    asked = way != NONE and t["halves_share"] > 1.0 and usable != 0 and p["slow_reference"] > 0.0
    if asked and t["reference_learned"] > REFERENCE_FROM and np.isfinite(t["reference_off"]):
        size, slope = math.sqrt(t["apart_square"][way]), t["apart_product"][way] / t["apart_square"][way]
        steep = abs(slope)
        if steep > LEAST_SLOPE and size * (steep + 0.5) >= near and (steep - 0.5) * size <= near:
            run = max(t["halves_run"], 0) + 1 if slope > 0.0 else min(t["halves_run"], 0) - 1
    t["halves_run"] = run
    if abs(run) < DECIDING:
        return 0
    first = first_half(way, n, t)
    if run < 0:
        return first
    whole = 0
    for i in range(n):
        whole |= 1 << t["order"][i]
    return whole & ~first


@kernel
def first_half(way, n, t):
    """Return the bits of the first half of a way."""
    if n == 2:
        return 1 << min(t["order"][0], t["order"][1])
    return 1 | (2 << way)
