"""One flight: build the stages, run the frames, hand every block of them to whoever records.

plant --truth--> sensors --bus--> faults --bus--> computer --fcc--> faults --actuation--> plant (next frame)

Between two looks at the plant a frame has three stretches, each written once:

    before   sensors, inertial unit, faults on both, references, faults on references
    decide   the manager: votes, states and levels of the continuous signals
    after    what it keeps of the votes, discretes, control law, surfaces to the actuators, faults on the way
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from itertools import cycle
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rig import sensors
from rig.computer.control.autopilot import Control
from rig.computer.control.law import control_law
from rig.computer.control.state import ControlData
from rig.computer.redundancy import Redundancy, RedundancyData, conclude, refer, vote_signals
from rig.computer.redundancy.config import command
from rig.computer.redundancy.own import OwnManager
from rig.errors import ManagerFailed
from rig.faults import Coils, FaultData, Faults, actuate, corrupt, corrupt_reference
from rig.frame import FLAT, SIGNALS, TIMING, Block, Nested, nested, new_block
from rig.kernels import bind, kernel
from rig.plant.flown import plant
from rig.plant.pilot import Pilot
from rig.scenario import Scenario
from rig.sensors import SensorData, Sensors, inertial, measure
from rig.sensors.inertial import Inertial, InertialData, sense
from rig.unit.unit import UnitUnderTest
from rig.util.interrupt import Stop

# A killed flight loses no more than a second: the block being filled and, paced, the one being recorded.
BLOCK_S = 1.0
PACED_BLOCK_S = 0.5
MEMORY_BLOCK_S = 5.0  # nothing to lose; what is worked on still fits into a core's own cache


class StageData(NamedTuple):
    """What the stages need besides the row."""

    sensors: SensorData
    inertial: InertialData
    faults: FaultData
    redundancy: RedundancyData
    control: ControlData


class Rig:
    """The stages of one flight, wired up and at their first frame."""

    def __init__(self, scenario: Scenario, *, keep_clean: bool = False) -> None:
        """BadInput when the aircraft cannot be loaded or trimmed.  ``keep_clean``: fill ``faults.clean``."""
        seeds = scenario.streams()
        rate_hz, suite, frame = scenario.rate_hz, scenario.sensors, scenario.airframe
        self._resets, self._rate_hz = scenario.redundancy.resets, rate_hz
        self.pilot = Pilot(scenario.pilot, rate_hz)
        self.plant = plant(
            frame,
            frame.point(scenario.flight_point),
            scenario.wind,
            scenario.turbulence,
            rate_hz,
            scenario.steps_per_frame,
            int(seeds["plant"].generate_state(1)[0]) & 0x7FFFFFFF,
        )
        self.sensors = Sensors(suite, rate_hz, seeds["sensors"])
        self.inertial = Inertial(scenario.inertial, rate_hz, seeds["inertial"])
        self.faults = faults(scenario, scenario.frames if keep_clean else 0)
        self.redundancy = redundancy(scenario)
        self.control = Control(scenario.control, scenario.gains, rate_hz, frame.surface_limits)
        self.control.reset(self.plant.trim)
        self.data = self._gather()
        self.compute = computer(self.data, self.redundancy.own)
        self.unit: UnitUnderTest | None = None  # see flight/unit_loop.py
        self.asked: Callable[[Nested, int], None] | None = (
            None  # what keys ask for before a row, see flight/operator_keys.py
        )

    def prepare(self, block: Block) -> None:
        """What is drawn or planned a block at a time: stick, demands and commands, noise, chance."""
        self.pilot.prepare(block)
        command(block, self._resets, self._rate_hz)
        self.sensors.prepare(block)
        self.inertial.prepare(block)
        self.faults.prepare(block)
        self.data = self._gather()

    def _gather(self) -> StageData:
        """The parameters and states of the stages."""
        return StageData(
            sensors=self.sensors.data,
            inertial=self.inertial.data,
            faults=self.faults.data,
            redundancy=self.redundancy.data,
            control=self.control.data,
        )


def faults(scenario: Scenario, keep_clean: int = 0) -> Faults:
    """The faults of a scenario, at their first frame; a replay runs those on references again."""
    ranges = sensors.ranges(scenario.sensors)
    places = np.vstack([ranges, inertial.ranges(), ranges, scenario.airframe.surface_limits])  # as in faults.PLACES
    seeds, monitored = scenario.streams()["faults"], scenario.redundancy.signals
    thresholds = np.array([getattr(monitored, signal.name).threshold for signal in SIGNALS])
    monitors = {signal.name: getattr(scenario.sensors, signal.name).monitor for signal in SIGNALS}
    coils = {name: Coils(one.coverage, one.tolerance, one.frames) for name, one in monitors.items() if one is not None}
    return Faults(
        scenario.faults,
        places,
        scenario.rate_hz,
        seeds,
        thresholds=thresholds,
        coils=coils,
        keep_clean=keep_clean,
    )


def redundancy(scenario: Scenario) -> Redundancy:
    """The redundancy stage of a scenario, at its first frame; a replay runs the same.  BadInput: the user's manager."""
    suite = scenario.sensors
    ranges, channels, discretes = sensors.ranges(suite), sensors.channels(suite), sensors.discrete_channels(suite)
    settings, references, rate_hz = scenario.redundancy, scenario.references, scenario.rate_hz
    return Redundancy(settings, ranges, channels, references, rate_hz, discretes, scenario.trust)


