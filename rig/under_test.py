"""A unit under test in the loop: in the place of the manager, or of manager and control law.

before_unit   channels and references, and all that the unit reads into its record
exchange      the unit, wherever it is
after_unit    its answer into the row; what it has not said is the rig's: discretes, control law
"""

from __future__ import annotations

import numpy as np

from rig.computer.analytic.references import remember
from rig.computer.control.law import fly
from rig.computer.external.layout import Form
from rig.computer.external.port import ON_DISCRETES, fill, take
from rig.computer.external.session import configuration
from rig.computer.external.unit import UnitUnderTest
from rig.computer.redundancy.discrete import vote_discretes
from rig.faults import actuate
from rig.frame import Nested, Unit, nested, new_block
from rig.interrupt import Stop
from rig.kernels import bind, kernel
from rig.loop import Rig, StageData, before, compute, hand_over
from rig.record.pace import Pace
from rig.scenario import Scenario


def put(unit: UnitUnderTest, rig: Rig, scenario: Scenario, pace: Pace, stop: Stop) -> None:
    """Begin a flight of ``unit`` in ``rig``, which is at its first frame.  BadInput: it will not fly it."""
    redundancy, frame = rig.redundancy, scenario.airframe
    config = configuration(
        scenario.rate_hz,
        unit.form,
        redundancy.manager.data.params,
        redundancy.discretes.params,
        redundancy.manager.data.boxes,
        rig.plant.trim,
        np.array(frame.surface_limits),
        (scenario.aircraft, frame.point(scenario.flight_point).name),
    )
    unit.begin(config, None if pace.period_s is None else pace.due, stop)
    rig.unit, rig.compute = unit, _around(unit, rig.data)


def _around(unit: UnitUnderTest, data: StageData):
    """What ``loop.compute`` does, with the unit in the place of our own; ours once it is to take over."""
    port, rows = unit.port, nested(new_block(2))
    raw = _bytes(rows)
    first, last = bind(before_unit, rows, raw, 0, data, port), bind(after_unit, rows, raw, 0, data, port, 0)
    ours = bind(compute, rows, 0, data) if unit.unit.on_dead == "backup" else None
    seen, start = rows, 0

    def step(block: Nested, k: int, data: StageData) -> None:
        nonlocal seen, raw, start
        if block is not seen:  # a view is slow to make
            seen, raw, start = block, _bytes(block), int(block["frame"][0])
        if ours is not None and unit.dead:
            ours(block, k, data)
            block["actuation"]["unit"][k] = Unit.DEAD
            return
        first(block, raw, k, data, port)
        status = unit.exchange(start + k, k)
        unit.taken(last(block, raw, k, data, port, status))

    return step


def _bytes(rows: Nested) -> np.ndarray:
    return rows.view(np.uint8).reshape(len(rows), -1)


@kernel
def before_unit(block, raw, k, data, port):
    """All that a unit reads of row k, and its record filled from it; raw : (n, bytes) the same rows."""
    before(block, k, data)
    fill(raw, k, block[k]["frame"], port)


@kernel
def after_unit(block, raw, k, data, port, status):
    """All that follows from a unit's answer to row k; returns what the frame came to, of frame.Unit."""
    status = take(raw, k, port, status)
    row, answer = block[k], port.slots[0]
    bus, fcc = row["bus"], row["fcc"]
    remember(bus, fcc, data.redundancy.references)
    if answer["said"] & ON_DISCRETES == 0:
        vote_discretes(bus, fcc, data.redundancy.discretes)
    if port.form == _REDUNDANCY:
        fly(bus, fcc, data.control)
    hand_over(fcc["surface"], row["actuation"]["actuator"])
    row["actuation"]["unit"], row["actuation"]["unit_age"] = status, row["frame"] - answer["frame"]
    actuate(row, data.faults)
    return status


_REDUNDANCY = int(Form.REDUNDANCY)
