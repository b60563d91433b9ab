"""Weighted average: a sample that is far from all others has next to no weight; nothing is monitored.

w_c = 1 / (1 + prod over j != c of ((x_c - x_j) / a)^2)
Sources: Broen 1975, New voters for redundant systems; Lorczak, Caglayan and Eckhardt 1989, A theoretical investigation
of generalized voters for redundant systems.
"""

from __future__ import annotations

from rig.computer.redundancy.baselines import finish, ranked
from rig.computer.redundancy.median_vote import mean
from rig.core.kernels import kernel


@kernel
def weighted(bus, fcc, data, on):
    """Vote the weighted average of all comparable samples of each signal of a row; nobody is ever failed.

    on : None: not chosen
    """
    if on is None:
        return
    for s in range(len(data.params)):
        p, st = data.params[s], data.state[s]
        n = ranked(bus, s, p, st)
        finish(bus, fcc, s, average(n, p, st) if n > 0 else st["vote"], n, p, st)


@kernel
def average(n, p, st):
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
