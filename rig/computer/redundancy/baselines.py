"""Managers to compare with: mean, weighted mean, median, cross-voter monitor, selection of one channel.

Same records, same parameters and state, same interface as manager.manage.  Mean and median isolate no channel, and
a selection takes back what it distrusted by itself, so resets concern the cross-voter monitor alone.
Sources: Zhang 2023, section 1 (why mean and cross-voter are not good enough); the selector of the PX4 autopilot for
several inertial units: deviation from their mean, low-passed a sample at a time by 0.95 and 0.05, its norm over the
axes of a unit, integrated above 7 deg/s up to 15 deg (EKF2Selector, VotedSensorsUpdate::calcGyroInconsistency); Broen
1975, New voters for redundant systems, and Lorczak, Caglayan and Eckhardt 1989, A theoretical investigation of
generalized voters for redundant systems (weights).
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.redundancy.compare import rank, threshold
from rig.computer.redundancy.manager import anchor, publish, report
from rig.computer.redundancy.median_vote import mean, median
from rig.computer.redundancy.persistence import latch, readmit, watch_failed
from rig.core.frame import CHANNELS, Pattern
from rig.core.kernels import kernel

KEPT: Final = 0.95  # of the low-passed deviation, from one sample to the next
_LARGEST: Final = 1e150  # of a deviation: its square is finite


@kernel
def average(bus, fcc, data):
    """Vote the arithmetic mean of all comparable samples of each signal of a row; isolate no channel (section 1)."""
    params, state = data.params, data.state
    for s in range(len(params)):
        p, st = params[s], state[s]
        n = ranked(bus, s, p, st)
        finish(bus, fcc, s, mean_of(st, n), n, p, st)


@kernel
def mean_of(st, n):
    """Return the mean of the ``n`` ranked samples, within their range; the last vote for none."""
    if n == 0:
        return st["vote"]
    x, order, total = st["x"], st["order"], 0.0
    for i in range(n):
        total += x[order[i]]
    return min(max(total / n, x[order[0]]), x[order[n - 1]])


@kernel
def weighted(bus, fcc, s, p, st, on):
    """Vote the weighted average of all comparable samples of signal s of a row; isolate no channel.

    A sample that is far from all others has next to no weight: w_c = 1 / (1 + prod over j != c of ((x_c - x_j) / a)^2).
    """
    if on is None:  # not chosen
        return
    n = ranked(bus, s, p, st)
    finish(bus, fcc, s, weighted_mean(n, p, st) if n > 0 else st["vote"], n, p, st)


@kernel
def weighted_mean(n, p, st):
    """Return the weighted average of ``n`` ranked samples, within them; the median where all weights vanish.

    ``statistic`` has the weights.
    """
    x, order, total, weights = st["x"], st["order"], 0.0, 0.0
    middle = mean(x[order[(n - 1) // 2]], x[order[n // 2]], 0.5)
    for i in range(n):
        weight = weight_of(i, n, p, st)
        st["statistic"][order[i]] = weight
        if weight > 0.0:
            total += weight * (x[order[i]] - middle)
            weights += weight
    if not weights > 0.0:
        return middle
    return min(max(middle + total / weights, x[order[0]]), x[order[n - 1]])


@kernel
def weight_of(i, n, p, st):
    """Return the weight of the sample of rank i; 0 where distances are beyond all numbers."""
    x, order, product = st["x"], st["order"], 1.0
    for j in range(n):
        if j != i:
            product *= ((x[order[i]] - x[order[j]]) / p["scale"]) ** 2
    if n == 1:
        return 1.0
    return 1.0 / (1.0 + product) if product == product else 0.0


@kernel
def plain_median(bus, fcc, data):
    """Vote the median of all comparable samples of each signal of a row; isolate no channel."""
    params, state = data.params, data.state
    for s in range(len(params)):
        p, st = params[s], state[s]
        n = ranked(bus, s, p, st)
        voted = median(st["x"], st["order"], n, st["miscomparing"], 0.5) if n else st["vote"]
        finish(bus, fcc, s, voted, n, p, st)


@kernel
def select(bus, fcc, data):
    """Vote one channel of each signal of a row; every signal is a unit of one axis."""
    for s in range(len(data.params)):
        select_unit(bus, fcc, s, s + 1, data)


@kernel
def comparable(bus, first, end, params, state):
    """Return the channels, as bits, with a comparable sample on all signals ``first`` to ``end`` - 1, and how many.

    It fills ``x`` of each signal.
    """
    here = (1 << params[first]["fitted"]) - 1
    for s in range(first, end):
        here &= speaking(bus, s, params[s], state[s])
    n = 0
    for c in range(CHANNELS):
        n += (here >> c) & 1
    return here, n


@kernel
def select_unit(bus, fcc, first, end, data):
    """Vote one channel of all axes of a unit, the signals from ``first`` to ``end`` - 1 of a row.

    d += (1 - KEPT) (x - mean of all - d) on each axis, excess += max(|d| - deviation, -excess), |d| over the axes.  The
    channel with the largest excess is distrusted (reported failed) while that is above ``deviation_frames``.  The vote
    is the first channel by number until it is distrusted, then the next that is not.
    A channel without a comparable sample on an axis is distrusted at once and is no part of the mean; its d stands
    still, and the others are compared as before.  With two channels the mean is as far from both: nothing is added.
    Settings are those of the first axis.
    """
    params, state = data.params, data.state
    here, n = comparable(bus, first, end, params, state)
    choose_by_deviation(here, n, first, end, params[first], state)
    for s in range(first, end):
        finish(bus, fcc, s, state[s]["x"][state[s]["selected"]], n, params[s], state[s])


@kernel
def choose_by_deviation(here, n, first, end, p, state):
    """Choose one of the ``n`` channels ``here`` for all axes, by integrals of what exceeds the deviation of ``p``."""
    for s in range(first, end):
        deviate(here, n, state[s])
    for c in range(CHANNELS):
        if (here >> c) & 1 == 1 and n > 2:
            square = 0.0
            for s in range(first, end):
                square += state[s]["smooth"][c] ** 2
            excess = state[first]["excess"]
            excess[c] = max(excess[c] + math.sqrt(square) - p["deviation"], 0.0)
    choose(here, p, state[first])
    for s in range(first + 1, end):
        state[s]["selected"] = state[first]["selected"]
        for c in range(CHANNELS):
            state[s]["failed"][c] = state[first]["failed"][c]


@kernel
def speaking(bus, s, p, st):
    """Rank all samples of signal s; return the channels with a comparable one, a bit each."""
    st["failed"][:] = False
    n, bits = ranked(bus, s, p, st), 0
    for i in range(n):
        bits |= 1 << st["order"][i]
    return bits


@kernel
def deviate(here, n, st):
    """Move the low-passed deviation of the ``n`` channels ``here``, bits, from their mean: ``smooth``, 0 at first."""
    x, smooth, center = st["x"], st["smooth"], 0.0
    for c in range(CHANNELS):
        if (here >> c) & 1 == 1:
            center += x[c] / n
    for c in range(CHANNELS):
        if (here >> c) & 1 == 1:
            before = smooth[c] if smooth[c] == smooth[c] else 0.0
            off = min(max(x[c] - center, -_LARGEST), _LARGEST)
            smooth[c] = KEPT * before + (1.0 - KEPT) * off


@kernel
def choose(here, p, st):
    """Mark the distrusted channels in ``failed`` and move the selection off them.

    here : the channels with comparable samples, a bit each
    When none is trusted it stays where it is, or, if its channel has no comparable sample, goes to the one with
    the least excess that has; if none has, the last sample stands.
    """
    best, least, most = -1, -1, -1
    for c in range(CHANNELS - 1, -1, -1):
        st["failed"][c] = (here >> c) & 1 == 0
        if st["failed"][c]:
            continue
        if least < 0 or st["excess"][c] <= st["excess"][least]:
            least = c
        if most < 0 or st["excess"][c] >= st["excess"][most]:
            most = c
    if most >= 0 and st["excess"][most] > p["deviation_frames"]:
        st["failed"][most] = True
    for c in range(CHANNELS - 1, -1, -1):
        if not st["failed"][c]:
            best = c
    if best >= 0 and st["failed"][st["selected"]]:
        st["selected"] = best
    elif least >= 0 and (here >> st["selected"]) & 1 == 0:
        st["selected"] = least


@kernel
def cross_voter(bus, fcc, data):
    """Vote the median of a row's channels in use, and compare each with it instead of with each other (section 1)."""
    params, state, reset = data.params, data.state, bus["reset"]
    for s in range(len(params)):
        p, st = params[s], state[s]
        readmit(reset[s], p, st)
        n = ranked(bus, s, p, st)
        voted = median(st["x"], st["order"], n, st["miscomparing"], 0.5) if n else st["vote"]
        compare_each(st["x"], voted, n, p, st)
        finish(bus, fcc, s, voted, n, p, st)


