"""One flight: build the stages, run the frames, hand every block of them to whoever records.

plant --truth--> sensors --channels--> faults --> redundancy --voted--> control --surfaces--> faults --> plant
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import cycle
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig import sensors
from rig.computer.control.autopilot import Control
from rig.computer.control.law import fly
from rig.computer.control.state import ControlData
from rig.computer.redundancy import Redundancy, RedundancyData, decide_row, refer_row
from rig.errors import ManagerFailed
from rig.faults import Coils, FaultData, Faults, actuate, corrupt, corrupt_reference
from rig.frame import SIGNALS, TIMING, Block, new_block
from rig.interrupt import Stop
from rig.kernels import bind, kernel
from rig.plant.flown import plant
from rig.plant.pilot import Pilot
from rig.record.pace import Pace
from rig.scenario import Scenario
from rig.sensors import SensorData, Sensors, inertial, measure
from rig.sensors.inertial import Inertial, InertialData, sense

# A killed flight loses no more than a second: the block being filled and, paced, the one being recorded.
BLOCK_S = 1.0
PACED_BLOCK_S = 0.5
MEMORY_BLOCK_S = 5.0  # nothing to lose; what is worked on still fits into a core's own cache


class StageData(NamedTuple):
    """What the stages between two looks at the plant need besides the row."""

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
        compiled = self.redundancy.own is None
        self.compute = bind(compute, new_block(1), 0, self.data) if compiled else self._one_by_one

    def prepare(self, block: Block) -> None:
        """What is drawn or planned a block at a time: stick and demands, noise, chance."""
        self.pilot.prepare(block)
        self.sensors.prepare(block)
        self.inertial.prepare(block)
        self.faults.prepare(block)
        self.data = self._gather()

    def _gather(self) -> StageData:
        """The parameters and states of the stages between two looks at the plant."""
        return StageData(
            sensors=self.sensors.data,
            inertial=self.inertial.data,
            faults=self.faults.data,
            redundancy=self.redundancy.data,
            control=self.control.data,
        )

    def _one_by_one(self, block: Block, k: int, _: StageData) -> None:
        """What ``compute`` does, stage by stage: for a manager of the user's own, which is not compiled."""
        self.sensors.step(block, k)
        self.inertial.step(block, k)
        self.faults.step(block, k)
        self.redundancy.refer(block, k)
        self.faults.refer(block, k)
        self.redundancy.decide(block, k)
        self.control.step(block, k)
        self.faults.actuate(block, k)


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


@kernel
def compute(block, k, data):
    """The flight computer's frame, in one compiled call: measure, corrupt, vote, command.

    Faults come between: on channels and inertial unit, on references, on the way to the actuators.

    block : FRAME records; data : StageData
    """
    measure(block, k, data.sensors)
    sense(block, k, data.inertial)
    corrupt(block, k, data.faults)
    refer_row(block, k, data.redundancy)
    corrupt_reference(block, k, data.faults)
    decide_row(block, k, data.redundancy)
    fly(block, k, data.control)
    actuate(block, k, data.faults)


Flown = tuple[Block, NDArray[np.void]]  # rows and their TIMING


def frames(
    rig: Rig, scenario: Scenario, pace: Pace | None = None, stop: Stop | None = None, memory: Flown | None = None
) -> Iterator[Flown]:
    """Fly; yields rows and their TIMING, a block at a time.

    memory : (scenario.frames,) of both, to fly into; without it two blocks take turns, and what is yielded
    stays as it is until the block after the next is begun.
    """
    pace, stop = pace or Pace(scenario.rate_hz, None), stop or Stop()
    for block, timing in _blocks(scenario, pace.period_s is not None, memory):
        rig.prepare(block)
        try:
            flown, over = _fly_block(rig, block, timing, pace, stop)
        except ManagerFailed as error:
            if error.row:
                yield block[: error.row], timing[: error.row]  # the frames before it are whole
            raise
        yield block[:flown], timing[:flown]
        if over:
            return


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


def _fly_block(rig: Rig, block: Block, timing: NDArray[np.void], pace: Pace, stop: Stop) -> tuple[int, bool]:
    """Fly the rows of a block; how many were flown, and whether the flight is over."""
    frame_us, late_us = timing["frame_us"], timing["late_us"]
    clock, paced, first = time.perf_counter, pace.period_s is not None, int(block["frame"][0])
    see, think, act, data = rig.plant.read, rig.compute, rig.plant.step, rig.data
    for k in range(len(block)):
        if paced:
            late_us[k] = pace.wait(first + k) * 1e6
        began = clock()
        end = see(block, k)  # truth, and whether the flight ends here
        think(block, k, data)  # channels, faults, votes, commands
        if end == 0:
            act(block, k)  # surfaces, to the next frame
        frame_us[k] = (clock() - began) * 1e6
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
