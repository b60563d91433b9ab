"""Posterior of every set of faulty members: the channels, and the reference as one more.

Each of the 2^(n+1) sets A is a hypothesis with its probability and, for every member, an estimate of how far it reads
from the quantity, with its variance.  In a frame

1. a healthy member may turn faulty, with a small chance; of the ways into a set one estimate is made (mean, variance),
   to which the new fault adds a jump, and every frame a step of a random walk;
2. the quantity, of which nothing is known before (flat), is estimated from all members, each freed of its estimate;
3. the set is weighed by the likelihood of what is left, and the estimates follow it.

Member i reads x_i = quantity + b_i + noise. Healthy: b_i is a constant, N(0, bias); that of the reference varies
(Gauss and Markov, first order) with a third of its threshold, which is its noise too. Faulty: b_i jumps at the onset
and walks, and the noise is that of a fault. The correlation that the common quantity makes between the estimates is
left out. Bounded (added): the likelihood of a set is at least so much of the best that the persistence brings a fault
from its onset to the limit, in a set that is held by that the healthy learn nothing, and the limit must be exceeded
for the persistence.

Sources: Magill 1965, Optimal adaptive estimation of sampled stochastic processes (the bank, without switching); Blom
and Bar-Shalom 1988, The interacting multiple model algorithm (step 1).  Amounts are in thresholds of the signal.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from rig.computer.redundancy.baseline_managers import step
from rig.computer.redundancy.baseline_managers.baseline_settings import MEMBERS, SETS
from rig.core.frame import CHANNELS
from rig.core.kernels import kernel

BAYES_STATE: Final = (
    ("began", "u1"),
    ("chance", "f8", (SETS,)),
    ("read", "f8", (SETS, MEMBERS)),  # estimate of each member's b
    ("variance", "f8", (SETS, MEMBERS)),
    ("likelihood", "f8", (SETS,)),  # logarithm, in this frame
    ("quantity", "f8", (SETS,)),  # less the middle
    ("readings", "f8", (MEMBERS,)),  # of this frame, less the middle
    ("healthy_variance", "f8", (MEMBERS,)),  # of the noise
)
_LEAST: Final = 1e-300  # chance of a set


class Bank(NamedTuple):
    """Which members take part, a bit each: at all, and with a reading of this frame."""

    part: Any
    here: Any


@kernel
def bayes(bus, fcc, s, p, st, on):
    """Weigh all sets of faulty members of signal s, and vote the mean of the quantity over them."""
    if on is None:  # not chosen
        return
    at = step.begin(bus, fcc, s, p, st)
    voted, worst = at.middle, step.NO_CHANNEL
    if at.n > 1:
        bank = take(at, p, st)
        onsets(bank.part, p, st)
        weigh(bank, p, st)
        normalise(bank.part, p, st)
        log_odds(bank.part, st)
        worst, voted = step.largest_above(at.n, p, st), posterior_mean(bank.part, at, p, st)
    if step.end(bus, fcc, s, at, step.slow_faults(worst, p, st), voted, p, st):
        st["began"] = 0


@kernel
def take(at, p, st):
    """Write this frame's readings; return the Bank.  In the first frame all members are healthy."""
    part, here, third = 1 << CHANNELS, 0, st["reference_threshold"] / (3.0 * p["threshold"])
    for c in range(p["fitted"]):
        part |= int(not st["failed"][c]) << c
        st["healthy_variance"][c] = p["noise"][0] ** 2
    for i in range(at.n):
        c = st["order"][i]
        st["readings"][c] = step.residual(c, at, p["threshold"], st)
        here |= 1 << c
    if at.usable:
        off = (at.reference - at.center) / p["threshold"]
        st["readings"][CHANNELS] = min(max(off, -1e6), 1e6)
        st["healthy_variance"][CHANNELS] = third * third
        here |= 1 << CHANNELS
    if st["began"] == 0:
        st["began"] = 1
        for a in range(SETS):
            st["chance"][a] = 1.0 if a == 0 else 0.0
            for i in range(MEMBERS):
                st["read"][a, i] = 0.0
                st["variance"][a, i] = p["bias"] ** 2 if i < CHANNELS else third * third
    return Bank(part, here)


@kernel
def onsets(part, p, st):
    """Let healthy members turn faulty, from the largest set on, so that those that it is reached from are as before."""
    for a in range(SETS - 1, -1, -1):
        if a & part != a:
            continue
        stays = st["chance"][a]
        for i in range(MEMBERS):
            if (part >> i) & 1 == 1 and (a >> i) & 1 == 0:
                stays *= 1.0 - p["onset_per_frame"]
        total = stays
        for i in range(MEMBERS):
            if (a >> i) & 1 == 1:
                total += p["onset_per_frame"] * st["chance"][a & ~(1 << i)]
        if total > 0.0:
            for i in range(MEMBERS):
                if (part >> i) & 1 == 1:
                    mix(a, i, stays / total, p["onset_per_frame"] / total, p, st)
        forget(a, p, st)
        st["chance"][a] = total


