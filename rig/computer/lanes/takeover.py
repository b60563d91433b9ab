"""Who starts again, is readmitted or begins to fly takes over what the leading lane has: state of all its stages.

data of all kernels : stage.LaneData, whose arrays have one computer each at ``[i]``, the back-up last
"""

from __future__ import annotations

from rig.computer.lanes.backup_lane import PLACE
from rig.computer.lanes.command import rejoin
from rig.computer.lanes.health import NOBODY, is_engaged, responds
from rig.core.frame import LaneTest
from rig.core.kernels import inlined, kernel


@inlined
def join(lanes):
    """Let lanes that start again or are readmitted, and the back-up, take over what the leading lane has."""
    system = lanes.health.system[0]
    for i in range(lanes.fitted):
        lane = lanes.health.lane[i]
        lanes.running[i], lanes.counted[i] = lane["running"], is_engaged(lane)
        lanes.links.relays[i] = lane["failed_for"] not in (LaneTest.COMMANDS, LaneTest.LINK, LaneTest.CLOCK)
        if lane["joins"] != 0:
            leader = other_engaged(i, lanes)
            if leader != NOBODY:
                take_over(i, leader, lanes)
            if is_engaged(lane):
                rejoin(i, leader, lanes.commands)
    if system["taken_over"] != 0:
        take_over(PLACE, system["led"], lanes)


@kernel
def other_engaged(i, lanes):
    """Return the first engaged lane that runs on, but i; NOBODY if there is none."""
    for j in range(lanes.fitted):
        lane = lanes.health.lane[j]
        if j != i and is_engaged(lane) and responds(lane) and lane["joins"] == 0:
            return j
    return NOBODY


@inlined
def take_over(i, j, lanes):
    """Give computer i all that computer j has."""
    lanes.fcc[i] = lanes.fcc[j]
    copy(lanes.references, i, j)
    copy(lanes.manager, i, j)
    copy(lanes.boxes, i, j)
    copy(lanes.discretes, i, j)
    copy(lanes.control, i, j)
    copy(lanes.fdi, i, j)
    copy(lanes.kept, i, j)
    copy(lanes.gain, i, j)
    copy(lanes.memory, i, j)


@kernel
def copy(states, i, j):
    """Copy what computer j has of ``states``, (5, n) records, to computer i."""
    for n in range(states.shape[1]):
        states[i, n] = states[j, n]
