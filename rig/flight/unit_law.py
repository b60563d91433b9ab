"""A unit under test in the place of the control law: the rig votes, the unit answers the surfaces.

before_votes, vote   as in a flight without a unit: any manager, also one of the user
give_votes           what the manager has voted, into the record of the unit
try_exchange         the unit, wherever it is
after_law            its surfaces into the row, and on to the actuators

If the unit file names the backup, the built-in law stands by: it reads every frame, and keeps its integrators at the
surfaces that the unit commands, so that it can take over without a step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.control.law import control_law
from rig.computer.control.law_state import ControlData
from rig.computer.control.source import source_of
from rig.computer.redundancy import RedundancyData, conclude, vote_signals
from rig.computer.redundancy.own import OwnManager
from rig.core.frame import FLAT, SURFACES, S, nested, new_block
from rig.core.kernels import bind, kernel
from rig.flight.loop import StageData, after, before_votes
from rig.unit.compiled_exchange import PENDING, try_exchange
from rig.unit.port import BLANK, FLOWN, STARTING, fill_law, fly_trim, take
from rig.world.actuators.servo_stage import ActuatorData
from rig.world.faults import FaultData
from rig.world.sensors import SensorData
from rig.world.sensors.inertial import InertialData

_SURFACES = len(SURFACES)


class AroundLaw(NamedTuple):
    """Data of the stages around a control law."""

    sensors: SensorData
    inertial: InertialData
    faults: FaultData
    redundancy: RedundancyData
    control: ControlData
    actuators: ActuatorData | None
    lanes: None  # a unit flies alone
    standby: NDArray[Any] | None  # (2,) FRAME, workspace of the built-in law; None if it does not stand by


class LawStretches(NamedTuple):
    """The two calls of a frame: the whole of it, or PENDING; and its end, after an answer from Python."""

    whole: Callable[..., int]
    last: Callable[..., int]
    around: Callable[[StageData], AroundLaw]


def stretches(own: OwnManager | None, data: StageData, port: Any, compiled: Any, backup: bool) -> LawStretches:
    """Bind the calls of a flight whose control law is a unit; own : the user's manager, which then votes.

    backup : the built-in law stands by
    """
    standby = nested(np.zeros(2, FLAT)) if backup else None

    def around(data: StageData) -> AroundLaw:
        return AroundLaw(
            data.sensors,
            data.inertial,
            data.faults,
            data.redundancy,
            data.control,
            data.actuators,
            None,
            standby,
        )

    rows, stages = nested(new_block(2)), around(data)
    frame = rows, rows.view(np.uint8).reshape(2, -1), 0, stages
    last = bind(after_law, *frame, port.back, 0)
    if own is None:
        return LawStretches(bind(with_law, *frame, port, compiled, 0), last, around)
    first, rest = bind(before_votes, rows, 0, stages), bind(give_votes, *frame, port, compiled, 0)

    def whole(block: Any, raw: Any, k: int, stages: AroundLaw, *exchange: Any) -> int:
        first(block, k, stages)
        own.step(block, block["bus"], block["fcc"], k)
        return rest(block, raw, k, stages, *exchange)

    return LawStretches(whole, last, around)


@kernel
def with_law(block, raw, k, data, port, compiled, until_ns):
    """Compute row k with a control law outside; as unit_loop.with_unit."""
    before_votes(block, k, data)
    row = block[k]
    vote_signals(row["bus"], row["fcc"], data.redundancy.manager)
    return give_votes(block, raw, k, data, port, compiled, until_ns)


@kernel
def give_votes(block, raw, k, data, port, compiled, until_ns):
    """Compute row k from its votes on."""
    row = block[k]
    conclude(row["bus"], row["fcc"], data.redundancy)
    fill_law(raw, k, row["frame"], port.out)
    status = try_exchange(port, compiled, until_ns) if until_ns != 0 else PENDING
    return after_law(block, raw, k, data, port.back, status) if status != PENDING else PENDING


@kernel
def after_law(block, raw, k, data, port, status):
    """Fill all that follows from the law's answer to row k; return what the frame came to, of frame.UnitStatus."""
    status = take(raw, k, port, status)
    row, answer = block[k], port.records[FLOWN]
    write_sources(row["fcc"])
    if port.counts[STARTING] > 0:
        fly_trim(row["fcc"], port.records[BLANK]["surface"])
    stand_by(row, data.control, data.standby)
    row["actuation"]["unit"], row["actuation"]["unit_age"] = status, row["frame"] - answer["frame"]
    after(block, k, data)
    return status


@kernel
def write_sources(fcc):
    """Write the source of each signal that the manager's output leaves to a control law."""
    for s in range(S):
        fcc["source"][s] = source_of(fcc["level"][s], fcc["reference_usable"][s], fcc["reference"][s])


@kernel
def stand_by(row, control, standby):
    """Let the built-in law read the row, and move its integrators to the surfaces that are flown.

    standby : (2,) FRAME, workspace; None if it does not stand by
    """
    if standby is None:
        return
    own, state, flown = standby[0], control.state[0], row["fcc"]["surface"]
    own["bus"], own["fcc"] = row["bus"], row["fcc"]
    control_law(own["bus"], own["fcc"], control)
    surface = state["surface"]
    state["elevator_integral"] += flown[0] - surface[0]
    state["aileron_integral"] += flown[1] - surface[1]
    state["rudder_integral"] += flown[2] - surface[2]
    state["throttle_integral"] += flown[3] - surface[3]
    for i in range(_SURFACES):
        surface[i] = flown[i]
