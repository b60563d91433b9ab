"""The cost of a frame as a ratio to bare JSBSim in the same process, and its stages.

Absolute times depend on the machine; the ratio is what a change must not make worse.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from operator import attrgetter
from pathlib import Path
from statistics import median
from typing import Any, Final

from rig.computer.control.law import control_law
from rig.computer.redundancy import conclude, refer, vote_signals
from rig.core.errors import BadInput
from rig.core.frame import Table, nested, new_block
from rig.core.kernels import bind, kernel
from rig.flight import loop
from rig.flight.fly import fly
from rig.flight.put_out import put_out
from rig.flight.recorder import INTERRUPTED, event_finder
from rig.flight.summary import Verdict
from rig.log.of_flight import metadata
from rig.log.writer import LogWriter
from rig.scenario.scenario import Scenario
from rig.world.faults import corrupt, corrupt_reference
from rig.world.plant import loading
from rig.world.plant.airframe import LinearConfig
from rig.world.sensors import measure
from rig.world.sensors.inertial import sense

BARE_S = 4.0  # hands off, an unstable airframe is reloaded before it leaves its flight point


@kernel
def sensors_of(rows, k, data):
    """Compute row k of the sensors.  All pieces take FRAME records and k: one record by itself is slow to hand over."""
    measure(rows[k]["truth"], rows[k]["bus"], k, data)


@kernel
def inertial_of(rows, k, data):
    """Compute row k of the inertial unit."""
    sense(rows[k]["truth"], rows[k]["bus"], k, data)


@kernel
def faults_of(rows, k, data):
    """Compute row k of the faults on channels and inertial unit."""
    corrupt(rows[k], k, data)


@kernel
def references_of(rows, k, data):
    """Compute row k of the references."""
    refer(rows[k]["bus"], rows[k]["fcc"], data)


@kernel
def reference_faults_of(rows, k, data):
    """Compute row k of the faults on references."""
    corrupt_reference(rows[k], rows[k]["fcc"]["reference"], k, data)


@kernel
def redundancy_of(rows, k, data):
    """Compute row k of the manager, and what follows from its votes before the control law."""
    vote_signals(rows[k]["bus"], rows[k]["fcc"], data.manager)
    conclude(rows[k]["bus"], rows[k]["fcc"], data)


@kernel
def control_of(rows, k, data):
    """Compute row k of the control law."""
    control_law(rows[k]["bus"], rows[k]["fcc"], data)


@kernel
def surface_faults_of(rows, k, data):
    """Compute row k of the surfaces on their way to the actuators; data : StageData."""
    put_out(rows[k], k, data.control.param[0]["still"], data.faults, data.actuators, None)


# A frame of the loop taken apart, in the order of loop.compute: each kernel by name, and whose data it takes ("": all).
PIECES: Final = {
    "sensors": (sensors_of, "sensors"),
    "inertial": (inertial_of, "inertial"),
    "faults": (faults_of, "faults"),
    "references": (references_of, "redundancy.references"),
    "reference faults": (reference_faults_of, "faults"),
    "redundancy": (redundancy_of, "redundancy"),
    "control": (control_of, "control"),
    "surface faults": (surface_faults_of, ""),
}
STAGES = ("plant.read", *PIECES, "plant.step")
PER_BLOCK = ("prepare", "events", "verdict", "log")


@dataclass(frozen=True, slots=True)
class Bench:
    """Medians over the repeats, microseconds a frame."""

    frames: int
    repeats: int
    bare_us: float  # FGFDMExec.run() of the same airframe, steps of one frame
    frame_us: float  # whole flight: every stage, verdict and log
    ratio: float
    stages_us: dict[str, float]  # each with the cost of reading the clock, some 0.1 us
    log_bytes_per_frame: float

    def as_dict(self) -> dict[str, Any]:
        """Return plain data, as ``rig cost --json`` prints it."""
        return asdict(self)


def bench(scenario: Scenario, repeats: int = 7) -> Bench:
    """Fly ``scenario`` and run its bare airframe in turn; return the medians of both.

    BadInput for a linear aircraft: there is no bare JSBSim to measure against.
    """
    if isinstance(scenario.airframe, LinearConfig):
        raise BadInput(f"aircraft: {scenario.aircraft} is a linear model; the cost is measured against bare JSBSim")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        fly(scenario, out=out)  # compiles what is not in the cache yet
        bare, whole, size = [], [], 0.0
        for _ in range(repeats):
            bare.append(_bare_us(scenario))
            flight = fly(scenario, out=out)
            if flight.end_reason == INTERRUPTED:
                raise KeyboardInterrupt  # nothing was measured
            whole.append(flight.us_per_frame)
            size = flight.log.stat().st_size / flight.frames
            flight.log.unlink()
        stages = _stages_us(scenario, out)
    ratio = median(w / b for w, b in zip(whole, bare, strict=True))
    return Bench(scenario.frames, repeats, median(bare), median(whole), ratio, stages, size)


def _bare_us(scenario: Scenario) -> float:
    """Return microseconds of JSBSim's own run() for one frame, over as many frames as a flight has."""
    steps, total_s, run = scenario.frames, 0.0, 0
    airframe, dt_s = scenario.airframe, 1.0 / (scenario.rate_hz * scenario.steps_per_frame)
    while run < steps:
        fdm = loading.load(airframe, airframe.point(scenario.flight_point), dt_s)
        count = min(steps - run, round(BARE_S * scenario.rate_hz)) * scenario.steps_per_frame
        began = time.perf_counter()
        for _ in range(count):
            fdm.run()
        total_s += time.perf_counter() - began
        run += count // scenario.steps_per_frame
    return total_s / run * 1e6


class _Clock:
    """Adds up the time of named calls."""

    def __init__(self) -> None:
        names: tuple[str, ...] = (*STAGES, *PER_BLOCK)
        self.total_s: dict[str, float] = dict.fromkeys(names, 0.0)

    def time(self, name: str, call: Callable[..., Any], *arguments: Any) -> Any:
        began = time.perf_counter()
        result = call(*arguments)
        self.total_s[name] += time.perf_counter() - began
        return result


def _stages_us(scenario: Scenario, out: Path) -> dict[str, float]:
    """Fly once more with a clock around every stage."""
    rig, clock, verdict = loop.Rig(scenario), _Clock(), Verdict()
    finder = event_finder(scenario)
    with LogWriter(out / "stages.mcap", scenario.rate_hz, metadata(scenario), []) as writer:
        for block, timing in loop.blank_blocks(scenario, "alone"):
            clock.time("prepare", rig.prepare, block)
            rows, bound = nested(block), pieces(rig.data)
            for k in range(len(block)):
                clock.time("plant.read", rig.plant.read, block, k)
                for name, entry, data in bound:
                    clock.time(name, entry, rows, k, data)
                clock.time("plant.step", rig.plant.step, block, k)
            table, events = Table(block, timing=timing), clock.time("events", finder.find, block)
            clock.time("verdict", verdict.add, table, events)
            clock.time("log", writer.write, table, events)
    return {name: total / scenario.frames * 1e6 for name, total in clock.total_s.items()}


def pieces(data: loop.StageData) -> list[tuple[str, Callable[..., Any], Any]]:
    """Bind PIECES to the types of their arguments; return name, entry point, its data."""
    rows, bound = nested(new_block(2)), []
    for name, (piece, whose) in PIECES.items():
        stage_data = attrgetter(whose)(data) if whose else data
        bound.append((name, bind(piece, rows, 0, stage_data), stage_data))
    return bound
