"""A box that dies: a channel accused on several signals at once is failed on all of its signals.

One frame's evidence against a channel on one signal: it miscompares, its sample is not comparable, or an in-line
monitor or the reference blames it for a pattern without a majority.  Trend, extremes and middle are no evidence.
Ours: docs/redundancy.md, 'A box that dies'; Zhang 2023, sections 2 and 6, name a computer's channel fault logic only.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.redundancy.compare import is_singular
from rig.computer.redundancy.lasting import begin_sums
from rig.frame import CHANNELS, Resolver, State
from rig.kernels import kernel

BOXES: Final = np.dtype(
    [
        ("signals", "i8"),  # that must accuse a channel in the same frame; 0: no channel is failed as a box
        ("persistence", "i8"),  # frames in a row
        ("count", "i8", (CHANNELS,)),  # of such frames
    ],
    align=True,
)


@kernel
def accused(resolver, ranked, p, st):
    """Return the channels against which this frame's evidence of one signal speaks, a bit each.

    ranked : bits of the channels with a comparable sample
    """
    singular = is_singular(st["pattern"])
    settled_by_evidence = resolver in (Resolver.ILM, Resolver.REFERENCE)
    bits = 0
    for c in range(p["fitted"]):
        if st["failed"][c]:
            continue
        here = (ranked >> c) & 1 == 1
        if not here or (settled_by_evidence and st["blamed"][c] if singular else st["miscomparing"][c]):
            bits |= 1 << c
    return bits


@kernel
def fail_boxes(fcc, params, state, box):
    """Fail on all their signals the channels accused long enough on enough signals, unless they are the majority."""
    condemned, candidates, boxes = 0, 0, 0
    for c in range(CHANNELS):
        against, in_use = 0, False
        for s in range(len(params)):
            against += (state[s]["accused"] >> c) & 1
            in_use = in_use or (c < params[s]["fitted"] and not state[s]["failed"][c])
        box["count"][c] = box["count"][c] + 1 if against >= box["signals"] else 0
        boxes += in_use or against > 0
        if box["count"][c] >= box["persistence"]:
            condemned, candidates = condemned | 1 << c, candidates + 1
    if 2 * candidates > boxes or candidates == 0:
        return
    for s in range(len(params)):
        fail_all(condemned, fcc, s, params[s], state[s])


@kernel
def fail_all(channels, fcc, s, p, st):
    """Latch the failure of ``channels``, bits, on signal s of a voted row: the fade begins in the next one."""
    for c in range(p["fitted"]):
        if (channels >> c) & 1 == 1 and not st["failed"][c]:
            st["failed"][c] = True
            st["level"] -= 1
            st["fade_left"] = p["fade_frames"]
            begin_sums(st)
            fcc["state"][s, c], fcc["level"][s], fcc["resolver"][s] = State.FAILED, st["level"], Resolver.BOX
