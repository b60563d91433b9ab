"""One flight: build the stages with a flight computer, run the frames, hand every block of them to the recorders.

plant --truth--> sensors --bus--> faults --bus--> computer --fcc--> faults --actuation--> plant (next frame)

Between two looks at the plant a frame has three stretches, each written once:

    before   sensors, inertial unit, faults on both
    think    the computers: references with their faults, votes, discretes, control law (lanes/think.py)
    after    surfaces to the actuators, faults on the way

Within ``think`` a user's class replaces the manager; a unit under test (unit_loop.py) replaces it, or it and the law.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rig.computer.control.autopilot import Control
from rig.computer.control.law_state import ControlData
from rig.computer.lanes.lanes_stage import LaneData, orders, sample, think_all
from rig.computer.lanes.think import ComputerData, follow_votes, give_references
from rig.computer.redundancy import RedundancyData
from rig.computer.redundancy.own import OwnManager
from rig.computer.redundancy.resets import command
from rig.core.confined import require_short
from rig.core.errors import ManagerFailed
from rig.core.frame import FLAT, TIMING, Block, Nested, Table, nested, new_block, second_rows
from rig.core.held import Held, data_of
from rig.core.interrupt import Stop
from rig.core.kernels import bind, inlined, kernel
from rig.flight.block_length import Use, block_frames
from rig.flight.put_out import put_out
from rig.flight.stages import UNIT, computers, faults, redundancy, servos
from rig.scenario.scenario import Scenario
from rig.world.actuators.servo_stage import ActuatorData
from rig.world.faults import FaultData, corrupt
from rig.world.plant.jsbsim import plant
from rig.world.plant.pilot import Pilot
from rig.world.sensors import SensorData, Sensors, measure
from rig.world.sensors.inertial import Inertial, InertialData, sense


class StageData(NamedTuple):
    """Data that the stages need besides the row."""

    sensors: SensorData
    inertial: InertialData
    faults: FaultData
    redundancy: RedundancyData
    control: ControlData
    actuators: ActuatorData | None  # None: the plant's own lag moves the surfaces
    lanes: LaneData | None  # None: one computer


# Fly row k of a block from its truth to its actuators; return how long an answer from outside took, us.
ComputerStep = Callable[[Nested, int, StageData], float | None]
RowsAndTiming = tuple[Block, NDArray[np.void]]


class Rig:
    """The stages of one flight, wired up and at their first frame."""

    def __init__(
        self, scenario: Scenario, computer: Callable[[Rig], ComputerStep] | None = None, *, keep_clean: int = 0
    ) -> None:
        """BadInput when the aircraft cannot be loaded or trimmed, or the computer will not fly.

        computer : binds a flight computer to the stages; the rig's own without it; with a ``lane`` it is one of several
        keep_clean : frames of ``faults.clean``
        """
        require_short(scenario.frames)
        rate_hz, suite, frame = scenario.rate_hz, scenario.sensors, scenario.airframe
        self.scenario, seeds = scenario, scenario.streams()
        self.pilot = Pilot(scenario.pilot, rate_hz)
        point, seed = frame.point(scenario.flight_point), int(seeds["plant"].generate_state(1)[0]) & 0x7FFFFFFF
        steps, servo = scenario.steps_per_frame, scenario.actuators.model == "servo"
        self.plant = plant(frame, point, scenario.wind, scenario.turbulence, rate_hz, steps, seed, servo)
        self.sensors = Sensors(suite, rate_hz, seeds["sensors"])
        self.inertial = Inertial(scenario.inertial, rate_hz, seeds["inertial"])
        self.faults = faults(scenario, keep_clean)
        self.redundancy = redundancy(scenario)
        self.control = Control(scenario.control, scenario.gains, rate_hz, frame.surface_limits)
        self.control.reset(self.plant.trim)
        self.actuators = servos(scenario, self.plant)
        alone = ComputerData(self.redundancy.data, self.control.data, self.faults.data)
        own = UNIT if computer is not None else self.redundancy.own
        self.computers = computers(scenario, alone, self.sensors, own, getattr(computer, "lane", None))
        self._beside: Block | None = None  # of the present block
        self.data = self._gather()
        self.computer_step = bind_computer(self.data, self.redundancy.own) if computer is None else computer(self)

    def prepare(self, block: Block) -> None:
        """Draw and plan what is made a block at a time: stick, autopilot commands and commands, noise, chance."""
        self.pilot.prepare(block)
        command(block, self.scenario.redundancy.resets, self.scenario.rate_hz)
        self.sensors.prepare(block)
        self.inertial.prepare(block)
        self.faults.prepare(block)
        if parts := self.scenario.row_parts:
            self._beside = second_rows(len(block), parts, int(block["frame"][0]))
            for part, stage in (("servo", self.actuators), ("computer", self.computers)):
                if stage is not None:
                    stage.prepare(self._beside[part])
        self.data = self._gather()

    def table(self, rows: Block, timing: NDArray[Any] | None = None) -> Table:
        """Return ``rows`` of the block that was flown last as a table."""
        return Table(rows, *(self.beside(len(rows)) or (None,)), timing)

    def beside(self, count: int) -> tuple[Block] | tuple[()]:
        """Return the first ``count`` second rows of the block that was flown last; () without any."""
        return () if self._beside is None else (self._beside[:count],)

    def _gather(self) -> StageData:
        """Return the parameters and states of the stages."""
        return StageData(
            sensors=self.sensors.data,
            inertial=self.inertial.data,
            faults=self.faults.data,
            redundancy=self.redundancy.data,
            control=self.control.data,
            actuators=None if self.actuators is None else self.actuators.data,
            lanes=None if self.computers is None else self.computers.data,
        )


def bind_computer(data: StageData, own: OwnManager | None) -> ComputerStep:
    """Bind the flight computer to what its stages keep: one compiled call, or two around the user's manager."""
    rows = nested(new_block(2))
    return Held(compute_held, rows, 0, data) if own is None else around_manager(rows, data, own, after_votes)


