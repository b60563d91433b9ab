"""Averages: votes by a formula, which isolate no channel.

variance_mean  weights are inverse variances of each channel's last samples, motion included.  EmuFlight's fusion of
               two gyros (pull requests 755 and 784 of 2022: the last 8 samples), re-described for up to four channels
inverse_mean   weights are inverse mean squares of each residual from the median, low-passed.  Cochran 1937, Problems
               arising in the analysis of a series of similar experiments (weights of least variance)
trimmed_mean   a share of the samples is left out at either end; of a sample that is cut, the rest counts.  Tukey and
               McLaughlin 1963, Less vulnerable confidence and significance procedures for location
mid_value      the middle one of the first three channels in service, a fourth is a spare; of two the mean.  The usual
               scheme of triplex flight control, the state of the art of patent US 9,092,313

The plain average is the manager "mean": Betaflight averages the gyros that are enabled (pull request 8778).
"""

from __future__ import annotations

from typing import Final

from rig.computer.redundancy.baseline_managers.baseline_settings import VARIANCE_WINDOW
from rig.computer.redundancy.baselines import finish, mean_of, ranked
from rig.computer.redundancy.median_vote import mean
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel
from rig.core.units.angles import difference

VARIANCE_STATE: Final = (
    ("last_samples", "f8", (CHANNELS, VARIANCE_WINDOW)),  # a ring of each channel
    ("place", "i8", (CHANNELS,)),
    ("filled", "i8", (CHANNELS,)),
)
INVERSE_STATE: Final = (("energy", "f8", (CHANNELS,)),)
_FLOOR: Final = 1e-3  # of the spread: least standard deviation of samples, so that equal samples have equal weights


@kernel
def variance_mean(bus, fcc, s, p, st, on):
    """Vote signal s by the mean weighted by the inverse variance of each channel's last samples."""
    if on is None:  # not chosen
        return
    n = ranked(bus, s, p, st)
    for i in range(n):
        c = st["order"][i]
        st["statistic"][c] = 1.0 / (variance(c, p, st) + (_FLOOR * p["spread"]) ** 2)
    finish(bus, fcc, s, by_weights(n, st), n, p, st)


@kernel
def variance(c, p, st):
    """Take the sample of channel c into its ring; return the variance of the ring, by differences from this sample."""
    ring, at, now = st["last_samples"][c], st["place"][c], st["x"][c]
    ring[at] = now
    st["place"][c] = (at + 1) % p["window"]
    n = st["filled"][c] = min(st["filled"][c] + 1, p["window"])
    total, squares = 0.0, 0.0
    for i in range(n):
        apart = difference(ring[i], now, p["wraps"])
        total += apart
        squares += apart * apart
    return max(squares / n - (total / n) ** 2, 0.0)


@kernel
def inverse_mean(bus, fcc, s, p, st, on):
    """Vote signal s by the mean weighted by the inverse mean square of each residual from the median."""
    if on is None:  # not chosen
        return
    n = ranked(bus, s, p, st)
    x, order = st["x"], st["order"]
    middle = mean(x[order[(n - 1) // 2]], x[order[n // 2]], 0.5) if n > 0 else st["vote"]
    for i in range(n):
        c = order[i]
        st["energy"][c] += ((x[c] - middle) ** 2 - st["energy"][c]) / p["window"]
        st["statistic"][c] = 1.0 / (st["energy"][c] + p["spread"] ** 2)
    finish(bus, fcc, s, by_weights(n, st), n, p, st)


@kernel
def by_weights(n, st):
    """Return the mean of ``n`` ranked samples by the weights in ``statistic``, within them; without weights the mean.

    The last vote for none.
    """
    x, order, total, weights = st["x"], st["order"], 0.0, 0.0
    for i in range(n):
        weight = st["statistic"][order[i]]
        if weight > 0.0:
            total += weight * (x[order[i]] - x[order[0]])
            weights += weight
    if n == 0 or not weights > 0.0:
        return mean_of(st, n)
    return min(max(x[order[0]] + total / weights, x[order[0]]), x[order[n - 1]])


@kernel
def trimmed_mean(bus, fcc, s, p, st, on):
    """Vote signal s by the mean of what is left when a share of the samples is cut off at either end."""
    if on is None:  # not chosen
        return
    n = ranked(bus, s, p, st)
    cut = min(p["share"] * n, 0.5 * n - 0.5)  # of a single sample, or the two in the middle, half stays
    for i in range(n):
        end = min(i, n - 1 - i)
        st["statistic"][st["order"][i]] = min(max(end + 1.0 - cut, 0.0), 1.0)
    finish(bus, fcc, s, by_weights(n, st), n, p, st)


@kernel
def mid_value(bus, fcc, s, p, st, on):
    """Vote signal s by the middle one of the first three channels in service; of two the mean."""
    if on is None:  # not chosen
        return
    n = ranked(bus, s, p, st)
    x, order, spare = st["x"], st["order"], 0
    for i in range(n):
        spare = max(spare, order[i])
    low, high, taken = 0.0, 0.0, 0
    kept = n if n < CHANNELS else CHANNELS - 1
    for i in range(n):
        if n == CHANNELS and order[i] == spare:
            continue
        if taken == (kept - 1) // 2:
            low = x[order[i]]
        if taken == kept // 2:
            high = x[order[i]]
        taken += 1
    finish(bus, fcc, s, mean(low, high, 0.5) if n > 0 else st["vote"], n, p, st)
