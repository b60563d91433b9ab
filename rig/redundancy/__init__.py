"""Redundancy management: four channels become one voted value, without knowing the truth."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import Block
from rig.redundancy.baselines import CrossVoter, Mean
from rig.redundancy.config import Config, SignalConfig, parameters, reset_table
from rig.redundancy.discrete import DiscreteVoter
from rig.redundancy.manager import CrossChannel

MANAGERS: Final = {"cross-channel": CrossChannel, "mean": Mean, "cross-voter": CrossVoter}


class Redundancy:
    """The stage: the chosen manager for the continuous signals, the voter for the discretes."""

    def __init__(
        self, config: Config, ranges: NDArray[np.float64], channels: NDArray[np.int64], rate_hz: float
    ) -> None:
        """``ranges`` (S, 2) and ``channels`` (S,) are those of the sensors."""
        params = parameters(config.signals, ranges, channels, rate_hz)
        self.manager = MANAGERS[config.manager](params, reset_table(config.resets, rate_hz))
        self.discretes = DiscreteVoter(config.discrete_persistence)

    def step(self, block: Block, k: int) -> None:
        """Vote and monitor row k; see manager.manage for what is written."""
        self.manager.step(block, k)
        self.discretes.step(block, k)


__all__ = ["MANAGERS", "Config", "Redundancy", "SignalConfig"]