Step = Callable[[Nested, int, StageData], object]


def computer(data: StageData, own: OwnManager | None) -> Step:
    """Bind the flight computer to what its stages keep: one compiled call, or two around the user's manager."""
    rows = nested(new_block(2))
    return bind(compute, rows, 0, data) if own is None else _around(rows, data, own)


def _around(rows: Nested, data: StageData, own: OwnManager) -> Step:
    """What ``compute`` does, with the user's manager in the place of ``decide``."""
    first, last = bind(before, rows, 0, data), bind(after, rows, 0, data)
    seen, bus, fcc = rows, rows["bus"], rows["fcc"]

    def step(block: Nested, k: int, data: StageData) -> None:
        nonlocal seen, bus, fcc
        if block is not seen:  # a part of a structured array is slow to look up
            seen, bus, fcc = block, block["bus"], block["fcc"]
        first(block, k, data)
        own.step(block, bus, fcc, k)
        last(block, k, data)

    return step


@kernel
def compute(block, k, data):
    """Row k of ``block``, FRAME records, from its truth to its actuators; data : StageData."""
    before(block, k, data)
    decide(block, k, data)
    after(block, k, data)


@kernel
def before(block, k, data):
    """All that the manager reads of row k: channels and references, with their faults."""
    row = block[k]
    truth, bus = row["truth"], row["bus"]
    measure(truth, bus, k, data.sensors)
    sense(truth, bus, k, data.inertial)
    corrupt(row, k, data.faults)
    refer(bus, row["fcc"], data.redundancy.references)
    corrupt_reference(row, k, data.faults)


@kernel
def decide(block, k, data):
    """Vote and monitor the continuous signals of row k."""
    row = block[k]
    vote_signals(row["bus"], row["fcc"], data.redundancy.manager)


@kernel
def after(block, k, data):
    """All that follows from the votes of row k: what is kept of them, discretes, surfaces and their faults."""
    row = block[k]
    bus, fcc = row["bus"], row["fcc"]
    conclude(bus, fcc, data.redundancy)
    control_law(bus, fcc, data.control)
    hand_over(fcc["surface"], row["actuation"]["actuator"])
    actuate(row, data.faults)


@kernel
def hand_over(surface, actuator):
    """What the computer asks of the surfaces is what reaches the actuators, unless a fault comes between."""
    for i in range(len(surface)):
        actuator[i] = surface[i]


Flown = tuple[Block, NDArray[np.void]]  # rows and their TIMING


