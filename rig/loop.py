"""One flight: build the stages, run the frames, hand every block of them to whoever records.

JSBSim --truth--> sensors --channels--> faults --> redundancy --voted--> control --surfaces--> JSBSim
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from rig import sensors
from rig.control.autopilot import Control
from rig.faults import Faults
from rig.frame import TIMING, Block, new_block
from rig.pace import Pace
from rig.pilot import Pilot
from rig.plant.jsbsim import Plant
from rig.redundancy import Redundancy
from rig.scenario import Scenario
from rig.sensors import Sensors

# A killed flight loses no more than a second: the block being filled and, paced, the one being recorded.
BLOCK_S = 1.0
PACED_BLOCK_S = 0.5


class Rig:
    """The stages of one flight, wired up and at their first frame."""

    def __init__(self, scenario: Scenario) -> None:
        """BadInput when the aircraft cannot be loaded or trimmed."""
        seeds = scenario.streams()
        rate_hz, suite, frame = scenario.rate_hz, scenario.sensors, scenario.airframe
        ranges, channels = sensors.ranges(suite), sensors.channels(suite)
        self.pilot = Pilot(scenario.pilot, rate_hz)
        self.plant = Plant(
            frame,
            frame.point(scenario.flight_point),
            scenario.wind,
            scenario.turbulence,
            rate_hz,
            scenario.steps_per_frame,
            int(seeds["plant"].generate_state(1)[0]) & 0x7FFFFFFF,
        )
        self.sensors = Sensors(suite, rate_hz, seeds["sensors"])
        self.faults = Faults(scenario.faults, ranges, rate_hz)
        self.redundancy = Redundancy(scenario.redundancy, ranges, channels, rate_hz)
        self.control = Control(scenario.control, scenario.gains, rate_hz, frame.surface_limits)
        self.control.reset(self.plant.trim)

    def prepare(self, block: Block) -> None:
        """What is drawn or planned a block at a time: stick and demands, sensor noise."""
        self.pilot.prepare(block)
        self.sensors.prepare(block)

    def frame(self, block: Block, k: int) -> int:
        """Fly row k: measure, corrupt, vote, command, move on.  Nonzero (frame.End) when the flight ends."""
        end = self.plant.read(block, k)
        self.sensors.step(block, k)
        self.faults.step(block, k)
        self.redundancy.step(block, k)
        self.control.step(block, k)
        if end == 0:
            self.plant.step(block, k)
        return end


class Stop:
    """Asks a flight to end after the present frame."""

    requested = False


def frames(
    rig: Rig, scenario: Scenario, pace: Pace | None = None, stop: Stop | None = None
) -> Iterator[tuple[Block, NDArray[np.void]]]:
    """Fly; yields rows and their TIMING, a block at a time.

    Two blocks take turns: what is yielded stays as it is until the block after the next is begun.
    """
    pace, stop = pace or Pace(scenario.rate_hz, None), stop or Stop()
    size = max(1, int((BLOCK_S if pace.period_s is None else PACED_BLOCK_S) * scenario.rate_hz))
    buffers = cycle([(new_block(size), np.zeros(size, TIMING)) for _ in range(2)])
    for first in range(0, scenario.frames, size):
        memory, timing = next(buffers)
        block = _renew(memory, first, min(size, scenario.frames - first))
        rig.prepare(block)
        flown, over = _fly_block(rig, block, timing, pace, stop)
        yield block[:flown], timing[:flown]
        if over:
            return


def _fly_block(rig: Rig, block: Block, timing: NDArray[np.void], pace: Pace, stop: Stop) -> tuple[int, bool]:
    """Fly the rows of a block; how many were flown, and whether the flight is over."""
    frame_us, late_us = timing["frame_us"], timing["late_us"]
    clock, fly, paced, first = time.perf_counter, rig.frame, pace.period_s is not None, int(block["frame"][0])
    for k in range(len(block)):
        if paced:
            late_us[k] = pace.wait(first + k) * 1e6
        began = clock()
        end = fly(block, k)
        frame_us[k] = (clock() - began) * 1e6
        if end != 0 or stop.requested:
            return k + 1, True
    return len(block), False


def _renew(block: Block, first: int, count: int) -> Block:
    """The block's memory for the next rows, blank: a stage may rely on fields that nobody has written."""
    rows = block[:count]
    rows.view(np.uint8)[:] = 0
    rows["frame"] = np.arange(first, first + count)
    rows["reference"] = np.nan
    return rows
