"""Lanes that have had the same samples since the flight began: the first of them thinks and votes for all.

The same samples, state and kernels give the same bits, so that one result is copied.  A message that is late, damaged
or missing parts them, and so does a lane of them that stops or is no longer engaged: then each gets the state that all
had after the last frame, and thinks by itself to the end of the flight.
"""

from __future__ import annotations

from typing import Final

from rig.computer.lanes.health import NO_LANE, is_engaged
from rig.core.frame import COMPUTERS, SURFACES
from rig.core.kernels import inlined, kernel

_LANES: Final = len(COMPUTERS)
_SURFACES: Final = len(SURFACES)


@kernel
def first_alike(lanes):
    """Return the first of the lanes that are alike, which holds their state; ``NO_LANE`` if there are none."""
    for i in range(lanes.fitted):
        if lanes.alike[i] != 0:
            return i
    return NO_LANE


@kernel
def follows(i, lanes):
    """Return True if another lane thinks and votes for lane i."""
    return lanes.alike[i] != 0 and i != first_alike(lanes)


@kernel
def holder(i, lanes):
    """Return the computer that holds the state of computer i, a lane or the back-up."""
    return first_alike(lanes) if i < _LANES and lanes.alike[i] != 0 else i


@inlined
def stay_alike(shared, lanes):
    """Part the lanes unless all that are alike run, are engaged, and have the same samples: ``shared``."""
    together = shared
    for i in range(lanes.fitted):
        if lanes.alike[i] != 0:
            together &= lanes.running[i] != 0 and is_engaged(lanes.health.lane[i])
    if not together:
        part(lanes)


@inlined
def part(lanes):
    """Give each lane that is alike a copy of the state."""
    first = first_alike(lanes)
    for i in range(lanes.fitted):
        if follows(i, lanes):
            copy_state(i, first, lanes)
    for i in range(lanes.fitted):
        lanes.alike[i] = 0


@kernel
def follow_thought(i, lanes):
    """Give lane i what the first lane that is alike has thought in this frame."""
    first, integral = first_alike(lanes), lanes.commands.integral
    lanes.fcc[i] = lanes.fcc[first]
    for q in range(integral.shape[1]):
        integral[i, q] = integral[first, q]


@kernel
def follow_vote(i, lanes):
    """Give lane i what the first lane that is alike has voted of the commands in this frame."""
    first, commands = first_alike(lanes), lanes.commands
    for j in range(_LANES):
        commands.differs[i, j] = commands.differs[first, j]
    for s in range(_SURFACES):
        commands.state[i, s] = commands.state[first, s]
        commands.decided_by[i, s] = commands.decided_by[first, s]
        if commands.settings[0]["own"] == 0:
            commands.meant[i, s] = commands.state[i, s]["output"]


@inlined
def copy_state(i, j, lanes):
    """Give computer i the state of all stages of computer j."""
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
