"""A unit under test in the loop: in the place of the manager, of manager and control law, or of the law (unit_law.py).

before_unit      channels and references, and all that the unit reads into its record
try_exchange     the unit, wherever it is
after_unit       its answer into the row; what it has not filled is the rig's: discretes, control law

One compiled call has all three; where the answer is not a usual one (unit/compiled_exchange.py) it ends early, and
Python continues with ``exchange`` and ``after_unit``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.analytic.references import ReferenceData
from rig.computer.control.law import control_law
from rig.computer.control.law_state import ControlData
from rig.computer.redundancy import Redundancy
from rig.computer.redundancy.discrete import DiscreteData
from rig.computer.redundancy.manager_config import PARAMS
from rig.computer.redundancy.own import OwnManager
from rig.core.blocks import in_blocks
from rig.core.frame import FLIGHT_INDEX, SURFACES, Block, Nested, Table, UnitStatus, nested, new_block
from rig.core.interrupt import Stop
from rig.core.kernels import bind, kernel
from rig.flight import loop
from rig.flight.loop import ComputerStep, Rig, StageData, after, before_votes, compute
from rig.flight.pace import Pace
from rig.flight.unit_exchange import Exchange, exchange_with
from rig.flight.unit_lane import around_lane
from rig.flight.unit_law import around_law, bytes_of
from rig.scenario.scenario import Scenario
from rig.unit.compiled_exchange import PENDING, try_exchange
from rig.unit.port import BLANK, FLOWN, STARTING, conclude, fill, fill_law, fly_trim, take
from rig.unit.running_unit import UnitUnderTest
from rig.unit.session import configuration
from rig.unit.unit_records import Role
from rig.world.actuators.servo_stage import ActuatorData
from rig.world.faults import FaultData
from rig.world.sensors import SensorData
from rig.world.sensors.inertial import InertialData


class UnitComputer:
    """A binder for Rig: its computer, or one of several, is ``unit``, whose session begins with the flight."""

    def __init__(self, unit: UnitUnderTest, pace: Pace | None = None, stop: Stop | None = None) -> None:
        self.lane = unit.lane
        self._unit, self._stop = unit, stop
        self._deadline = None if pace is None or pace.period_s is None else pace.due

    def __call__(self, rig: Rig) -> ComputerStep:
        """Begin the session, with all kernels compiled: the first frame follows at once.  BadInput, UnitRefused."""
        units = [each for each in (self._unit, self._unit.voter) if each is not None]
        sessions = [(each, config_of(rig.scenario, rig.redundancy, rig.plant.trim, each.role)) for each in units]
        fresh = [each.prepare(config) for each, config in sessions]
        if all(fresh):
            self._around(rig)
        for each, config in sessions:
            each.begin(config, self._deadline, self._stop)
        return self._around(rig)

    def _around(self, rig: Rig) -> ComputerStep:
        unit = self._unit
        if self.lane is not None:
            return around_lane(unit, rig.data)
        if unit.role is Role.CONTROL_LAW:
            return _around_law(unit, rig.data, rig.redundancy.own)
        return _around_unit(unit, rig.data)


def fly_rows(
    scenario: Scenario,
    frames_at_most: int | None = None,
    unit: UnitUnderTest | None = None,
    beside: list[Block] | None = None,
) -> Block:
    """Return all rows of a flight in memory, no more than ``frames_at_most``, of a unit or of the built-in computer.

    beside : its second rows are added to it, block by block
    """
    if unit is None:
        return loop.fly_rows(scenario, frames_at_most, beside=beside)
    rows = loop.fly_rows(scenario, frames_at_most, UnitComputer(unit), beside)
    unit.end()
    return rows


def fly_blocks(scenario: Scenario, frames_at_most: int, unit: UnitUnderTest | None = None) -> Iterator[Table]:
    """Fly as ``fly_rows`` does, and yield the frames in blocks of core.blocks.ROWS: memory for these alone."""
    yield from (Table(*arrays) for arrays in in_blocks(_flown(scenario, frames_at_most, unit)))
    if unit is not None:
        unit.end()


def _flown(scenario: Scenario, left: int, unit: UnitUnderTest | None) -> Iterator[tuple[Any, ...]]:
    """Yield the blocks of a flight as the loop flies them, ``left`` frames at most."""
    rig = Rig(scenario, None if unit is None else UnitComputer(unit))
    for rows, _ in loop.frames(rig, scenario):
        yield rig.table(rows)[:left].arrays()
        left -= len(rows)
        if left <= 0:
            return


def config_of(scenario: Scenario, redundancy: Redundancy, trim: NDArray[np.float64], role: Role) -> NDArray[Any]:
    """Return the (1,) CONFIG of a scenario.

    trim : (4,) surfaces of its first frame
    """
    frame = scenario.airframe
    return configuration(
        scenario.rate_hz,
        role,
        redundancy.manager.data.params[list(PARAMS.names or ())],  # without what a baseline manager is told
        redundancy.discretes.params,
        redundancy.manager.data.boxes,
        trim,
        np.array(frame.surface_limits),
        (scenario.aircraft, frame.point(scenario.flight_point).name),
    )


class UnitVoter:
    """A unit over recorded rows, in open loop."""

    def __init__(self, unit: UnitUnderTest, scenario: Scenario, redundancy: Redundancy, rows: Block) -> None:
        """Begin a session; rows : from the first frame on.  BadInput: the unit will not."""
        trim = rows["flight"][0, [FLIGHT_INDEX[name] for name in SURFACES]]
        unit.begin(config_of(scenario, redundancy, trim, unit.role))
        self._unit, self._rows, self._raw = unit, rows, bytes_of(rows)
        self._fill = fill_law if unit.role is Role.CONTROL_LAW else fill

    def step(self, rows: Block, k: int) -> int:
        """Write the unit's reply to row k of ``rows`` into it; return the groups of the layout that it filled."""
        if rows is not self._rows:
            self._rows, self._raw = rows, bytes_of(rows)
        port, frame = self._unit.port, int(rows["frame"][k])
        self._fill(self._raw, k, frame, port.out)
        self._unit.count_status(take(self._raw, k, port.back, self._unit.exchange(frame, k)))
        return int(port.back.records[FLOWN]["said"])


