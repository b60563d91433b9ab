"""Generalised likelihood ratio: the step or ramp that explains the last residuals best, over all its onsets.

u = r / rms, of the last frames; with n of them since the onset, each amplitude at its most likely value,

    step  (sum u)^2 / (2 n)                 ramp  (sum i u_i)^2 / (2 sum i^2), i = 1 ... n

are the log likelihood ratios against white residuals of variance 1.  The largest above the limit h fails a channel.
|u| is limited to sqrt(2 h / persistence), added: ``persistence`` frames alone come to h, whatever their size.

Sources: Willsky and Jones 1976, A generalized likelihood ratio approach to the detection and estimation of jumps in
linear systems; Gustafsson 2000, Adaptive Filtering and Change Detection, chapter 3 (no Kalman filter: white residuals).
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.redundancy.baseline_managers import step
from rig.computer.redundancy.baseline_managers.baseline_settings import WINDOW
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel

GLR_STATE: Final = (
    ("window", "f8", (WINDOW, CHANNELS)),  # a ring; zero where a channel had no sample
    ("place", "i8"),  # of the next frame
    ("filled", "i8"),
    ("energy", "f8", (CHANNELS,)),  # sum of squares in the ring
    ("sum", "f8", (CHANNELS,)),  # workspaces
    ("ramp", "f8", (CHANNELS,)),
)


@kernel
def glr(bus, fcc, s, p, st, on):
    """Look for a step or ramp of each channel's residual of signal s, and vote the middle."""
    if on is None:  # not chosen
        return
    at = step.begin(bus, fcc, s, p, st)
    limit = step.limit_of(at.n, p)
    if at.n > 1:
        take(at, limit, p, st)
        search(limit, p, st)
    if step.end(bus, fcc, s, at, step.largest_above(at.n, p, st), at.middle, p, st):
        st["window"][:] = 0.0
        st["energy"][:] = 0.0
        st["filled"] = st["place"] = 0


@kernel
def take(at, limit, p, st):
    """Put the residuals of this frame into the ring."""
    last, energy, most = st["window"][st["place"]], st["energy"], math.sqrt(2.0 * limit / p["persistence"])
    for c in range(CHANNELS):
        energy[c] -= last[c] * last[c]
        last[c] = 0.0
    for i in range(at.n):
        c = st["order"][i]
        u = step.residual(c, at, p["rms"], st)
        last[c] = min(max(u, -most), most) if p["bounded"] else u
        energy[c] += last[c] * last[c]
    st["place"] = (st["place"] + 1) % p["window"]
    st["filled"] = min(st["filled"] + 1, p["window"])


@kernel
def search(limit, p, st):
    """Write the statistic of each channel: the largest over onset and form.

    No sum of squares can be explained by more than its half (Cauchy and Schwarz), so where every channel's is below the
    limit, which with rounding is twice what it must be, that stands for it; not where statistics are asked for.
    """
    statistic, energy, most = st["statistic"], st["energy"], 0.0
    for c in range(CHANNELS):
        statistic[c] = 0.5 * energy[c]
        most = max(most, energy[c])
    if most < limit and not p["watches"]:
        return
    total, ramp = st["sum"], st["ramp"]
    for c in range(CHANNELS):
        total[c] = ramp[c] = statistic[c] = 0.0
    squares, place = 0.0, st["place"]
    for n in range(1, st["filled"] + 1):
        place = place - 1 if place > 0 else p["window"] - 1
        squares += float(n * n)
        of_step, of_ramp, u = 0.5 / n, 0.5 / squares, st["window"][place]
        for c in range(CHANNELS):
            total[c] += u[c]
            ramp[c] += total[c]  # one frame earlier, every later one counts once more
            statistic[c] = max(statistic[c], max(total[c] * total[c] * of_step, ramp[c] * ramp[c] * of_ramp))