def around_manager(rows: Nested, data: Any, own: OwnManager, last: Callable[..., None]) -> Callable[..., None]:
    """Do what ``compute`` does up to the votes, which are of the user's manager, and then ``last``."""
    first, last = bind(before_votes, rows, 0, data), bind(last, rows, 0, data)
    bound, bus, fcc = rows, rows["bus"], rows["fcc"]

    def step(block: Nested, k: int, data: StageData) -> None:
        nonlocal bound, bus, fcc
        if block is not bound:  # a part of a structured array is slow to look up
            bound, bus, fcc = block, block["bus"], block["fcc"]
        first(block, k, data)
        own.step(block, bus, fcc, k)
        last(block, k, data)

    return step


@kernel
def compute(block, k, data):
    """Compute row k of ``block``, FRAME records, from its truth to its actuators; data : StageData."""
    before(block, k, data)
    think(block, k, data)
    after(block, k, data)


@kernel
def compute_held(block, k, held):
    """Do what ``compute`` does, with the data that is held."""
    compute(block, k, data_of(held))


@kernel
def before(block, k, data):
    """Fill all that the computer reads of row k, with its faults."""
    row = block[k]
    truth, bus = row["truth"], row["bus"]
    sample(data.sensors.params, data.lanes)
    measure(truth, bus, k, data.sensors)
    sense(truth, bus, k, data.inertial)
    corrupt(row, k, data.faults)


@inlined
def think(block, k, data):
    """Fill all that the computer writes of row k."""
    think_all(block[k], k, ComputerData(data.redundancy, data.control, data.faults), data.lanes)


@kernel
def after(block, k, data):
    """Pass the surfaces of row k on to the actuators."""
    put_out(block[k], k, data.control.param[0]["still"], data.faults, data.actuators, orders(data.lanes))


@kernel
def before_votes(block, k, data):
    """Fill the inputs of a manager in row k: channels and references, with their faults."""
    before(block, k, data)
    row = block[k]
    give_references(row, row["bus"], row["fcc"], k, data.redundancy.references, data.faults)


@kernel
def after_votes(block, k, data):
    """Fill all that follows from the votes of row k: discretes, surfaces, actuators."""
    row = block[k]
    follow_votes(row["bus"], row["fcc"], ComputerData(data.redundancy, data.control, data.faults))
    after(block, k, data)


class Pacing(Protocol):
    """Real time (flight/pace.py): ``period_s`` of a frame, None when frames are flown as fast as can be."""

    period_s: float | None

    def wait(self, frame: int) -> float:
        """Sleep until ``frame`` is due; return how late it begins, s."""
        ...


class Recorder(Protocol):
    """A receiver of rows: log, stream, summary."""

    def record(self, table: Table) -> None:
        """Take the next frames with their timing, which stay as they are until the next call has returned."""
        ...


BeforeRow = Callable[[Rig, Nested, int], None]  # acts on stages and row k before it is flown (flight/operator_keys.py)


def fly(
    rig: Rig,
    recorders: Sequence[Recorder] = (),
    *,
    pace: Pacing | None = None,
    stop: Stop | None = None,
    before_row: BeforeRow | None = None,
    memory: RowsAndTiming | None = None,
    use: Use | None = None,
) -> None:
    """Fly to the end of the flight; each recorder takes every block in turn.  The rest as for ``frames``."""
    for rows, timing in frames(rig, rig.scenario, pace, stop, memory, before_row, use):
        table = rig.table(rows, timing)
        for recorder in recorders:
            recorder.record(table)


