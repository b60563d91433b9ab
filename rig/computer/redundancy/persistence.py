"""Persistence: miscompare counters, answers that last, latched failures, readmission by command.

Source: Zhang 2023, section 2 (a failure is a miscompare that outlasts the time threshold).
Added: how long counts stand still for splits and how long an answer to one must stand, the
up-and-down counter, what becomes of a split that nothing answers, readmission.
"""

from __future__ import annotations

import numpy as np

from rig.computer.redundancy.compare import comparable, is_split
from rig.computer.redundancy.slow_faults import is_stale
from rig.core.frame import DecidedBy, Pattern
from rig.core.kernels import kernel
from rig.core.units.angles import difference


@kernel
def count_miscompares(n, ranked, vote, p, st):
    """Count the frames in a row that each channel disagreed with all others (section 2).

    A sample that is not comparable counts always; during a split and for a while after it the counts
    of the others stand still, so that the ordinary rule does not isolate all channels first.  An agreeing frame sets
    the count to zero, or with ``count_down`` takes that off it.  Behind a filter a miscompare counts while the sample
    itself is off the vote, otherwise one is taken off: the filter's tail of a burst isolates no channel.
    ranked : bits of the channels with a comparable sample
    """
    frozen = counts_stand_still(n, p, st)
    count, filtered = st["count"], p["filter_gain"] > 0.0 and n > 1
    for c in range(p["fitted"]):
        if st["failed"][c]:
            continue
        if (ranked >> c) & 1 == 0:
            count[c] += 1
        elif not frozen:
            if st["miscomparing"][c] and filtered and not is_off(c, vote, p, st):
                count[c] = max(count[c] - 1.0, 0.0)
            elif st["miscomparing"][c]:
                count[c] += 1
            elif count[c] != 0:
                count[c] = max(count[c] - p["count_down"], 0.0) if p["count_down"] > 0.0 else 0.0


@kernel
def is_off(c, vote, p, st):
    """Return True if the sample of channel c itself is off the ``vote`` by more than it may be."""
    return abs(difference(st["x"][c], vote, p["wraps"])) > st["threshold"]


@kernel
def counts_stand_still(n, p, st):
    """Return True if persistence counters hold in this frame (added).

    They do during a run of splits and, after it, for as long as it was, ``split_persistence`` at most: noise that
    splits the good pair of a 2:2 must not let the comparison fail it.  For a last channel no majority is needed.
    """
    if is_split(st["pattern"]):
        st["split_run"] += 1
        return True
    if st["split_run"] > 0:
        st["freeze"] = max(st["freeze"], min(st["split_run"], p["split_persistence"]))
        st["split_run"] = 0
    if st["freeze"] == 0:
        return False
    st["freeze"] -= 1
    return n != 1


@kernel
def has_stood(decided_by, p, st):
    """Return True if the answer to a split may be acted on (added).

    The pattern has lasted for ``split_persistence`` frames, and the same rule was against the same channels in at
    least as many frames in a row as half of that: one row without a reference decides nothing.  The byte of a trend
    counts for all frames that it covers and in which no other rule answered.
    Writes answer, answer_blames and answer_frames, and counts the frames without an answer, which one that does not
    stand, or a frame without all samples, leaves as they are.
    """
    if not is_split(st["pattern"]):
        st["answer_frames"] = st["silent_frames"] = 0
        if st["whole"]:
            st["unresolved_frames"] = 0
        return False
    if st["together"]:
        return False
    blamed = 0
    for c in range(p["fitted"]):
        blamed |= np.int64(st["blamed"][c] != 0) << c
    same = decided_by == st["answer"] and blamed == st["answer_blames"] and st["pattern_frames"] > 1
    if same:
        st["answer_frames"] += 1
    else:
        unanswered = min(st["silent_frames"], st["pattern_frames"] - 1, p["trend_frames"] - 1)
        st["answer_frames"] = 1 + (unanswered if decided_by == DecidedBy.TREND else 0)
    st["answer"], st["answer_blames"] = decided_by, blamed
    stands = 2 * st["answer_frames"] >= p["split_persistence"]
    if decided_by == DecidedBy.UNRESOLVED:
        st["silent_frames"] += 1
        st["unresolved_frames"] += 1
    else:
        st["silent_frames"] = 0
        if stands:
            st["unresolved_frames"] = 0
    return st["pattern_frames"] >= p["split_persistence"] and stands


@kernel
def settle(decided_by, p, st):
    """Latch persistent miscompares and the channels of a tie-break that has stood; return the rule.

    A split that no rule has answered for ``unresolved_s`` is given up (added): all its channels are isolated, so
    that its reference flies, or its degraded mode.  Where extremes have settled 1:1:1:1 the two that are left stay
    under suspicion (section 8, item 1).
    """
    settled, level = has_stood(decided_by, p, st), st["level"]
    if 0 < p["unresolved_frames"] <= st["unresolved_frames"]:
        decided_by = DecidedBy.GIVEN_UP.value
        st["failed"][: p["fitted"]] = True
    latch(settled, p, st)
    if st["level"] != level:
        st["after_extremes"] = settled and decided_by == DecidedBy.EXTREMES and st["level"] == 2
    return decided_by


@kernel
def latch(settled, p, st):
    """Latch failures that persisted: miscompares (section 2), and channels that lost a ``settled`` split."""
    level = 0
    for c in range(p["fitted"]):
        if st["count"][c] >= p["persistence"] or (settled and st["blamed"][c]):
            st["failed"][c] = True
        level += not st["failed"][c]
    if level != st["level"]:
        st["fade_left"] = p["fade_frames"] + 1
        st["level"] = level


@kernel
def watch_failed(values, samples, valid, vote, p, st):
    """Count how long each failed channel has agreed with the vote again, for a readmission by command (added).

    values : (4,) what is compared with the vote, of these samples; no vote is stored until there was a sample
    """
    if st["level"] == p["fitted"] or (st["pattern"] == Pattern.LOST and not st["started"]):
        return
    for c in range(p["fitted"]):
        off = difference(values[c], vote, p["wraps"])
        there = comparable(samples[c], valid[c], p["low"], p["high"]) and not is_stale(c, st)
        st["agreed"][c] = st["agreed"][c] + 1 if st["failed"][c] and there and abs(off) <= p["threshold"] else 0


@kernel
def readmit(commanded, p, st):
    """Clear failures of ``commanded`` channels, bits, that agreed with the vote for ``readmit_frames`` (added)."""
    if commanded == 0:
        return
    for c in range(p["fitted"]):
        if (commanded >> c) & 1 == 1 and st["failed"][c] and st["agreed"][c] >= p["readmit_frames"]:
            st["failed"][c] = st["count"][c] = st["agreed"][c] = 0