@kernel
def mix(a, i, stays, onset, p, st):
    """Make one estimate of member i in set ``a`` of the ways into it; a faulty one has walked a frame.

    stays : share of those who were there; onset : that of a way from another set, for its chance
    """
    read, variance, chance = st["read"], st["variance"], st["chance"]
    mean = stays * read[a, i]
    for j in range(MEMBERS):
        if (a >> j) & 1 == 1:
            before = a & ~(1 << j)
            mean += onset * chance[before] * read[before, i]
    spread = stays * (variance[a, i] + (read[a, i] - mean) ** 2)
    for j in range(MEMBERS):
        if (a >> j) & 1 == 1:
            before = a & ~(1 << j)
            jumped = p["jump"] ** 2 if j == i else 0.0
            spread += onset * chance[before] * (variance[before, i] + jumped + (read[before, i] - mean) ** 2)
    faulty = (a >> i) & 1 == 1
    read[a, i], variance[a, i] = mean, spread + (p["walk"] ** 2 if faulty else 0.0)


@kernel
def forget(a, p, st):
    """Let the reference, where it is healthy, forget a share of its error."""
    if (a >> CHANNELS) & 1 == 0:
        kept = 1.0 - 1.0 / p["reference_frames"]
        st["read"][a, CHANNELS] *= kept
        before = st["variance"][a, CHANNELS]
        st["variance"][a, CHANNELS] = kept * kept * before + (1.0 - kept * kept) * st["healthy_variance"][CHANNELS]


@kernel
def noise_of(a, i, p, st):
    """Return the variance of the noise of member i in set ``a``; a fault never makes it less."""
    healthy = st["healthy_variance"][i]
    return max(p["noise"][1] ** 2, healthy) if (a >> i) & 1 == 1 else healthy


@kernel
def weigh(bank, p, st):
    """Write the log likelihood and the quantity of each set; its estimates follow, those of the faulty always."""
    best = -math.inf
    for a in range(SETS):
        if a & bank.part == a:
            st["likelihood"][a] = likelihood(a, bank.here, p, st)
            best = max(best, st["likelihood"][a])
    least = best - largest_step(p)
    for a in range(SETS):
        if a & bank.part != a:
            continue
        held = st["likelihood"][a] < least
        if held:
            st["likelihood"][a] = least
        follow(a, a if held else bank.part, bank.here, p, st)
        st["likelihood"][a] -= best


@kernel
def largest_step(p):
    """Return the largest evidence of one frame against a set: in a persistence from the onset to the limit."""
    if not p["bounded"]:
        return math.inf
    return (p["limit"][0] - math.log(p["onset_per_frame"])) / p["persistence"]


@kernel
def likelihood(a, here, p, st):
    """Return the log likelihood of set ``a`` but for what all sets have; write its quantity."""
    read, variance, y = st["read"], st["variance"], st["readings"]
    weights, mean, product, squares = 0.0, 0.0, 1.0, 0.0
    for i in range(MEMBERS):
        if (here >> i) & 1 == 1:
            v = variance[a, i] + noise_of(a, i, p, st)
            weights += 1.0 / v
            mean += (y[i] - read[a, i]) / v
            product *= v
    mean /= weights
    for i in range(MEMBERS):
        if (here >> i) & 1 == 1:
            squares += (y[i] - read[a, i] - mean) ** 2 / (variance[a, i] + noise_of(a, i, p, st))
    st["quantity"][a] = mean
    return -0.5 * (math.log(product * weights) + squares)


@kernel
def follow(a, learning, here, p, st):
    """Move the estimates of the members ``learning``, bits, of set ``a`` by what is left of this frame's readings."""
    read, variance, weights = st["read"], st["variance"], 0.0
    for i in range(MEMBERS):
        if (here >> i) & 1 == 1:
            weights += 1.0 / (variance[a, i] + noise_of(a, i, p, st))
    for i in range(MEMBERS):
        if (here & learning) >> i & 1 == 1:
            before = variance[a, i]
            gain = before / (before + noise_of(a, i, p, st))
            read[a, i] += gain * (st["readings"][i] - read[a, i] - st["quantity"][a])
            variance[a, i] = before * (1.0 - gain) + gain * gain / weights


@kernel
def normalise(part, p, st):
    """Multiply chances by likelihoods, and make them a whole."""
    chance, total = st["chance"], 0.0
    for a in range(SETS):
        if a & part == a:
            chance[a] = max(chance[a] * math.exp(st["likelihood"][a]), _LEAST)
            total += chance[a]
    for a in range(SETS):
        if a & part == a:
            chance[a] /= total


@kernel
def log_odds(part, st):
    """Write the log odds that each channel is faulty."""
    for c in range(CHANNELS):
        faulty, healthy = 0.0, 0.0
        for a in range(SETS):
            if a & part == a:
                if (a >> c) & 1 == 1:
                    faulty += st["chance"][a]
                else:
                    healthy += st["chance"][a]
        st["statistic"][c] = math.log(faulty / healthy) if faulty > 0.0 else -math.inf


@kernel
def posterior_mean(part, at, p, st):
    """Return the quantity over all sets by their chances, within the samples."""
    total = 0.0
    for a in range(SETS):
        if a & part == a:
            total += st["chance"][a] * st["quantity"][a]
    x, order = st["x"], st["order"]
    return min(max(at.center + p["threshold"] * total, x[order[0]]), x[order[at.n - 1]])
