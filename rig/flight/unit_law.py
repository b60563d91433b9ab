"""A unit under test in the place of the control law: the rig votes, the unit answers the surfaces.

vote_own             as in a flight without a unit; or another manager, one of the user, or a second unit
ask_law              what has been voted, into the record of the unit; the unit, wherever it is
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
from rig.computer.lanes.think import ComputerData, vote
from rig.computer.redundancy import RedundancyData, conclude
from rig.computer.redundancy.own import OwnManager
from rig.core.frame import FLAT, SURFACES, Block, S, UnitStatus, nested, new_block
from rig.core.kernels import bind, kernel
from rig.flight.loop import ComputerStep, StageData, after, around_manager, before_votes, compute
from rig.flight.unit_exchange import Exchange, exchange_with
from rig.unit.compiled_exchange import PENDING, try_exchange
from rig.unit.port import BLANK, FLOWN, STARTING, fill, fill_law, fly_trim, take
from rig.unit.port import conclude as conclude_of_unit
from rig.unit.running_unit import UnitUnderTest
from rig.world.actuators.servo_stage import ActuatorData
from rig.world.faults import FaultData
from rig.world.sensors import SensorData
from rig.world.sensors.inertial import InertialData

_SURFACES, _NONE = len(SURFACES), UnitStatus.NONE.value


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


Vote = Callable[[Any, Any, int, AroundLaw], object]  # a frame up to its votes: block, raw, row, data


class Computer(NamedTuple):
    """A computer whose control law is a unit: the exchange, its data, and what takes over from a dead unit, if any."""

    exchange: Exchange
    around: Callable[[StageData], AroundLaw]
    ours: ComputerStep | None


def around_law(unit: UnitUnderTest, data: StageData, own: OwnManager | None) -> Computer:
    """Bind the frames of a flight whose control law is a unit.

    own : the user's manager, which votes if no unit does so beside the law
    """
    backup = unit.unit.on_dead == "backup"
    standby = nested(np.zeros(2, FLAT)) if backup else None

    def around(data: StageData) -> AroundLaw:
        stages = data.sensors, data.inertial, data.faults, data.redundancy, data.control, data.actuators
        return AroundLaw(*stages, None, standby)

    rows, stages = nested(new_block(2)), around(data)
    frame = rows, bytes_of(rows), 0, stages
    last = bind(after_law, *frame, unit.port.back, 0)
    if unit.voter is None and own is None:
        whole, ours = bind(with_law, *frame, unit.port, unit.compiled, 0), bind(compute, rows, 0, data)
        return Computer(exchange_with(unit, whole, last), around, ours if backup else None)
    ask = _by_class(own, rows, stages) if unit.voter is None else _by_unit(unit.voter, *frame)
    rest, fly = bind(ask_law, *frame, unit.port, unit.compiled, 0), bind(fly_own, rows, 0, stages)

    def voted(block: Any, raw: Any, k: int, stages: AroundLaw, *exchange: Any) -> int:
        ask(block, raw, k, stages)
        return rest(block, raw, k, stages, *exchange)

    def taken_over(block: Any, k: int, data: StageData) -> None:
        stages = around(data)
        ask(block, bytes_of(block), k, stages)
        fly(block, k, stages)

    return Computer(exchange_with(unit, voted, last), around, taken_over if backup else None)


def bytes_of(rows: Block) -> NDArray[np.uint8]:
    """Return ``rows`` (n,) as (n, bytes): the same memory."""
    return rows.view(np.uint8).reshape(len(rows), -1)


def _by_class(own: OwnManager | None, rows: Block, stages: AroundLaw) -> Vote:
    """Let the user's manager vote."""
    assert own is not None
    step = around_manager(rows, stages, own, conclude_votes)
    return lambda block, raw, k, stages: step(block, k, stages)


def _by_unit(voter: UnitUnderTest, rows: Block, raw: Any, k: int, stages: AroundLaw) -> Vote:
    """Let a second unit vote; when it is dead the built-in manager, if its file names the backup."""
    frame = rows, raw, k, stages
    whole = bind(ask_votes, *frame, voter.port, voter.compiled, 0)
    exchange = exchange_with(voter, whole, bind(take_votes, *frame, voter.port.back, 0))
    ours = bind(vote_own, rows, k, stages) if voter.unit.on_dead == "backup" else None

    def ask(block: Any, raw: Any, k: int, stages: AroundLaw) -> None:
        if ours is not None and voter.dead:
            ours(block, k, stages)
            status = int(UnitStatus.DEAD)
        else:
            status = exchange(block, raw, k, stages, int(block["frame"][k]))
        if status != UnitStatus.ANSWERED:  # the row has one status for both units: the worse one
            block["actuation"]["unit"][k] = status

    return ask


@kernel
def with_law(block, raw, k, data, port, compiled, until_ns):
    """Compute row k with a control law outside; as unit_loop.with_unit."""
    vote_own(block, k, data)
    return ask_law(block, raw, k, data, port, compiled, until_ns)


@kernel
def vote_own(block, k, data):
    """Fill row k up to the votes of the built-in manager."""
    before_votes(block, k, data)
    vote(block[k]["bus"], block[k]["fcc"], ComputerData(data.redundancy, data.control, data.faults))
    conclude_votes(block, k, data)


@kernel
def conclude_votes(block, k, data):
    """Process what a manager of the rig or of the user has voted in row k."""
    conclude(block[k]["bus"], block[k]["fcc"], data.redundancy)


@kernel
def ask_votes(block, raw, k, data, port, compiled, until_ns):
    """Fill row k up to the votes of a unit; PENDING as of unit_loop.with_unit."""
    before_votes(block, k, data)
    fill(raw, k, block[k]["frame"], port.out)
    status = try_exchange(port, compiled, until_ns) if until_ns != 0 else PENDING
    return take_votes(block, raw, k, data, port.back, status) if status != PENDING else PENDING


@kernel
def take_votes(block, raw, k, data, port, status):
    """Take the votes of a unit in row k; return what the frame came to, of frame.UnitStatus."""
    status = take(raw, k, port, status)
    conclude_of_unit(block[k]["bus"], block[k]["fcc"], port.records[FLOWN]["said"], data.redundancy)
    return status


@kernel
def ask_law(block, raw, k, data, port, compiled, until_ns):
    """Compute row k from its votes on."""
    fill_law(raw, k, block[k]["frame"], port.out)
    status = try_exchange(port, compiled, until_ns) if until_ns != 0 else PENDING
    return after_law(block, raw, k, data, port.back, status) if status != PENDING else PENDING


@kernel
def fly_own(block, k, data):
    """Let the built-in law fly row k, which has its votes."""
    control_law(block[k]["bus"], block[k]["fcc"], data.control)
    after(block, k, data)


@kernel
def after_law(block, raw, k, data, port, status):
    """Fill all that follows from the law's answer to row k; return what the frame came to, of frame.UnitStatus."""
    status = take(raw, k, port, status)
    row, answer = block[k], port.records[FLOWN]
    write_sources(row["fcc"])
    if port.counts[STARTING] > 0:
        fly_trim(row["fcc"], port.records[BLANK]["surface"])
    stand_by(row, data.control, data.standby)
    if row["actuation"]["unit"] == _NONE:  # the voter beside the law has none worse
        row["actuation"]["unit"] = status
    row["actuation"]["unit_age"] = row["frame"] - answer["frame"]
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
