"""LRU failure: a channel faulty on several signals of a box at once is isolated on all signals of that box.

A box is a named set of signals that one unit of each channel measures: air data, inertial, sticks.

One frame's evidence against a channel on one signal: it miscompares, its sample is not comparable, or an in-line
monitor or the reference decides against it in a split.  Trend, extremes and middle are no evidence.
Added: docs/explanation/decisions.md, 'LRU failure'; Zhang 2023, sections 2 and 6, name the channel fault logic of a
computer only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.compare import is_split
from rig.computer.redundancy.slow_faults import begin_sums
from rig.core.frame import CHANNELS, DecidedBy, State
from rig.core.kernels import kernel
from rig.core.text import choices, quoted, shorten

MOST_BOXES: Final = 16  # as many as signals; place 0 is that of signals in no box
BOXES: Final = np.dtype(
    [
        ("needed", "i8", (MOST_BOXES + 1,)),  # signals of each that must accuse a channel in the same frame; 0: never
        ("signals", "i8"),  # as was asked; -1: more than half of the box
        ("least", "i8"),  # of them, but zeros; 0 where all are: no channel is failed as a box
        ("persistence", "i8"),  # frames in a row
        ("counting", "u1"),  # some count is not zero
        ("count", "i8", (MOST_BOXES + 1, CHANNELS)),  # of such frames
    ],
    align=True,
)


def box_of_signals(boxes: Mapping[str, Sequence[str]], signals: Sequence[str]) -> list[int]:
    """Return the box of each of ``signals``, from 1; all are in box 1 where no ``boxes`` are named.

    ValueError: an unknown signal, one in two boxes or in none, more boxes than MOST_BOXES.
    """
    if not boxes:
        return [1] * len(signals)
    if len(boxes) > MOST_BOXES:
        raise ValueError(f"at most {MOST_BOXES} boxes, got {len(boxes)}")
    found: dict[str, int] = {}
    for number, (box, members) in enumerate(boxes.items(), 1):
        for name in members:
            if name not in signals:
                raise ValueError(f"{shorten(box)}: unknown signal {quoted(name)}, {choices(name, signals)}")
            if name in found:
                other = list(boxes)[found[name] - 1]
                raise ValueError(f"{name} is in two boxes, {shorten(other)} and {shorten(box)}; each is in one")
            found[name] = number
    if missing := [name for name in signals if name not in found]:
        raise ValueError(f"{', '.join(missing)}: in no box; each signal is in one of {', '.join(map(shorten, boxes))}")
    return [found[name] for name in signals]


def boxes(of_signal: NDArray[np.int64], signals: int | None, persistence: int) -> NDArray[np.void]:
    """Return the (1,) BOXES record at the first frame.

    of_signal : (S,) box of each signal, from 1; 0 for none
    signals : with evidence against a channel at once, at most all of its box; None: more than half of the box, and at
              least two, since one signal has its own comparison; 0: no channel is isolated as a box
    persistence : frames in a row
    """
    record = np.zeros(1, BOXES)
    sizes = np.bincount(of_signal, minlength=MOST_BOXES + 1)
    sizes[0] = 0
    needed = sizes // 2 + 1 if signals is None else np.minimum(signals, sizes)
    record["needed"] = np.where(sizes > 1, np.maximum(needed, 2 if signals is None else 0), 0)
    record["least"] = min((int(n) for n in record["needed"][0] if n > 0), default=0)
    record["signals"], record["persistence"] = -1 if signals is None else signals, persistence
    return record


@kernel
def accused(decided_by, ranked, p, st):
    """Return the channels against which one signal has evidence in this frame, a bit each.

    ranked : bits of the channels with a comparable sample
    """
    in_split = is_split(st["pattern"])
    settled_by_evidence = decided_by in (DecidedBy.ILM, DecidedBy.REFERENCE)
    bits = 0
    for c in range(p["fitted"]):
        if st["failed"][c]:
            continue
        here = (ranked >> c) & 1 == 1
        if not here or (settled_by_evidence and st["blamed"][c] if in_split else st["miscomparing"][c]):
            bits |= 1 << c
    return bits


@kernel
def fail_boxes(fcc, params, state, box):
    """Isolate, box by box, on all signals the channels with evidence against them for long enough."""
    box["counting"] = False
    for b in range(1, MOST_BOXES + 1):
        if box["needed"][b] > 0:
            fail_box(b, fcc, params, state, box)


@kernel
def fail_box(b, fcc, params, state, box):
    """Isolate the units of box ``b`` with evidence against them for long enough, unless they are the majority."""
    condemned, candidates, units = 0, 0, 0
    for c in range(CHANNELS):
        against, in_use = 0, False
        for s in range(len(params)):
            if params[s]["box"] == b:
                against += (state[s]["accused"] >> c) & 1
                in_use = in_use or (c < params[s]["fitted"] and not state[s]["failed"][c])
        box["count"][b, c] = box["count"][b, c] + 1 if against >= box["needed"][b] else 0
        box["counting"] |= box["count"][b, c] > 0
        units += in_use or against > 0
        if box["count"][b, c] >= box["persistence"]:
            condemned, candidates = condemned | 1 << c, candidates + 1
    if 2 * candidates > units or candidates == 0:
        return
    for s in range(len(params)):
        if params[s]["box"] == b:
            fail_all(condemned, fcc, s, params[s], state[s])


@kernel
def begin_counts(box):
    """Set all counts to zero, in a frame in which too few signals have evidence for any box."""
    box["counting"] = False
    box["count"][:] = 0


@kernel
def fail_all(channels, fcc, s, p, st):
    """Latch the failure of ``channels``, bits, on signal s of a voted row: the fade begins in the next one."""
    for c in range(p["fitted"]):
        if (channels >> c) & 1 == 1 and not st["failed"][c]:
            st["failed"][c] = True
            st["level"] -= 1
            st["fade_left"] = p["fade_frames"]
            st["after_extremes"] = st["cut_frames"] = 0
            begin_sums(st)
            fcc["state"][s, c], fcc["level"][s], fcc["decided_by"][s] = State.FAILED, st["level"], DecidedBy.BOX
