"""Cumulative sums: of residuals from the middle ("cusum"), of distances to the reference ("innovation").

S = max(0, S + min(u - k, h / persistence)), and a channel fails when its S exceeds h.  u is in spreads; the bound
on a step is added: without it, one sample that is far enough off fails a channel.

Sources: Page 1954, Continuous inspection schemes; Basseville and Nikiforov 1993, Detection of Abrupt Changes, chapter 2
("cusum", two-sided).  The selectors of the autopilots PX4 (EKF2Selector) and ArduPilot (updateCoreRelativeErrors), of
which "innovation" is this project's description: errors relative to the best, integrated.  They isolate no channel.
"""

from __future__ import annotations

from typing import Final

from rig.computer.redundancy.baseline_managers import step
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel

CUSUM_STATE: Final = (("up", "f8", (CHANNELS,)), ("down", "f8", (CHANNELS,)))
_LEAD: Final = 0.5  # of the limit: by so much less a sum must be for the selection to go there


@kernel
def cusum(bus, fcc, s, p, st, on):
    """Sum the residuals of each channel of signal s, upwards and downwards, and vote the middle."""
    if on is None:  # not chosen
        return
    at = step.begin(bus, fcc, s, p, st)
    limit = step.limit_of(at.n, p)
    for i in range(at.n if at.n > 1 else 0):
        c = st["order"][i]
        u = step.residual(c, at, p["spread"], st)
        st["up"][c] = summed(st["up"][c], u, limit, p)
        st["down"][c] = summed(st["down"][c], -u, limit, p)
        st["statistic"][c] = max(st["up"][c], st["down"][c])
    if step.end(bus, fcc, s, at, step.largest_above(at.n, p, st), at.middle, p, st):
        st["up"][:] = st["down"][:] = 0.0


@kernel
def summed(last, u, limit, p):
    """Return the next sum; u : residual in spreads."""
    moved = u - p["allowance"]
    if p["bounded"]:
        moved = min(moved, limit / p["persistence"])
    return max(last + moved, 0.0)


@kernel
def innovation(bus, fcc, s, p, st, on):
    """Sum how much further each channel is from the reference than the nearest, and vote the one with the least sum.

    The selection is left for a sum that is less by half of the limit.  While no reference can be used the sums hold.
    """
    if on is None:  # not chosen
        return
    at = step.begin(bus, fcc, s, p, st)
    limit = step.limit_of(at.n, p)
    if at.usable and at.n > 1:
        sum_distances(at, limit, p, st)
    select_least(at.n, _LEAD * limit, st)
    voted = st["x"][st["selected"]] if at.n > 0 else at.middle
    step.end(bus, fcc, s, at, step.largest_above(at.n, p, st), voted, p, st)


@kernel
def sum_distances(at, limit, p, st):
    """Add what each distance to the reference exceeds the least by to its sum, which is the statistic."""
    order, spread = st["y_order"], p["spread"]
    low, high = step.residual(order[0], at, spread, st), step.residual(order[at.n - 1], at, spread, st)
    reference = min(max((at.reference - at.center) / spread, 2.0 * low - high), 2.0 * high - low)
    least = high - low + abs(reference)
    for i in range(at.n):
        least = min(least, abs(step.residual(order[i], at, spread, st) - reference))
    for i in range(at.n):
        c = order[i]
        further = abs(step.residual(c, at, spread, st) - reference) - least
        st["statistic"][c] = summed(st["statistic"][c], further, limit, p)


@kernel
def select_least(n, lead, st):
    """Move the selection to the ranked channel with the least sum, if its own is more by ``lead``, or has no sample."""
    here, best, selected = False, step.NO_CHANNEL, st["selected"]
    for i in range(n):
        c = st["order"][i]
        here = here or c == selected
        if best == step.NO_CHANNEL or st["statistic"][c] < st["statistic"][best]:
            best = c
    if best != step.NO_CHANNEL and (not here or st["statistic"][selected] - st["statistic"][best] > lead):
        st["selected"] = best
