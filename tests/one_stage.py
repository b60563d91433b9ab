"""One stage by itself, on values of the test's own: sensors, references, a plant."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.computer.analytic import references
from rig.computer.redundancy.discrete import DiscreteVoter, vote_discretes
from rig.computer.redundancy.managers import Manager, vote_signals
from rig.core.frame import CHANNELS, INDEX, SIGNALS, Block, S, nested, new_block
from rig.core.kernels import kernel
from rig.world.faults import Faults, corrupt
from rig.world.plant.jsbsim import Plant
from rig.world.plant.linear_plant import LinearPlant
from rig.world.sensors import Sensors, Suite, inertial, measure
from rig.world.sensors.inertial import Inertial

ERRORS = ("noise_std", "bias_tolerance", "scale_tolerance", "lag_s", "quantum", "skew_frames")
IDEAL: dict[str, Any] = dict.fromkeys(ERRORS, 0.0)
WIDE: dict[str, Any] = {"low": -1e9, "high": 1e9}


def suite(**per_signal: dict[str, Any]) -> Any:
    """Ideal sensors, but for the keys given by signal."""
    return Suite.model_validate({s.name: {**IDEAL, **per_signal.get(s.name, {})} for s in SIGNALS})


def truths(frames: int, **per_signal: Any) -> NDArray[np.float64]:
    """(frames, S) truth: what is given by signal, else 0."""
    truth = np.zeros((frames, S))
    for name, values in per_signal.items():
        truth[:, INDEX[name]] = values
    return truth


def step_stage(stage: Sensors | Inertial | Faults | Manager | DiscreteVoter, block: Block, k: int) -> None:
    """Row k through one stage of a frame; of faults those on channels and inertial unit."""
    row = nested(block)[k]
    match stage:
        case Sensors():
            measure(row["truth"], row["bus"], k, stage.data)
        case Inertial():
            inertial.sense(row["truth"], row["bus"], k, stage.data)
        case Faults():
            corrupt(row, k, stage.data)
        case Manager():
            vote_signals(row["bus"], row["fcc"], stage.data)
        case DiscreteVoter():
            vote_discretes(row["bus"], row["fcc"], stage.data)


@kernel
def measure_all(rows, data):
    """All rows through the sensors; rows : FRAME records."""
    for k in range(len(rows)):
        measure(rows[k]["truth"], rows[k]["bus"], k, data)


def sense(
    truth: NDArray[np.float64],
    settings: Any,
    *,
    seed: int = 0,
    rate_hz: float = 100.0,
    split: int = 500,
    field: str = "channels",
) -> NDArray[np.float64]:
    """(frames, S, 4) samples of the truths, or another field of the channels, in blocks of ``split`` rows."""
    stage, memory = Sensors(settings, rate_hz, SeedSequence(seed)), new_block(min(split, len(truth)))
    out = np.empty((len(truth), S, CHANNELS))
    for first in range(0, len(truth), split):
        block = memory[: len(truth) - first]
        block["truth"] = truth[first : first + len(block)]
        stage.prepare(block)
        data = stage.data
        measure_all(nested(block), data)
        out[first : first + len(block)] = block[field]
    return out


def ports(block: Block, k: int) -> tuple[Any, Any]:
    """BUS and FCC records of row k: the row's own memory."""
    row = nested(block)[k]
    return row["bus"], row["fcc"]


def refer(block: Block, k: int, data: references.ReferenceData) -> None:
    """Write the references of row k."""
    references.refer(*ports(block, k), data)


def remember(block: Block, k: int, data: references.ReferenceData) -> None:
    """Keep the votes of row k."""
    references.remember(*ports(block, k), data)


def fly(flying: Plant | LinearPlant, commands: np.ndarray) -> Block:
    """Every row read and stepped; commands (n, 4), absolute."""
    block = new_block(len(commands))
    block["surface_command"] = commands
    for k in range(len(block)):
        flying.read(block, k)
        flying.step(block, k)
    return block


def hold(flying: Plant | LinearPlant, frames: int) -> np.ndarray:
    """(frames, 4) commands that leave the surfaces where the trim has them."""
    return np.tile(flying.trim, (frames, 1))