class _Redundancy(NamedTuple):
    """Of the redundancy stage, what is not the unit's."""

    references: ReferenceData
    discretes: DiscreteData


class _AroundUnit(NamedTuple):
    """Data of the stages around a unit: each array costs the call some nanoseconds."""

    sensors: SensorData
    inertial: InertialData
    faults: FaultData
    redundancy: _Redundancy
    control: ControlData
    actuators: ActuatorData | None
    lanes: None  # a unit flies alone


def _without_manager(data: StageData) -> _AroundUnit:
    redundancy = _Redundancy(data.redundancy.references, data.redundancy.discretes)
    return _AroundUnit(data.sensors, data.inertial, data.faults, redundancy, data.control, data.actuators, None)


def _around_unit(unit: UnitUnderTest, data: StageData) -> ComputerStep:
    """Do what ``loop.compute`` does, with the unit in the place of our own; ours once it is to take over."""
    frame = nested(new_block(2)), bytes_of(new_block(2)), 0, _without_manager(data)
    whole = bind(with_unit, *frame, unit.port, unit.compiled, 0)
    last = bind(after_unit, *frame, unit.port.back, 0)
    ours = bind(compute, frame[0], 0, data) if unit.unit.on_dead == "backup" else None
    return _exchanging(unit, data, _without_manager, exchange_with(unit, whole, last), ours)


def _around_law(unit: UnitUnderTest, data: StageData, own: OwnManager | None) -> ComputerStep:
    """Do the same with the unit in the place of our control law; own : the user's manager."""
    exchange, around, ours = around_law(unit, data, own)
    return _exchanging(unit, data, around, exchange, ours)


def _exchanging(
    unit: UnitUnderTest,
    data: StageData,
    arrange: Callable[[StageData], Any],
    exchange: Exchange,
    ours: ComputerStep | None,
) -> ComputerStep:
    """Compute every frame by an exchange with the unit, or by ``ours`` once it is to take over.

    arrange : from StageData to the data of the exchange
    """
    bound, around, raw, start = nested(new_block(2)), arrange(data), bytes_of(new_block(2)), 0
    bound_data = data

    def step(block: Nested, k: int, data: StageData) -> float:
        nonlocal bound, raw, start, bound_data, around
        if block is not bound:  # a view is slow to make
            bound, raw, start = block, bytes_of(block), int(block["frame"][0])
        if data is not bound_data:
            bound_data, around = data, arrange(data)
        if ours is not None and unit.dead:
            ours(block, k, data)
            block["actuation"]["unit"][k] = UnitStatus.DEAD
        else:
            exchange(block, raw, k, around, start + k)
        return unit.reply_us

    return step


@kernel
def before_unit(block, raw, k, data, port):
    """Fill all that a unit reads of row k, and its record from it; raw : (n, bytes) the same rows."""
    before_votes(block, k, data)
    fill(raw, k, block[k]["frame"], port)


@kernel
def with_unit(block, raw, k, data, port, compiled, until_ns):
    """Compute row k with a unit; PENDING when the answer, and so what follows from it, is left to Python.

    until_ns : of try_exchange; 0 when the frame before had no answer, and Python is to look at this one from its begin
    """
    before_unit(block, raw, k, data, port.out)
    status = try_exchange(port, compiled, until_ns) if until_ns != 0 else PENDING
    return after_unit(block, raw, k, data, port.back, status) if status != PENDING else PENDING


@kernel
def after_unit(block, raw, k, data, port, status):
    """Fill all that follows from a unit's answer to row k; return what the frame came to, of frame.UnitStatus."""
    status = take(raw, k, port, status)
    row, answer = block[k], port.records[FLOWN]
    bus, fcc = row["bus"], row["fcc"]
    conclude(bus, fcc, answer["said"], data.redundancy)
    if port.counts[STARTING] > 0:
        fly_trim(fcc, port.records[BLANK]["surface"])
    elif port.role == _REDUNDANCY:
        control_law(bus, fcc, data.control)
    row["actuation"]["unit"], row["actuation"]["unit_age"] = status, row["frame"] - answer["frame"]
    after(block, k, data)
    return status


_REDUNDANCY = int(Role.REDUNDANCY)
