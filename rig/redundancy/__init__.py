"""Redundancy management: four channels become one voted value, without knowing the truth."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import Block
from rig.kernels import kernel
from rig.redundancy.baselines import CrossVoter, Mean, average, cross_voter
from rig.redundancy.config import Config, SignalConfig, parameters, reset_table
from rig.redundancy.discrete import DiscreteVoter, vote_discretes
from rig.redundancy.manager import CrossChannel, manage

MANAGERS: Final = {"cross-channel": CrossChannel, "mean": Mean, "cross-voter": CrossVoter}
_MEAN: Final = list(MANAGERS).index("mean")
_CROSS_VOTER: Final = list(MANAGERS).index("cross-voter")


class Redundancy:
    """The stage: the chosen manager for the continuous signals, the voter for the discretes."""

    def __init__(
        self, config: Config, ranges: NDArray[np.float64], channels: NDArray[np.int64], rate_hz: float
    ) -> None:
        """``ranges`` (S, 2) and ``channels`` (S,) are those of the sensors."""
        params = parameters(config.signals, ranges, channels, rate_hz)
        self.manager = MANAGERS[config.manager](params, reset_table(config.resets, rate_hz))
        self.discretes = DiscreteVoter(config.discrete_persistence)
        self._choice = list(MANAGERS).index(config.manager)

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What ``vote_row`` needs besides the row."""
        manager = self.manager
        return (self._choice, manager.params, manager.state, manager.resets, *self.discretes.arguments)

    def step(self, block: Block, k: int) -> None:
        """Vote and monitor row k; see manager.manage for what is written."""
        vote_row(block, k, *self.arguments)


@kernel
def vote_row(block, k, choice, params, state, resets, fail_safe, discrete_state, discrete_persistence):
    """Row k through the chosen manager (its place in MANAGERS) and the voter of the discretes."""
    if choice == _MEAN:
        average(block, k, params, state, resets)
    elif choice == _CROSS_VOTER:
        cross_voter(block, k, params, state, resets)
    else:
        manage(block, k, params, state, resets)
    vote_discretes(block, k, fail_safe, discrete_state, discrete_persistence)


__all__ = ["MANAGERS", "Config", "Redundancy", "SignalConfig", "vote_row"]
