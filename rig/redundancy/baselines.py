"""Managers to compare with: the arithmetic mean of all channels, and the cross-voter monitor.

Same rows, same parameters, same interface as manager.CrossChannel.
Source: Zhang 2023, section 1 (why neither is good enough).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rig.angles import limit
from rig.frame import CHANNELS, Block
from rig.kernels import kernel
from rig.redundancy.compare import LOST, NORMAL, rank
from rig.redundancy.manager import NO_RESETS, latch, new_state, obey, publish, report, watch_failed
from rig.redundancy.vote import median


class Mean:
    """The arithmetic mean of every channel that says something; nobody is ever failed, so resets do nothing."""

    def __init__(self, params: NDArray[np.void], resets: NDArray[np.void] = NO_RESETS) -> None:
        self.params = params
        self.resets = resets
        self.state = new_state(params)

    def step(self, block: Block, k: int) -> None:
        """Vote every signal of row k."""
        average(block, k, self.params, self.state, self.resets)


class CrossVoter:
    """Median vote; a channel that is off the vote for ``persistence`` frames is failed."""

    def __init__(self, params: NDArray[np.void], resets: NDArray[np.void] = NO_RESETS) -> None:
        self.params = params
        self.resets = resets
        self.state = new_state(params)

    def step(self, block: Block, k: int) -> None:
        """Vote and monitor every signal of row k."""
        cross_voter(block, k, self.params, self.state, self.resets)


@kernel
def average(block, k, params, state, resets):
    """Row k: the mean of all comparable samples of each signal."""
    row = block[k]
    for s in range(len(params)):
        p, st = params[s], state[s]
        n = ranked(row, s, p, st)
        total = 0.0
        for i in range(n):
            total += st["x"][st["order"][i]]
        finish(row, s, total / n if n > 0 else st["vote"], n, p, st)


@kernel
def cross_voter(block, k, params, state, resets):
    """Row k: the median of the channels in use; each is then compared with it instead of with each other."""
    row = block[k]
    obey(row["frame"], resets, params, state)
    for s in range(len(params)):
        p, st = params[s], state[s]
        n = ranked(row, s, p, st)
        x, order, alone, count = st["x"], st["order"], st["alone"], st["count"]
        voted = median(x, order, n, alone, 0.5) if n > 0 else st["vote"]
        for c in range(p["fitted"]):
            alone[c] = 1 if st["failed"][c] == 0 else 0
        for i in range(n):
            alone[order[i]] = 0 if abs(x[order[i]] - voted) <= p["threshold"] else 1
        for c in range(p["fitted"]):
            count[c] = count[c] + 1 if alone[c] != 0 else 0
        finish(row, s, voted, n, p, st)


@kernel
def ranked(row, s, p, st):
    """Rank the samples of signal s into its state; nobody is alone yet.  Returns their number."""
    samples = row["channels"][s]
    for c in range(CHANNELS):
        st["alone"][c] = 0
    base = st["vote"] if st["started"] != 0 else limit(samples[0], p["low"], p["high"], p["wraps"])
    if base != base:
        base = 0.0
    valid, failed = row["valid"][s], st["failed"]
    return rank(samples, valid, failed, p["fitted"], p["low"], p["high"], p["wraps"], base, st["x"], st["order"])


@kernel
def finish(row, s, voted, n, p, st):
    """Latch, publish and report signal s of a row."""
    st["pattern"] = NORMAL if n > 0 else LOST
    watch_failed(row["channels"][s], row["valid"][s], voted, p, st)
    latch(False, p, st)
    publish(voted, p, st)
    row["voted"][s] = st["output"]
    row["level"][s], row["pattern"][s] = st["level"], st["pattern"]
    report(p, st, row["state"][s])
