"""Splits: 2:2, 1:1, 1:1:1:1 and 1:1:1, each settled by the tie-break rules of its signal.

In-line monitors, lanes, reference and trend are asked in the configured order; the rules of likelihood, extremes and
middle, only when none of them answers.  Without an answer the vote continues with the same channels.
The sides are those of the compared values, behind the filter if there is one; the vote is made of the samples
themselves.
Source: Zhang 2023, section 2 (ILM), 4 (weights), 6 (trend, lanes), 7 (reference), 8 (extremes, middle).
Added: their order, what holds without an answer; docs/explanation/decisions.md, 'Splits'.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rig.computer.redundancy import median_vote as vote
from rig.computer.redundancy import opinions
from rig.computer.redundancy.compare import is_split
from rig.core.frame import DecidedBy, Pattern
from rig.core.kernels import kernel
from rig.core.units.angles import difference


class Compared(NamedTuple):
    """Values to compare: the samples, or the low-pass outputs."""

    values: Any  # (4,) by channel
    order: Any  # (4,) channels by ascending value
    reference: Any  # as they are


@kernel
def resolve(ilm, reference, compared, n, p, st):
    """Return the rule that answered a split, and this frame's vote; mark ``blamed``.

    ilm : (4,) flags; reference : of the signal itself; compared : Compared; n : comparable samples
    """
    if st["pattern"] == Pattern.P2_2 or st["pattern"] == Pattern.P1_1:
        return resolve_two_camps(ilm, reference, compared, n, p, st)
    return resolve_all_apart(ilm, compared, n, p, st)


@kernel
def resolve_two_camps(ilm, reference, compared, n, p, st):
    """Resolve 2:2 and 1:1: which half is right (sections 2, 6 and 7; figures 7 and 8)."""
    x, tie_break = st["x"], p["tie_break"]
    y, order, near = compared.values, compared.order, compared.reference
    half = n // 2
    low, high = order[half - 1], order[half]
    for place in range(len(tie_break)):
        name = tie_break[place]
        sides = opinions.NO_ANSWER
        if name == DecidedBy.ILM:
            sides = opinions.by_ilm(ilm, order, n)
        elif name == DecidedBy.TREND:
            if p["referred"] == 0 or p["trend_beside_reference"] != 0:  # a trend is less than a reference (added)
                sides = opinions.by_trend(st, p)
        elif name == DecidedBy.LANE:
            sides = opinions.by_lanes(st["lanes"], order, n)
        elif name == DecidedBy.REFERENCE and st["reference_usable"]:
            sides = opinions.by_reference(y[high], y[low], near, st["reference_threshold"])
        if sides != opinions.NO_ANSWER:
            blame_sides(sides, order, n, st)
            if name == DecidedBy.REFERENCE:
                return name, opinions.middle(x[high], x[low], reference)
            return name, vote_of_sides(name, sides, order, n, p, st)
    return DecidedBy.UNRESOLVED.value, hold(n, p, st)


@kernel
def vote_of_sides(name, sides, order, n, p, st):
    """Return the vote when ``sides`` are faulty: the good pair's mean, by its changes where weighted (section 4).

    With two samples of which the trend finds the good one, the weighted vote is near that whose change fits.
    """
    x, half = st["x"], n // 2
    if name == DecidedBy.TREND and sides == opinions.LOW_SIDE | opinions.HIGH_SIDE:
        return vote.between(x[order[half - 1]], x[order[half]], 0.5)
    if p["weighted"] and name == DecidedBy.TREND and n == 2:
        share = vote.trend_weight(st["rise_high"], st["rise_low"], st["rise_vote"])
        return vote.mean(x[st["order"][0]], x[st["order"][1]], share)  # the ranks whose changes these are
    good = half if sides == opinions.LOW_SIDE else 0
    a, b = order[good], order[good + half - 1]
    share = 0.5
    if p["weighted"] and half == 2:
        rise_a, rise_b = difference(x[a], st["before"][a], p["wraps"]), difference(x[b], st["before"][b], p["wraps"])
        share = vote.trend_weight(rise_b, rise_a, st["rise_vote"])
    return vote.between(x[a], x[b], share)


@kernel
def resolve_all_apart(ilm, compared, n, p, st):
    """Resolve 1:1:1:1 and 1:1:1: at most one channel is right (section 8; monitors and reference before it: added)."""
    tie_break = p["tie_break"]
    y, order, near = compared.values, compared.order, compared.reference
    for place in range(len(tie_break)):
        name = tie_break[place]
        good = opinions.NO_ANSWER
        if name == DecidedBy.ILM:
            good = opinions.only_good(ilm, order, n)
        elif name == DecidedBy.REFERENCE and st["reference_usable"]:
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
    rule = DecidedBy.EXTREMES.value if st["pattern"] == Pattern.P1_1_1_1 else DecidedBy.MIDDLE.value
    for place in range(len(p["tie_break"])):
        if p["tie_break"][place] == rule:
            low, high = order[(n - 1) // 2], order[n // 2]
            blame_all_but(low, high, order, n, st)
            return rule, vote.between(x[low], x[high], 0.5)
    return DecidedBy.UNRESOLVED.value, hold(n, p, st)


@kernel
def hold(n, p, st):
    """Return the vote without a decision: a fixed mean of the two samples between which the last vote was (added).

    A channel that jumps away has no share in it, wherever it moves; two that drift apart have half each.  So its
    error is at most that of the plain mean of those in use, while the last vote of all was right.  The shares are those
    of the first frame without a decision.  They go on through gaps and answers that did not last, and begin again with
    other channels and where one of the two jumps.  Where the last vote was of one side, half each of the two ranks.
    """
    x, order = st["x"], st["order"]
    if not st["started"]:
        return vote.mean(x[order[(n - 1) // 2]], x[order[n // 2]], 0.5)
    ranked = 0
    for i in range(n):
        ranked |= 1 << order[i]
    gap = x[st["hold_high"]] - x[st["hold_low"]]
    if st["hold_of"] != ranked or abs(gap - st["hold_gap"]) > st["threshold"]:
        st["hold_of"] = ranked
        st["hold_low"], st["hold_high"], st["hold_share"] = order[(n - 1) // 2], order[n // 2], 0.5
        if st["basis"]:
            share_out(st["vote"], n, st)
    st["hold_gap"] = x[st["hold_high"]] - x[st["hold_low"]]
    return vote.between(x[st["hold_low"]], x[st["hold_high"]], st["hold_share"])


@kernel
def keep_basis(decided_by, st):
    """Note whether the next frame without a decision may begin with this frame's vote; forget shares that have ended.

    It may if the vote is of all channels in use, among which is a majority, or was held itself.
    """
    majority = st["whole"] and not is_split(st["pattern"])
    if majority:
        st["hold_of"] = 0
    st["basis"] = majority or decided_by == DecidedBy.UNRESOLVED


@kernel
def share_out(last, n, st):
    """Find the neighbours in rank between which the ``last`` vote is, and the upper one's share in it."""
    x, order = st["x"], st["order"]
    place = 0
    while place < n - 2 and x[order[place + 1]] < last:
        place += 1
    low, high = order[place], order[place + 1]
    gap = x[high] - x[low]
    share = (last - x[low]) / gap if gap > 0.0 else 0.5
    st["hold_low"], st["hold_high"], st["hold_share"] = low, high, min(max(share, 0.0), 1.0)


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
