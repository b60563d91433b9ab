"""What persists: counts of miscompares, and the failures that they latch.

Source: Zhang 2023, sections 1 and 2; docs/redundancy.md.
"""

from __future__ import annotations

from rig.computer.redundancy.compare import is_singular
from rig.kernels import kernel


@kernel
def count_miscompares(n, ranked, p, st):
    """Frames in a row that each channel disagreed with all others (section 2).

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
            count[c] = count[c] + 1 if st["alone"][c] else 0


@kernel
def counts_stand_still(n, p, st):
    """Whether the counts of comparable samples wait in this frame.

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
    """Fail what has persisted: single miscompares, and whom the answer to a singular pattern blames."""
    settled = st["pattern_frames"] >= p["singular_persistence"]
    level = 0
    for c in range(p["fitted"]):
        if st["count"][c] >= p["persistence"] or (settled and st["blamed"][c]):
            st["failed"][c] = True
        level += not st["failed"][c]
    if level != st["level"]:
        st["fade_left"] = p["fade_frames"] + 1
        st["level"] = level