class Pacing(Protocol):
    """Real time (flight/pace.py): ``period_s`` of a frame, None when frames are flown as fast as can be."""

    period_s: float | None

    def wait(self, frame: int) -> float:
        """Sleep until ``frame`` is due; return how late it begins, s."""
        ...


def frames(
    rig: Rig, scenario: Scenario, pace: Pacing | None = None, stop: Stop | None = None, memory: Flown | None = None
) -> Iterator[Flown]:
    """Fly; yields rows and their TIMING, a block at a time.

    memory : (scenario.frames,) of both, to fly into; without it two blocks take turns, and what is yielded
    stays as it is until the block after the next is begun.
    """
    stop, paced = stop or Stop(), pace is not None and pace.period_s is not None
    for block, timing in _blocks(scenario, paced, memory):
        rig.prepare(block)
        try:
            flown, over = _fly_block(rig, block, timing, pace if paced else None, stop)
        except ManagerFailed as error:
            if error.row:
                yield block[: error.row], timing[: error.row]  # the frames before it are whole
            raise
        yield block[:flown], timing[:flown]
        if over:
            return


def fly_rows(scenario: Scenario, frames_at_most: int | None = None, rig: Rig | None = None) -> Block:
    """All rows of a flight in memory, no more than ``frames_at_most``; two kilobytes a frame.

    rig : of the scenario, at its first frame; one is made without it
    """
    most = scenario.frames if frames_at_most is None else min(frames_at_most, scenario.frames)
    rows, flown = np.zeros(most, FLAT), 0
    for block, _ in frames(rig or Rig(scenario), scenario):
        taken = block[: most - flown]
        rows[flown : flown + len(taken)] = taken
        flown += len(taken)
        if flown == most:
            break
    return rows[:flown]


def block_frames(scenario: Scenario, seconds: float = BLOCK_S) -> int:
    """Frames of a block; without ``seconds`` as a flight is logged."""
    return max(1, int(seconds * scenario.rate_hz))


def _blocks(scenario: Scenario, paced: bool, memory: Flown | None) -> Iterator[Flown]:
    """The blocks of a flight, blank."""
    size = block_frames(scenario, PACED_BLOCK_S if paced else BLOCK_S if memory is None else MEMORY_BLOCK_S)
    turns = cycle([(new_block(size), np.zeros(size, TIMING)) for _ in range(2 if memory is None else 0)])
    for first in range(0, scenario.frames, size):
        count = min(size, scenario.frames - first)
        rows, timing = next(turns) if memory is None else (memory[0][first:], memory[1][first:])
        yield _renew(rows, first, count), timing[:count]


def _fly_block(rig: Rig, block: Block, timing: NDArray[np.void], pace: Pacing | None, stop: Stop) -> tuple[int, bool]:
    """Fly the rows of a block; how many were flown, and whether the flight is over."""
    frame_us, late_us, reply_us, unit = timing["frame_us"], timing["late_us"], timing["reply_us"], rig.unit
    clock, first = time.perf_counter, int(block["frame"][0])
    see, think, act, data, rows = rig.plant.read, rig.compute, rig.plant.step, rig.data, nested(block)
    asked = rig.asked
    for k in range(len(block)):
        if pace is not None:
            late_us[k] = pace.wait(first + k) * 1e6
        if asked is not None:
            asked(rows, k)
        began = clock()
        end = see(block, k)  # truth, and whether the flight ends here
        think(rows, k, data)  # channels, faults, votes, commands
        if end == 0:
            act(block, k)  # surfaces, to the next frame
        frame_us[k] = (clock() - began) * 1e6
        if unit is not None:
            reply_us[k] = unit.reply_us
        if end != 0 or stop.requested:
            return k + 1, True
    return len(block), False


def _renew(block: Block, first: int, count: int) -> Block:
    """The block's memory for the next rows, blank: a stage may rely on fields that nobody has written."""
    rows = block[:count]
    rows.view(np.uint8)[:] = 0
    rows["frame"] = np.arange(first, first + count)
    rows["reference"] = rows["second_reference"] = np.nan
    return rows