def frames(
    rig: Rig,
    scenario: Scenario,
    pace: Pacing | None = None,
    stop: Stop | None = None,
    memory: RowsAndTiming | None = None,
    before_row: BeforeRow | None = None,
    use: Use | None = None,
) -> Iterator[RowsAndTiming]:
    """Fly; yields rows and their TIMING, a block at a time.  ManagerFailed: after the rows before it.

    memory : (n,) of both, to fly into, no more than n frames; without it two blocks take turns, and what is yielded
    stays as it is until the block after the next starts.
    use : decides the length of a block; if not given, pace and memory do
    """
    stop, pace = stop or Stop(), None if pace is None or pace.period_s is None else pace
    use = use or ("paced" if pace is not None else "watched" if memory is None else "memory")
    for block, timing in blank_blocks(scenario, use, memory):
        rig.prepare(block)
        try:
            count, over = _fly_block(rig, block, timing, pace, stop, before_row)
        except ManagerFailed as error:
            if error.row:
                yield block[: error.row], timing[: error.row]  # the frames before it are whole
            raise
        yield block[:count], timing[:count]
        if over:
            return


def fly_rows(
    scenario: Scenario,
    frames_at_most: int | None = None,
    computer: Callable[[Rig], ComputerStep] | None = None,
    beside: list[Block] | None = None,
) -> Block:
    """Return all rows of a flight in memory, no more than ``frames_at_most``; two kilobytes a frame.

    beside : its second rows are added to it, block by block
    """
    rig, (rows, timing) = Rig(scenario, computer), new_memory(scenario, frames_at_most)
    count = 0
    for block, _ in frames(rig, scenario, memory=(rows, timing)):
        count += len(block)
        if beside is not None:
            beside += rig.beside(len(block))
    return rows[:count]


def new_memory(scenario: Scenario, frames_at_most: int | None = None) -> RowsAndTiming:
    """Return memory for a whole flight, or for its first frames."""
    count = scenario.frames if frames_at_most is None else min(frames_at_most, scenario.frames)
    return np.empty(count, FLAT), np.zeros(count, TIMING)


def blank_blocks(
    scenario: Scenario, use: Use = "watched", memory: RowsAndTiming | None = None
) -> Iterator[RowsAndTiming]:
    """Yield the blocks of a flight, blank, in two that take turns or in ``memory``."""
    size = block_frames(scenario, use)
    total = scenario.frames if memory is None else len(memory[0])
    turns = cycle([(new_block(size), np.zeros(size, TIMING)) for _ in range(2 if memory is None else 0)])
    for first in range(0, total, size):
        count = min(size, total - first)
        rows, timing = next(turns) if memory is None else (memory[0][first:], memory[1][first:])
        yield _clear_rows(rows, first, count), timing[:count]


def _fly_block(
    rig: Rig, block: Block, timing: NDArray[np.void], pace: Pacing | None, stop: Stop, before_row: BeforeRow | None
) -> tuple[int, bool]:
    """Fly the rows of a block; return how many were flown, and whether the flight is over."""
    frame_us, late_us, reply_us = timing["frame_us"], timing["late_us"], timing["reply_us"]
    clock, first, rows, data = time.perf_counter, int(block["frame"][0]), nested(block), rig.data
    read_truth, compute_row, move_surfaces = rig.plant.read, rig.computer_step, rig.plant.step
    if isinstance(compute_row, Held):
        compute_row, data = compute_row.entry, compute_row.hold(data)
    for k in range(len(block)):
        if pace is not None:
            late_us[k] = pace.wait(first + k) * 1e6
        if before_row is not None:
            before_row(rig, rows, k)
        began = clock()
        end = read_truth(block, k)  # and whether the flight ends here
        answer_us = compute_row(rows, k, data)  # channels, faults, votes, commands
        if end == 0:
            move_surfaces(block, k)  # to the next frame
        frame_us[k] = (clock() - began) * 1e6
        if answer_us is not None:
            reply_us[k] = answer_us
        if end != 0 or stop.requested:
            return k + 1, True
    return len(block), False


def _clear_rows(block: Block, first: int, count: int) -> Block:
    """Return the block's memory for the next rows, blank: a stage may rely on fields that were not written."""
    rows = block[:count]
    rows.view(np.uint8)[:] = 0
    rows["frame"] = np.arange(first, first + count)
    rows["reference"] = rows["second_reference"] = np.nan
    return rows
