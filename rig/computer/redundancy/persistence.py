"""Persistence: miscompare counters, latched failures, readmission by command.

Source: Zhang 2023, section 2 (a failure is a miscompare that outlasts the time threshold).
Ours: how long counts stand still for patterns without a majority, readmission.
"""

from __future__ import annotations

from rig.computer.redundancy.compare import is_singular
from rig.computer.redundancy.lasting import is_stale
from rig.kernels import kernel
from rig.units.angles import difference


@kernel
def count_miscompares(n, ranked, p, st):
    """Count the frames in a row that each channel disagreed with all others (section 2).

    A sample that is not comparable counts always; during a singular pattern and for a while after it the counts
    of the others stand still, so that the ordinary rule does not fail everybody first.
    ranked : bits of the channels with a comparable sample
    """
    frozen = counts_stand_still(n, p, st)
    count = st["count"]
    for c in range(p["fitted"]):
        if st["failed"][c]:
            continue
        if (ranked >> c) & 1 == 0:
            count[c] += 1
        elif not frozen:
            count[c] = count[c] + 1 if st["miscomparing"][c] else 0


@kernel
def counts_stand_still(n, p, st):
    """Return True if persistence counters hold in this frame (ours).

    They do during a singular run and, after it, for as long as it was, ``singular_persistence`` at most: noise that
    splits the good pair of a 2:2 must not let the comparison fail it.  What disputes a last channel needs no majority.
    """
    if is_singular(st["pattern"]):
        st["singular_run"] += 1
        return True
    if st["singular_run"] > 0:
        st["freeze"] = max(st["freeze"], min(st["singular_run"], p["singular_persistence"]))
        st["singular_run"] = 0
    if st["freeze"] == 0:
        return False
    st["freeze"] -= 1
    return n != 1


@kernel
def latch(p, st):
    """Latch failures that persisted: miscompares (section 2), and channels blamed in a singular pattern."""
    settled = st["pattern_frames"] >= p["singular_persistence"]
    level = 0
    for c in range(p["fitted"]):
        if st["count"][c] >= p["persistence"] or (settled and st["blamed"][c]):
            st["failed"][c] = True
        level += not st["failed"][c]
    if level != st["level"]:
        st["fade_left"] = p["fade_frames"] + 1
        st["level"] = level


@kernel
def watch_failed(samples, valid, vote, p, st):
    """Count how long each failed channel has agreed with the vote again, for a readmission by command (ours)."""
    if st["level"] == p["fitted"]:
        return
    for c in range(p["fitted"]):
        off = difference(samples[c], vote, p["wraps"]) - st["bias"][c]
        near = valid[c] and abs(off) <= p["threshold"] and not is_stale(c, p, st)
        st["agreed"][c] = st["agreed"][c] + 1 if st["failed"][c] and near else 0


@kernel
def readmit(commanded, p, st):
    """Clear failures of ``commanded`` channels, bits, that agreed with the vote for ``readmit_frames`` (ours)."""
    if commanded == 0:
        return
    for c in range(p["fitted"]):
        if (commanded >> c) & 1 == 1 and st["failed"][c] and st["agreed"][c] >= p["readmit_frames"]:
            st["failed"][c] = st["count"][c] = st["agreed"][c] = 0
