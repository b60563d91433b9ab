"""A unit under test as one of several computers: it votes, computes or flies in its lane; the others are the rig's.

begin_lanes    all share their samples and think; of the unit's lane the references, and all that it reads
exchange       the unit, wherever it is
end_lanes      its answer into its lane; the commands of all, their votes and tests; the leading lane's is the row

It reads what its lane has: its own channel, and the others' as they came over the link.  Without an answer its lane
tells no command in this frame, and the watchdog of the lane counts.  While a fault stops its lane it gets no frames.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from rig.computer.control.law import control_law
from rig.computer.lanes.command import keep_integrals
from rig.computer.lanes.lanes_stage import of_lane, think_after, think_before
from rig.computer.lanes.think import ComputerData, think_shadow, vote
from rig.computer.redundancy import conclude as conclude_own
from rig.core.frame import FLAT, Nested, UnitStatus, nested, new_block
from rig.core.kernels import bind, kernel
from rig.flight.loop import ComputerStep, StageData, after, before
from rig.flight.unit_law import write_sources
from rig.unit.port import BLANK, FLOWN, ON_DISCRETES, STARTING, conclude, fill, fill_law, fly_trim, take
from rig.unit.running_unit import UnitUnderTest
from rig.unit.unit_records import Role

_REDUNDANCY, _CONTROL_LAW = int(Role.REDUNDANCY), int(Role.CONTROL_LAW)
_NOT_ASKED: Final = int(UnitStatus.NONE)
_STOPPED: Final = -1


def around_lane(unit: UnitUnderTest, data: StageData) -> ComputerStep:
    """Do what ``loop.compute`` does, with the unit as the computer of the lane outside."""
    assert data.lanes is not None  # stages.computers has refused a lane that is not there
    data.lanes.commands.tells_integrals[data.lanes.outside] = unit.role is Role.REDUNDANCY
    port, own = unit.port, np.zeros(2, FLAT)  # rows of its own, as one computer has them
    raw, lane = own.view(np.uint8).reshape(2, -1), nested(own)
    blank = nested(new_block(2))
    role = port.back.role
    first: Callable[..., Any] = bind(begin_lanes, blank, 0, data, lane, raw, port.out, role)
    last: Callable[..., int] = bind(end_lanes, blank, 0, data, lane, raw, port.back, 0)

    def step(block: Nested, k: int, data: StageData) -> float:
        frame = first(block, k, data, lane, raw, port.out, role)
        if frame == _STOPPED:
            last(block, k, data, lane, raw, port.back, _NOT_ASKED)
            return 0.0
        unit.count_status(last(block, k, data, lane, raw, port.back, unit.exchange(frame, k)))
        return unit.reply_us

    return step


@kernel
def begin_lanes(block, k, data, own, raw, port, role):
    """Fill the record that the unit reads in row k; return the frame, or _STOPPED while its lane does not run.

    own : (2,) FRAME records, of the unit's lane alone; raw : (2, bytes) the same;  port : Outbound;  role : of Role
    """
    before(block, k, data)
    row, lanes = block[k], data.lanes
    think_before(row, k, ComputerData(data.redundancy, data.control, data.faults), lanes)
    if lanes.running[lanes.outside] == 0:
        return _STOPPED
    own[0]["frame"] = row["frame"]
    own[0]["bus"], own[0]["fcc"] = lanes.bus[lanes.outside], lanes.fcc[lanes.outside]
    if role == _CONTROL_LAW:
        computer = of_lane(lanes.outside, ComputerData(data.redundancy, data.control, data.faults), lanes)
        vote(own[0]["bus"], own[0]["fcc"], computer)
        conclude_own(own[0]["bus"], own[0]["fcc"], computer.redundancy)
        fill_law(raw, 0, row["frame"], port)
    else:
        fill(raw, 0, row["frame"], port)
    return row["frame"]


@kernel
def end_lanes(block, k, data, own, raw, port, status):
    """Fill all that follows from the unit's answer in row k; return what the frame came to, of frame.UnitStatus."""
    status = take(raw, 0, port, status)
    row, lanes, computer = block[k], data.lanes, ComputerData(data.redundancy, data.control, data.faults)
    take_in(computer, lanes, own, port, status)
    think_after(row, k, computer, lanes)
    age = row["frame"] - port.records[FLOWN]["frame"]
    row["actuation"]["unit"], row["actuation"]["unit_age"] = status, age
    after(block, k, data)
    return status


@kernel
def take_in(data, lanes, own, port, status):
    """Write the unit's answer, in ``own[0]``, into its lane; a lane without one tells no command."""
    i, answered = lanes.outside, status == UnitStatus.ANSWERED or status == UnitStatus.RESTARTED
    lanes.health.lane[i]["silent"] = lanes.running[i] != 0 and not answered
    if lanes.running[i] == 0:
        return
    computer, bus, fcc, said = of_lane(i, data, lanes), own[0]["bus"], own[0]["fcc"], port.records[FLOWN]["said"]
    if port.role == _CONTROL_LAW:
        own[1]["bus"], own[1]["fcc"] = bus, fcc
        control_law(own[1]["bus"], own[1]["fcc"], computer.control)  # for the back-up, as think_shadow
        write_sources(fcc)
    else:
        own[1]["bus"], own[1]["fcc"] = bus, lanes.fcc[i]
        think_shadow(own[1], (said & ON_DISCRETES) != 0, port.role != _REDUNDANCY, computer)
        conclude(bus, fcc, said, computer.redundancy)
    if port.counts[STARTING] > 0:
        fly_trim(fcc, port.records[BLANK]["surface"])
    elif port.role == _REDUNDANCY:
        control_law(bus, fcc, computer.control)
        keep_integrals(i, lanes.control[i, 0], lanes.commands)
    lanes.fcc[i] = fcc
    lanes.running[i] = answered
