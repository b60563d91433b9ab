"""The managers "cross-voter" and "selection" behind learned biases, which their settings of a baseline turn on.

The same rules as in baselines.py; what differs is that each sample is compared less the bias of its channel.
"""

from __future__ import annotations

import numpy as np

from rig.computer.redundancy.baseline_managers.learned_bias import CALM, learn, take_off
from rig.computer.redundancy.baselines import choose_by_deviation, comparable, compare_each, finish, ranked
from rig.computer.redundancy.compare import sort_again
from rig.computer.redundancy.median_vote import median
from rig.computer.redundancy.persistence import readmit
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel

AS_UNIT = 2  # the signals are the axes of one unit


@kernel
def cross_voter_learned(bus, fcc, s, p, st, on):
    """Vote the median of signal s, and compare each channel less its bias with the middle of all less theirs."""
    if on is None:  # not chosen
        return
    readmit(bus["reset"][s], p, st)
    n = ranked(bus, s, p, st)
    voted = median(st["x"], st["order"], n, st["miscomparing"], 0.5) if n else st["vote"]
    center, calm = take_off(n, np.nan, p, st), True
    compare_each(st["y"], center, n, p, st)
    for i in range(n):
        calm &= st["count"][st["order"][i]] <= CALM * p["persistence"]
    learn(n, center, calm, p, st)
    finish(bus, fcc, s, voted, n, p, st)


@kernel
def selection_learned(bus, fcc, data, on):
    """Vote one channel of each signal, or of all axes of a unit, by deviations of the samples less their biases."""
    if on is None:  # not chosen
        return
    axes = len(data.params) if on == AS_UNIT else 1
    for first in range(0, len(data.params), axes):
        select_learned(bus, fcc, first, first + axes, data)


@kernel
def select_learned(bus, fcc, first, end, data):
    """Vote one channel of the signals from ``first`` to ``end`` - 1 of a row, as ``baselines.select_unit`` does."""
    params, state = data.params, data.state
    p, st = params[first], state[first]
    here, n = comparable(bus, first, end, params, state)
    for s in range(first, end):
        for c in range(CHANNELS):
            state[s]["x"][c] -= state[s]["learned_bias"][c]
    choose_by_deviation(here, n, first, end, p, state)
    calm = True
    for c in range(CHANNELS):
        if (here >> c) & 1 == 1:
            calm &= st["excess"][c] <= 0.0 and abs(st["smooth"][c]) <= CALM * p["deviation"]
    for s in range(first, end):
        axis = state[s]
        for c in range(CHANNELS):
            axis["x"][c] += axis["learned_bias"][c]
        rank_channels(here, axis)
        learn(n, take_off(n, np.nan, params[s], axis), calm, params[s], axis)
        finish(bus, fcc, s, axis["x"][axis["selected"]], n, params[s], axis)


@kernel
def rank_channels(here, st):
    """Write the channels ``here``, bits, into ``order``, rising."""
    n = 0
    for c in range(CHANNELS):
        if (here >> c) & 1 == 1:
            st["order"][n] = c
            n += 1
    sort_again(st["x"], st["order"], n)
