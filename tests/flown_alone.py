"""A plant by itself, on commands of the test's own: what the tests of the plants share."""

from __future__ import annotations

import numpy as np

from rig.frame import Block, new_block
from rig.plant.jsbsim import Plant
from rig.plant.linear_plant import LinearPlant


def fly(flying: Plant | LinearPlant, commands: np.ndarray) -> Block:
    """Every row read and stepped; commands (n, 4), absolute."""
    block = new_block(len(commands))
    block["actuator"] = commands
    for k in range(len(block)):
        flying.read(block, k)
        flying.step(block, k)
    return block


def hold(flying: Plant | LinearPlant, frames: int) -> np.ndarray:
    """(frames, 4) commands that leave the surfaces where the trim has them."""
    return np.tile(flying.trim, (frames, 1))
