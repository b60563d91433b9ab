"""Patterns without a majority: 2:2, 1:1, 1:1:1:1 and 1:1:1, each settled by the resolvers of its signal.

In-line monitors, reference and trend are asked in the configured order; the rules of likelihood, extremes and
middle, only when none of them answers.  When nobody answers the vote holds and follows the ranks.
Source: Zhang 2023, sections 2 and 6 to 8; docs/redundancy.md, 'Patterns without a majority'.
"""

from __future__ import annotations

from rig.computer.redundancy import opinions, vote
from rig.frame import Pattern, Resolver
from rig.kernels import kernel


@kernel
def settle(ilm, reference, n, p, st):
    """The resolver that answered a pattern without a majority, and this frame's vote; marks ``blamed``."""
    if st["pattern"] == Pattern.P2_2 or st["pattern"] == Pattern.P1_1:
        return settle_halves(ilm, reference, n, p, st)
    return settle_apart(ilm, reference, n, p, st)


@kernel
def settle_halves(ilm, reference, n, p, st):
    """2:2 and 1:1: which half is right (sections 2, 6 and 7)."""
    x, order, resolvers = st["x"], st["order"], p["resolvers"]
    half = n // 2
    low, high = x[order[half - 1]], x[order[half]]
    for place in range(len(resolvers)):
        name = resolvers[place]
        sides = opinions.NO_ANSWER
        if name == Resolver.ILM:
            sides = opinions.by_ilm(ilm, order, n)
        elif name == Resolver.TREND:
            sides = opinions.by_trend(st, p["trend_frames"])
        elif name == Resolver.REFERENCE and st["reference_usable"]:
            sides = opinions.by_reference(high, low, reference, st["reference_threshold"])
        if sides != opinions.NO_ANSWER:
            blame_sides(sides, n, st)
            if name == Resolver.REFERENCE:
                return name, opinions.middle(high, low, reference)
            good = half if sides == opinions.LOW_SIDE else 0
            return name, vote.mean(x[order[good]], x[order[good + half - 1]], 0.5)
    return Resolver.UNRESOLVED.value, hold(n, st)


@kernel
def settle_apart(ilm, reference, n, p, st):
    """1:1:1:1 and 1:1:1: at most one channel is right (section 8, after monitors and reference)."""
    x, order, resolvers = st["x"], st["order"], p["resolvers"]
    for place in range(len(resolvers)):
        name = resolvers[place]
        good = opinions.NO_ANSWER
        if name == Resolver.ILM:
            good = opinions.only_good(ilm, order, n)
        elif name == Resolver.REFERENCE and st["reference_usable"]:
            good = opinions.only_near(x, order, n, reference, st["reference_threshold"], p["wraps"])
        if good != opinions.NO_ANSWER:
            blame_all_but(good, good, n, st)
            return name, x[good]
    return settle_by_rank(n, p, st)


@kernel
def settle_by_rank(n, p, st):
    """The rules of likelihood, where they are configured: of four the extremes fail, of three all but the middle."""
    x, order = st["x"], st["order"]
    rule = Resolver.EXTREMES.value if st["pattern"] == Pattern.P1_1_1_1 else Resolver.MIDDLE.value
    for place in range(len(p["resolvers"])):
        if p["resolvers"][place] == rule:
            low, high = order[(n - 1) // 2], order[n // 2]
            blame_all_but(low, high, n, st)
            return rule, vote.mean(x[low], x[high], 0.5)
    return Resolver.UNRESOLVED.value, hold(n, st)


@kernel
def hold(n, st):
    """The vote that nobody decides: the last one, moved by the mean change of the two voting ranks.

    In the first frame of a pattern or of another number of samples that change is half of the fault's jump, and
    counts as zero.  In the first frame of all, when there is no last vote, the mean of the two ranks.
    """
    if not st["started"]:
        return vote.mean(st["x"][st["order"][(n - 1) // 2]], st["x"][st["order"][n // 2]], 0.5)
    if st["pattern_frames"] == 1:
        return st["vote"]
    return st["vote"] + 0.5 * (st["rise_high"] + st["rise_low"])


@kernel
def blame_sides(sides, n, st):
    """Mark the channels of the sides that an answer would fail."""
    half = n // 2
    for i in range(half):
        if sides & opinions.LOW_SIDE:
            st["blamed"][st["order"][i]] = True
        if sides & opinions.HIGH_SIDE:
            st["blamed"][st["order"][half + i]] = True


@kernel
def blame_all_but(one, other, n, st):
    """Mark all ranked channels but the one or two that an answer keeps."""
    for i in range(n):
        c = st["order"][i]
        st["blamed"][c] = c not in (one, other)
