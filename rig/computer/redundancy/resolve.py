"""Patterns without a majority: 2:2, 1:1, 1:1:1:1 and 1:1:1, each settled by the resolvers of its signal.

In-line monitors, reference and trend are asked in the configured order; the rules of likelihood, extremes and
middle, only when none of them answers.  When nobody answers the vote holds and follows the ranks.
Who stands on which side is told by what is compared, behind the filter if there is one; the vote is made of the samples
themselves.
Source: Zhang 2023, section 2 (ILM), 6 (trend), 7 (reference), 8 (extremes, middle).
Ours: their order, what holds while nobody answers; docs/redundancy.md, 'Patterns without a majority'.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rig.computer.redundancy import opinions, vote
from rig.frame import Pattern, Resolver
from rig.kernels import kernel


class Compared(NamedTuple):
    """Values to compare: the samples, or the low-pass outputs, each less its channel's bias where that is learned."""

    values: Any  # (4,) by channel
    order: Any  # (4,) channels by ascending value
    with_bias: Any  # (4,) what stands beside the reference, which has no part in what the channels differ by
    reference: Any


@kernel
def resolve(ilm, reference, compared, n, p, st):
    """Return the resolver that answered a pattern without a majority, and this frame's vote; mark ``blamed``.

    ilm : (4,) flags; reference : of the signal itself; compared : Compared; n : comparable samples
    """
    if st["pattern"] == Pattern.P2_2 or st["pattern"] == Pattern.P1_1:
        return resolve_two_camps(ilm, reference, compared, n, p, st)
    return resolve_all_apart(ilm, compared, n, p, st)


@kernel
def resolve_two_camps(ilm, reference, compared, n, p, st):
    """Resolve 2:2 and 1:1: which half is right (sections 2, 6 and 7; figures 7 and 8)."""
    x, resolvers = st["x"], p["resolvers"]
    y, order, near = compared.with_bias, compared.order, compared.reference
    half = n // 2
    low, high = order[half - 1], order[half]
    for place in range(len(resolvers)):
        name = resolvers[place]
        sides = opinions.NO_ANSWER
        if name == Resolver.ILM:
            sides = opinions.by_ilm(ilm, order, n)
        elif name == Resolver.TREND:
            sides = opinions.by_trend(st, p["trend_frames"])
        elif name == Resolver.REFERENCE and st["reference_usable"]:
            sides = opinions.by_reference(y[high], y[low], near, st["reference_threshold"])
        if sides != opinions.NO_ANSWER:
            blame_sides(sides, order, n, st)
            if name == Resolver.REFERENCE:
                return name, opinions.middle(x[high], x[low], reference)
            good = half if sides == opinions.LOW_SIDE else 0
            return name, vote.halfway(x[order[good]], x[order[good + half - 1]])
    return Resolver.UNRESOLVED.value, hold(n, st)


@kernel
def resolve_all_apart(ilm, compared, n, p, st):
    """Resolve 1:1:1:1 and 1:1:1: at most one channel is right (section 8; monitors and reference before it: ours)."""
    resolvers = p["resolvers"]
    y, order, near = compared.with_bias, compared.order, compared.reference
    for place in range(len(resolvers)):
        name = resolvers[place]
        good = opinions.NO_ANSWER
        if name == Resolver.ILM:
            good = opinions.only_good(ilm, order, n)
        elif name == Resolver.REFERENCE and st["reference_usable"]:
            good = opinions.only_near(y, order, n, near, st["reference_threshold"], p["wraps"])
        if good != opinions.NO_ANSWER:
            blame_all_but(good, good, order, n, st)
            return name, st["x"][good]
    return resolve_by_rank(order, n, p, st)


@kernel
def resolve_by_rank(order, n, p, st):
    """Apply the rules of likelihood where configured: of four the extremes fail, of three all but the middle.

    Section 8, item 1 for four, whose two in between go on as a duplex, and item 2 for three.
    """
    x = st["x"]
    rule = Resolver.EXTREMES.value if st["pattern"] == Pattern.P1_1_1_1 else Resolver.MIDDLE.value
    for place in range(len(p["resolvers"])):
        if p["resolvers"][place] == rule:
            low, high = order[(n - 1) // 2], order[n // 2]
            blame_all_but(low, high, order, n, st)
            return rule, vote.halfway(x[low], x[high])
    return Resolver.UNRESOLVED.value, hold(n, st)


@kernel
def hold(n, st):
    """Return the vote that nobody decides: the last one, moved by the mean change of the two voting ranks (ours).

    In the first frame of a pattern or of another number of samples that change is half of the fault's jump, and
    counts as zero.  In the first frame of all, when there is no last vote, the mean of the two ranks.
    """
    if not st["started"]:
        return vote.mean(st["x"][st["order"][(n - 1) // 2]], st["x"][st["order"][n // 2]], 0.5)
    if st["pattern_frames"] == 1:
        return st["vote"]
    return st["vote"] + 0.5 * (st["rise_high"] + st["rise_low"])


@kernel
def blame_sides(sides, order, n, st):
    """Mark the channels of the sides that an answer would fail."""
    half = n // 2
    for i in range(half):
        if sides & opinions.LOW_SIDE:
            st["blamed"][order[i]] = True
        if sides & opinions.HIGH_SIDE:
            st["blamed"][order[half + i]] = True


@kernel
def blame_all_but(kept, also_kept, order, n, st):
    """Mark all ranked channels but the one or two that an answer keeps."""
    for i in range(n):
        c = order[i]
        st["blamed"][c] = c not in (kept, also_kept)
