"""The back-up, a fifth control law on the inertial unit, which needs no lane and no vote; and who takes over from whom.

It flies when no lane is engaged, when the vote of commands stays unresolved, or when the pilot commands it, and then to
the end of the flight.  It takes over what the lane that led last has.  All signals are lost to it but the pilot's
sticks, the median of their channels; the law flies on the inertial unit's references, as after the loss of all signals.
It drives all coils; only shut-off valves that a monitor of the actuators opened stay open.
Like a lane that starts again or is readmitted it takes over the state of all stages (``join``).
Source: Zhang 2023, section 2 (emergency back-up); its inputs are added.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.lanes.alike import copy_state, holder, part
from rig.computer.lanes.command import rejoin
from rig.computer.lanes.health import NO_LANE, is_engaged, responds
from rig.computer.lanes.lane_clock import insert
from rig.computer.lanes.think import follow_votes, give_references
from rig.core.frame import CHANNELS, COMPUTERS, LaneTest, S, sig
from rig.core.kernels import inlined, kernel

PLACE: Final = len(COMPUTERS)  # behind the lanes in all that each has of its own
_STICKS: Final = (sig.D_P, sig.D_R, sig.D_Y)


@kernel
def fly_backup(row, fcc, k, ordered, data):
    """Fill the FCC record of the back-up, which has the decisions of the lane that led last.

    row : FRAME record, whose BUS it reads;  ordered : (4,) workspace;  data : its ComputerData
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


@inlined
def join(lanes):
    """Let lanes that start again or are readmitted, and the back-up, take over what the leading lane has.

    lanes : LaneData, whose arrays have one computer each at ``[i]``, the back-up last
    """
    system = lanes.health.system[0]
    for i in range(lanes.fitted):
        lane = lanes.health.lane[i]
        lanes.running[i], lanes.counted[i] = lane["running"], is_engaged(lane)
        lanes.links.relays[i] = lane["failed_for"] not in (LaneTest.COMMANDS, LaneTest.LINK, LaneTest.CLOCK)
        if lane["joins"] != 0:
            leader = other_engaged(i, lanes)
            if leader != NO_LANE:
                take_over(i, leader, lanes)
            if is_engaged(lane):
                rejoin(i, leader, lanes.commands)
    if system["taken_over"] != 0:
        take_over(PLACE, system["led"], lanes)


@kernel
def other_engaged(i, lanes):
    """Return the first engaged lane that runs on, but i; ``NO_LANE`` if there is none."""
    for j in range(lanes.fitted):
        lane = lanes.health.lane[j]
        if j != i and is_engaged(lane) and responds(lane) and lane["joins"] == 0:
            return j
    return NO_LANE


@inlined
def take_over(i, j, lanes):
    """Give computer i all that computer j has."""
    if i != PLACE and lanes.alike[i] != 0:
        part(lanes)
    lanes.fcc[i] = lanes.fcc[j]
    copy_state(i, holder(j, lanes), lanes)
