"""Monitors of averages over time: a median over a window, and a mean within a gate.

window_median  the median of each residual over its last frames; beyond a limit the channel fails.  Running medians:
               Tukey 1977, Exploratory Data Analysis.  A window of at least twice the persistence less one (added) keeps
               what is shorter than the persistence from failing a channel
gate_mean      the mean of the channels; the low-passed deviation of each from it is integrated beyond a gate, and a
               channel whose integral is used up leaves for good.  iNav's proposal to average two gyros (pull request
               11958 of 2026), whose gate is that of PX4's selector; PX4 names the deviation from the mean of all units
               too (pull request 28318 of 2026).  The deviations of two channels are equal: added, as with the other
               managers, theirs is from the middle, which a usable reference moves.  The bound on a
               residual is added
"""

from __future__ import annotations

from typing import Final

from rig.computer.redundancy.baseline_managers import step
from rig.computer.redundancy.baseline_managers.baseline_settings import MEDIAN_WINDOW
from rig.computer.redundancy.baselines import KEPT, mean_of
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel

MEDIAN_STATE: Final = (
    ("window", "f8", (CHANNELS, MEDIAN_WINDOW)),  # a ring of each channel; zero where it had no sample
    ("sorted", "f8", (CHANNELS, MEDIAN_WINDOW)),  # the same values, rising
    ("place", "i8"),  # of the next frame
)
GATE_STATE: Final = (("deviation", "f8", (CHANNELS,)), ("integral", "f8", (CHANNELS,)))


@kernel
def window_median(bus, fcc, s, p, st, on):
    """Compare the median of each residual of signal s over the window with the limit, and vote the middle."""
    if on is None:  # not chosen
        return
    at = step.begin(bus, fcc, s, p, st)
    if at.n > 1:
        take(at, p, st)
    if step.end(bus, fcc, s, at, step.largest_above(at.n, p, st), at.middle, p, st):
        st["window"][:] = st["sorted"][:] = 0.0
        st["place"] = 0


@kernel
def take(at, p, st):
    """Put the residuals of this frame into the rings; write the magnitude of each median."""
    place, here = st["place"], 0
    for i in range(at.n):
        here |= 1 << st["order"][i]
    for c in range(CHANNELS):
        new = step.residual(c, at, p["threshold"], st) if (here >> c) & 1 == 1 else 0.0
        replace(st["sorted"][c], st["window"][c, place], new, p["window"])
        st["window"][c, place] = new
        st["statistic"][c] = abs(st["sorted"][c, p["window"] // 2])
    st["place"] = (place + 1) % p["window"]


@kernel
def replace(rising, old, new, n):
    """Put ``new`` in place of ``old`` into the ``n`` rising values."""
    i = 0
    while i < n - 1 and rising[i] != old:
        i += 1
    while i < n - 1 and rising[i + 1] < new:
        rising[i] = rising[i + 1]
        i += 1
    while i > 0 and rising[i - 1] > new:
        rising[i] = rising[i - 1]
        i -= 1
    rising[i] = new


@kernel
def gate_mean(bus, fcc, s, p, st, on):
    """Integrate what each deviation from the mean of signal s exceeds the gate by, and vote that mean."""
    if on is None:  # not chosen
        return
    at = step.begin(bus, fcc, s, p, st)
    if at.n > 1:
        deviate(at, step.limit_of(at.n, p), p, st)
    voted = mean_of(st, at.n) if at.n > 0 else at.middle
    if step.end(bus, fcc, s, at, step.largest_above(at.n, p, st), voted, p, st):
        st["deviation"][:] = st["integral"][:] = 0.0


@kernel
def deviate(at, limit, p, st):
    """Move each low-passed deviation, in spreads, and its integral beyond the gate, which is the statistic."""
    center, off = 0.0, st["statistic"]
    most = limit / p["persistence"] if p["bounded"] else step.LARGEST
    for i in range(at.n):
        c = st["order"][i]
        off[c] = min(max(step.residual(c, at, p["spread"], st), -most), most)  # else all are as far from the mean
        center += off[c] / at.n if at.n > 2 else 0.0
    for i in range(at.n):
        c = st["order"][i]
        st["deviation"][c] = KEPT * st["deviation"][c] + (1.0 - KEPT) * (off[c] - center)
        st["integral"][c] = max(st["integral"][c] + abs(st["deviation"][c]) - p["allowance"], 0.0)
        st["statistic"][c] = st["integral"][c]
