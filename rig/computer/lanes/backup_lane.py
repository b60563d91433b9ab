"""The back-up: a fifth control law on the inertial unit, which needs no lane and no vote.

It flies when no lane is engaged, when the vote of commands stays unresolved, or when the pilot commands it, and then to
the end of the flight.  It takes over what the lane that led last has.  All signals are lost to it but the pilot's
sticks, the median of their channels; the law flies on the inertial unit's references, as after the loss of all signals.
It drives all coils; only shut-off valves that a monitor of the actuators opened stay open.
Source: Zhang 2023, section 2 (emergency back-up); what it flies on is ours.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.lanes.lane_clock import insert
from rig.computer.lanes.think import follow_votes, give_references
from rig.core.frame import CHANNELS, COMPUTERS, S, sig
from rig.core.kernels import kernel

PLACE: Final = len(COMPUTERS)  # behind the lanes in all that each has of its own
_STICKS: Final = (sig.D_P, sig.D_R, sig.D_Y)


@kernel
def fly_backup(row, fcc, k, ordered, data):
    """Fill the FCC record of the back-up, which has the decisions of the lane that led last.

    row : FRAME record, whose BUS it reads;  ordered : (4,) workspace;  data : ComputerData of its own
    """
    bus = row["bus"]
    give_references(row, bus, fcc, k, data.redundancy.references, data.faults)
    level, usable, reference = fcc["level"], fcc["reference_usable"], fcc["reference"]
    for s in range(S):
        level[s], usable[s] = 0, np.isfinite(reference[s])
    for s in _STICKS:
        level[s] = read_stick(bus, fcc["voted"], s, ordered)
    follow_votes(bus, fcc, data)


@kernel
def read_stick(bus, voted, s, ordered):
    """Vote a stick's signal s by the median of its valid channels; return how many these are."""
    n = 0
    for c in range(CHANNELS):
        x = bus["channels"][s, c]
        if bus["valid"][s, c] != 0 and np.isfinite(x):
            insert(ordered, n, x)
            n += 1
    if n > 0:
        voted[s] = 0.5 * (ordered[n // 2] + ordered[(n - 1) // 2])
    return n
