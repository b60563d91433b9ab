"""Kernels of margins: each goes once over the frames of all channels.

Verdicts and margins are (2, C, n), as in ``margins.py``.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.frame import State
from rig.kernels import kernel

MOST: Final = 1000.0  # JSON has no infinity; that of a state, which has no distance
LEAST: Final = 1e-9  # a margin is never nearer below 0: met is 0 and above, violated is below 0


@kernel
def margins_of_flags(column, sign, out):
    """Fill ``out`` (2, C, n) with verdict and margin of a yes or no (C, n); sign : -1 where it is negated.

    What is no number violates, whatever is negated.
    """
    for c in range(column.shape[0]):
        for k in range(column.shape[1]):
            value = 1.0 if column[c, k] != 0.0 else -1.0
            wrong = np.isnan(column[c, k])
            out[0, c, k] = -sign if wrong else value
            out[1, c, k] = -sign * MOST if wrong else value


@kernel
def margins_of_comparison(apart, strict, scale, sign, out):
    """Fill ``out`` (2, C, n) with verdict and margin of a comparison whose sides are ``apart`` (C, n).

    strict : they must be, by more than nothing, and equals are violated by LEAST
    sign : -1 where it is negated; no number violates
    """
    for c in range(apart.shape[0]):
        for k in range(apart.shape[1]):
            of = apart[c, k]
            margin = of / scale
            wrong = np.isnan(margin)
            met = of > 0.0 if strict else of >= 0.0
            out[0, c, k] = -sign if wrong else (1.0 if met else -1.0)
            margin = min(max(margin, 0.0), MOST) if met else min(max(margin, -MOST), -LEAST)
            out[1, c, k] = -sign * MOST if wrong else margin


@kernel
def least_of_windows(of, width, sign, kept, out):
    """Fill ``out`` (2, C, n - width + 1) with the least of ``of`` (2, C, n) in each window; sign : -1 the largest.

    kept : (n,) scratch: the frames of the window that are less than all later ones, in order of time
    """
    for i in range(of.shape[0]):
        for c in range(of.shape[1]):
            first = end = 0  # of what is kept
            for k in range(of.shape[2]):
                value = sign * of[i, c, k]
                if not np.isnan(value):
                    while end > first and sign * of[i, c, kept[end - 1]] >= value:
                        end -= 1
                    kept[end] = k
                    end += 1
                if k >= width - 1:
                    if end > first and kept[first] <= k - width:
                        first += 1
                    out[i, c, k - width + 1] = of[i, c, kept[first]] if end > first else np.nan


@kernel
def until_backwards(p, q, out):
    """Fill ``out`` (m, n) with p until q to the end of the rows, p and q (m, n)."""
    for i in range(p.shape[0]):
        last = -np.inf
        for k in range(p.shape[1] - 1, -1, -1):
            last = max(q[i, k], min(p[i, k], last))
            out[i, k] = last


@kernel
def counts_of_channels(state, persistence, before, out):
    """Fill ``out`` (C, n) with frames in a row suspect over ``persistence`` (C,), 1 where failed; state : (C, n).

    before : (C,) frames in a row up to the last block, counted on.  Below 1 until the channel is failed: a count may
    stand still while a pattern without a majority lasts.
    """
    for c in range(state.shape[0]):
        run = before[c]
        for k in range(state.shape[1]):
            run = run + 1 if state[c, k] == State.SUSPECT else 0
            of = min(run, persistence[c] - 1) / persistence[c]
            out[c, k] = 1.0 if state[c, k] == State.FAILED else of
        before[c] = run