@kernel
def compare_each(values, center, n, p, st):
    """Compare each of the ``n`` ranked ``values`` (4,) with ``center``, and count the frames in a row beyond it."""
    order, miscomparing, count = st["order"], st["miscomparing"], st["count"]
    for c in range(p["fitted"]):
        miscomparing[c] = not st["failed"][c]
    for i in range(n):
        miscomparing[order[i]] = not abs(values[order[i]] - center) <= threshold(n, p)
    for c in range(p["fitted"]):
        count[c] = count[c] + 1 if miscomparing[c] else 0


@kernel
def ranked(bus, s, p, st):
    """Rank the samples of signal s into its state; no channel miscompares yet.  Returns their number."""
    samples, valid = bus["channels"][s], bus["valid"][s]
    st["miscomparing"][:] = False
    base = anchor(samples, valid, p, st)
    return rank(samples, valid, base, p, st)


@kernel
def finish(bus, fcc, s, voted, n, p, st):
    """Latch, publish and report signal s of a row."""
    st["pattern"] = Pattern.NORMAL if n else Pattern.LOST
    watch_failed(bus["channels"][s], bus["channels"][s], bus["valid"][s], voted, p, st)
    latch(False, p, st)
    publish(voted, p, st)
    report(fcc, s, p, st)
