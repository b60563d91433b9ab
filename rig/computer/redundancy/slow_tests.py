"""Slow-fault tests: three means of each channel's residual, against limits that follow from its noise.

A residual is a sample, less what is learned of its channel (its bias), less the median of all channels without theirs.
A fast and a slow mean of it find offsets, drifts, slow oscillations and frozen samples; a mean of its square finds
noise and fast oscillations.  Steps are limited, so that an error of fewer frames than BURST moves no mean to its limit.
Two channels that are wrong alike, or two that are left, are the business of slow_halves.py, and the noisy one of two
that are left is that of slow_noise.py.
Added: docs/explanation/decisions.md, 'Slow-fault tests'.  No vote is moved: channels are isolated.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rig.computer.redundancy import median_vote as vote
from rig.computer.redundancy.compare import is_split, off_majority
from rig.computer.redundancy.slow_halves import (
    BURST,
    HALVES,
    LEARNING,
    LEAST,
    MEANS_FROM,
    SLOW,
    SQUARES_FROM,
    begin_halves,
    isolate_half,
    learn_reference,
    no_half,
    reached,
    suspect_halves,
)
from rig.computer.redundancy.slow_noise import NOISE, begin_noise, isolate_noisy
from rig.core.frame import CHANNELS, DecidedBy, Pattern
from rig.core.kernels import kernel
from rig.core.units.angles import difference

FAST, SQUARE = 16.0, 128.0  # frames of the fast mean and of that of squares
SIGMAS: Final = 6.0  # standard deviations of a mean that its limit is away
CALM: Final = 0.5  # of a limit
STILL: Final = 14  # frames that a sample has repeated of a channel that stands still
FOLLOWS: Final = 0.25  # of the common noise: what a residual lacks of its channel's, because the median follows it
CUT: Final = 8.0  # ``slow_noise``, four standard deviations of the data sheet
REMEMBERED: Final = 20.0  # as BURST, of the means that remember the last burst after seconds
WHOLE: Final = 2.0  # of the largest square that counts: what one of a whole residual may be
TESTS: Final = np.dtype(
    [
        ("by", "i8"),  # which test isolates in this frame, a DecidedBy
        ("learned", "i8"),  # frames
        ("known", "f8"),  # sum of their weights
        ("level", "i8"),  # channels in use, of which the means are
        ("bias", "f8", (CHANNELS,)),
        ("value", "f8", (CHANNELS,)),  # samples without it
        ("order", "i8", (CHANNELS,)),  # channels of which it is
        ("fast", "f8", (CHANNELS,)),  # in units of the noise
        ("slow", "f8", (CHANNELS,)),
        ("square", "f8", (CHANNELS,)),  # in the square of the signal's unit
        ("whole", "f8", (CHANNELS,)),  # the same without the allowance for motion
        ("share", "f8", (CHANNELS,)),  # of its limit, the largest of the three
        ("noise", "f8"),  # variance that the channels have in common, its mean
        ("shaken", "f8"),  # and of the last second
        ("healthy", "f8"),  # what the noise of a residual may be: that, or the data sheet's where all are quieter
        ("fast_limit", "f8"),
        ("slow_limit", "f8"),
        ("square_limit", "f8"),
        ("fast_step", "f8"),  # largest residual that counts, in the same units
        ("slow_step", "f8"),
        ("square_step", "f8"),
        ("limits_until", "f8"),  # what is known when they are renewed
        ("of_fast", "f8"),  # reciprocals: of the three limits,
        ("of_slow", "f8"),
        ("of_square", "f8"),
        ("of_learned", "f8"),  # and of frames that are learned, at most LEARNING
        ("of_squares", "f8"),  # and SQUARE
        ("usual_middle", "f8"),  # mean of the middle over the frames of which the biases are
        ("last_middle", "f8"),
        ("away", "i8"),  # frames without tests since then
        ("rate", "f8"),  # mean change of the middle a frame
        ("usual_rate", "f8"),  # its mean over the frames of which the biases are
        ("motion", "f8"),  # largest one of the last second
        ("vote_off", "f8"),  # mean of what the biases move the vote
        ("reference_bias", "f8"),
        ("reference_learned", "i8"),  # frames
        ("reference_vote", "f8"),  # vote_off and rate over the frames of which that bias is
        ("reference_rate", "f8"),
        ("reference_off", "f8"),  # of this frame, without its bias; NaN: none
        *HALVES,
        *NOISE,
    ],
    align=True,
)


@kernel
def isolate_slow(reference, n, p, st):
    """Move all means by a frame and learn; return the channels that a test isolates, a bit each, and write ``by``.

    Only in frames in which all channels in use are compared.
    reference : NaN where there is none; n : ranked samples; p, st : PARAMS and STATE
    """
    if p["slow_means"] <= 0.0:
        return 0
    t = st["tests"]
    if n < 2 or not st["whole"]:
        return stopped(t)
    m = middle_without_bias(n, st, t)
    if not np.isfinite(m) or is_cut(m, p):  # not finite: differences near the largest number
        return stopped(t)
    if t["learned"] == 0:
        t["usual_middle"] = t["last_middle"] = m
    follow_vote(m, n, p, st)
    if t["level"] != n:
        begin_again(n, t)
    if t["known"] >= t["limits_until"]:
        renew_limits(p, t)
    split = is_split(st["pattern"])
    if n > 2 and (split or off_majority(st["order"], n, st["miscomparing"])):  # it moves as no aircraft does
        t["turns"] = 0
    variance = max(t["noise"], t["shaken"], p["slow_noise"] ** 2)
    sigma, t["healthy"] = math.sqrt(variance), max(variance, (p["slow_noise"] * LEAST) ** 2 - FOLLOWS * variance)
    moved = difference(m, t["usual_middle"], p["wraps"])
    allowed = allowance(m, moved, sigma, n, p, t)
    worst = move_means(m, allowed, sigma, n, p, t) if t["learned"] > 0 else 0
    t["reference_off"] = difference(reference - t["reference_bias"], m, p["wraps"])
    ways = suspect_halves(n, allowed, p, t) if t["learned"] > 0 else no_half(t)
    bits = isolate_half(ways, n, st["reference_usable"], p, t)
    noisy = isolate_noisy(n, p, t) if t["learned"] > 0 else 0
    alike = t["halves_share"] * p["slow_halves"]
    suspected = max(t["share"][worst], t["halves_share"])
    if bits != 0:
        t["by"] = DecidedBy.SLOW_HALVES.value
    elif noisy != 0:
        bits, t["by"] = noisy, DecidedBy.SLOW_SQUARES.value
    elif t["share"][worst] > 1.0 and n > 2 and not split and not (ways >= 0 and alike > CALM):
        bits = isolate_one(worst, n, p, st)
    if bits == 0 and st["pattern"] == Pattern.NORMAL and suspected < CALM:
        learn(m, moved, t["fast_step"] * sigma + allowed, n, p, st)
    return bits


@kernel
def stopped(t):
    """Return 0, no channel: the next change of the middle is that of several frames."""
    t["away"], t["reference_off"] = t["away"] + 1, np.nan
    return 0


@kernel
def middle_without_bias(n, st, t):
    """Write ``value`` and ``order`` of the ``n`` ranked samples without their biases; return the median of them.

    The ranks without biases are others.  No rank but the middle is needed, so nothing is sorted.
    """
    x, value, order, bias = st["x"], t["value"], t["order"], t["bias"]
    for c in range(CHANNELS):
        value[c], order[c] = x[c] - bias[c], st["order"][c]
    a, b = value[order[0]], value[order[n - 1]]
    low, high = min(a, b), max(a, b)
    if n == CHANNELS:
        c, d = value[order[1]], value[order[2]]
        one, other = max(low, min(c, d)), min(high, max(c, d))
        low, high = min(one, other), max(one, other)
    elif n == 3:
        low = high = max(low, min(high, value[order[1]]))
    return vote.mean(low, high, 0.5)


@kernel
def is_cut(m, p):
    """Return True if ``m``, the middle, is so near an end of the range that healthy samples, and means, are cut off."""
    margin = 2.0 * p["slow_bias"] + p["slow_scale"] * abs(m) + CUT * p["slow_noise"]
    return p["wraps"] == 0 and (m > p["high"] - margin or m < p["low"] + margin)


@kernel
def follow_vote(m, n, p, st):
    """Move the mean of what the biases of ``n`` channels move the vote, off ``m``, the middle without them."""
    t, x, order, most = st["tests"], st["x"], st["order"], st["threshold"]
    voted = vote.mean(x[order[(n - 1) // 2]], x[order[n // 2]], 0.5)
    off = difference(voted, m, p["wraps"])
    t["vote_off"] += (min(max(off, -most), most) - t["vote_off"]) * (1.0 / SLOW)


@kernel
def begin_again(n, t):
    """Begin all means again, with ``n`` channels in use: another number has another middle.  Biases stay."""
    t["level"], t["shaken"] = n, 0.0
    t["fast"][:] = t["slow"][:] = t["share"][:] = 0.0
    t["square"][:] = t["whole"][:] = t["noise"]
    begin_halves(n, t)
    begin_noise(t)


@kernel
def forget_tests(st):
    """Begin to learn the signal again, after a readmission: no bias, no noise, no limits."""
    t = st["tests"]
    t["learned"] = t["level"] = t["reference_learned"] = 0
    t["known"] = t["limits_until"] = 0.0
    t["noise"] = t["reference_bias"] = t["rate"] = t["usual_rate"] = t["motion"] = t["halves_noise"] = 0.0
    t["vote_off"] = t["reference_vote"] = t["reference_rate"] = t["roughest"] = 0.0
    t["bias"][:] = t["share"][:] = 0.0


@kernel
def renew_limits(p, t):
    """Set the limits for what is known of the biases; again when a tenth more is.

    White noise of variance 1 leaves the variance 1 / (2 T) in a mean over T frames, 1 / W at most in a bias of frames
    whose weights are W in all, and twice as much in those of squares.
    """
    known = min(max(t["known"], 1.0), 2.0 * LEARNING)
    t["fast_limit"] = p["slow_means"] * SIGMAS * math.sqrt(0.5 / FAST + 1.0 / known)
    t["slow_limit"] = p["slow_means"] * SIGMAS * math.sqrt(0.5 / SLOW + 1.0 / known)
    t["square_limit"] = p["slow_squares"] * SIGMAS * math.sqrt(1.0 / SQUARE + 2.0 / known)
    t["fast_step"] = t["fast_limit"] / reached(FAST, BURST)
    t["slow_step"] = t["slow_limit"] / reached(SLOW, REMEMBERED)
    t["square_step"] = 1.0 + t["square_limit"] / reached(SQUARE, REMEMBERED)
    t["of_fast"], t["of_slow"] = 1.0 / t["fast_limit"], 1.0 / t["slow_limit"]
    t["of_square"] = 1.0 / t["square_limit"]
    t["halves_limit"] = t["slow_limit"] * (p["slow_halves"] / p["slow_means"])
    t["halves_square"] = 1.2 * t["square_limit"] * (p["slow_halves"] / p["slow_squares"])
    t["limits_until"] = 1.1 * known if known < 2.0 * LEARNING else np.inf


@kernel
def allowance(m, moved, sigma, n, p, t):
    """Return what a residual may be by motion alone: other scales since the bias was learned, other times of sampling.

    m : the middle; moved : since the biases were learned; sigma : noise
    A change to a middle that is not that of a majority, and the first one after another number of channels, are none
    of the aircraft.  That over frames without tests is their mean.
    """
    change = difference(m, t["last_middle"], p["wraps"]) / (t["away"] + 1.0)
    t["last_middle"], t["change"] = m, change
    if t["turns"] > 0:
        t["rate"] += (change - t["rate"]) * (1.0 / FAST)
        t["motion"] = max(abs(t["rate"]), t["motion"] * (1.0 - 1.0 / SLOW))
        if n > 2:
            t["motion"] = max(t["motion"], abs(change) - 3.0 * sigma)
    if t["away"] > 0:  # a second difference is of three frames in a row
        t["turns"] = t["away"] = 0
    skewed = max(t["motion"], abs(t["rate"] - t["usual_rate"]))
    return 2.0 * p["slow_scale"] * abs(moved) + p["slow_skew"] * skewed


@kernel
def move_means(m, allowed, sigma, n, p, t):
    """Move the three means of each channel and the common noise; return the channel with the largest share.

    The noise follows the second lowest mean square of the whole residuals (of two: the lowest): what all channels
    shake alike raises the limits of all, what one does raises none.
    Means of channels that are out of use move too, as their biases do, and nothing reads them: a loop without branches
    and without ``order`` moves four channels by one instruction.
    """
    learned, order, value, share = t["learned"], t["order"], t["value"], t["share"]
    fast, slow, square, whole = t["fast"], t["slow"], t["square"], t["whole"]
    fast_step, slow_step, one = t["fast_step"], t["slow_step"], 1.0 / sigma
    most, gain, worst, of_healthy = t["square_step"] * t["healthy"], t["of_squares"], order[0], 1.0 / t["healthy"]
    of_fast, of_slow, of_square = t["of_fast"], t["of_slow"], t["of_square"]
    most_whole = WHOLE * t["square_step"] * sigma * sigma
    if learned < MEANS_FROM:
        of_fast = of_slow = 0.0
    if learned < SQUARES_FROM:
        of_square = 0.0
    for c in range(p["fitted"]):
        r = value[c] - m
        whole[c] += gain * (min(r * r, most_whole) - whole[c])
        r = math.copysign(max(abs(r) - allowed, 0.0), r)
        z = r * one
        fast[c] += (min(max(z, -fast_step), fast_step) - fast[c]) * (1.0 / FAST)
        slow[c] += (min(max(z, -slow_step), slow_step) - slow[c]) * (1.0 / SLOW)
        square[c] += gain * (min(r * r, most) - square[c])
        by_means = max(abs(fast[c]) * of_fast, abs(slow[c]) * of_slow)
        share[c] = max(by_means, (square[c] * of_healthy - 1.0) * of_square)
    lowest, second, largest = np.inf, np.inf, -np.inf
    for i in range(n):
        c = order[i]
        second, lowest = min(second, max(lowest, whole[c])), min(lowest, whole[c])
        worst, largest = (c if share[c] > largest else worst), max(largest, share[c])
    t["shaken"] = second if n > 2 else lowest
    t["noise"] += (t["shaken"] - t["noise"]) * t["of_learned"]
    return worst


@kernel
def is_beside_still(c, n, st):
    """Return True if two others of four channels stand still, and channel ``c`` does not.

    Where these two are close, the median is often between them, and does not show the mean of the others.
    """
    repeats, order, still = st["repeats"], st["tests"]["order"], 0
    for i in range(n):
        still += repeats[order[i]] >= STILL
    return n == CHANNELS and still == 2 and repeats[c] < STILL


@kernel
def isolate_one(worst, n, p, st):
    """Return the bit of channel ``worst``, whose share is above 1, if most others are below half of it; 0 for none.

    Most: more than half of the channels, or two of four, whose other two slow_halves tells apart."""
    t = st["tests"]
    share, order, calm = t["share"], t["order"], 0
    if is_beside_still(worst, n, st):
        return 0
    for i in range(n):
        calm += share[order[i]] < CALM * share[worst]
    means = max(abs(t["fast"][worst]) * t["of_fast"], abs(t["slow"][worst]) * t["of_slow"])
    if 2 * calm <= n and not (n == CHANNELS and calm == 2):
        return 0
    t["by"] = DecidedBy.SLOW_MEANS.value if means >= share[worst] else DecidedBy.SLOW_SQUARES.value
    return 1 << worst


@kernel
def learn(m, moved, step, n, p, st):
    """Move the biases towards the residuals, within their bound, and that of the reference; frames of no suspicion.

    Each is the mean of the first LEARNING frames, then it follows.  After the first frame a residual counts up to
    ``step``, as for the fast mean: a burst before the tests begin is not learned.  Biases are weighted means: what
    times of sampling add in motion is no bias, so that a frame counts less the more of it there may be.
    """
    t = st["tests"]
    step = step if t["learned"] > 0 else np.inf
    noise, skewed = max(t["noise"], p["slow_noise"] ** 2), p["slow_skew"] * t["rate"]
    weight = noise / (noise + skewed * skewed)
    t["known"] += weight
    gain = weight * (1.0 / LEARNING) if t["known"] > LEARNING else weight / t["known"]
    t["usual_middle"] += gain * moved
    t["usual_rate"] += gain * (t["rate"] - t["usual_rate"])
    bound = p["slow_bias"] + 1.6 * p["slow_scale"] * abs(t["usual_middle"])
    bias, value = t["bias"], t["value"]
    for c in range(p["fitted"]):
        moved_by = gain * min(max(value[c] - m, -step), step)
        bias[c] = min(max(bias[c] + moved_by, -bound), bound)
    t["learned"] += 1
    if t["learned"] <= LEARNING:  # shares of a frame in means over what is learned
        learned = float(t["learned"])
        t["of_learned"], t["of_squares"] = 1.0 / learned, 1.0 / min(learned, SQUARE)
        t["of_halves"] = 1.0 / min(learned, SLOW)
    learn_reference(st, t)
