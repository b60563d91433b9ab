"""Redundancy management: four channels become one voted value, without knowing the truth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.frame import Block
from rig.kernels import kernel
from rig.redundancy.config import MANAGERS, Config, SignalConfig, parameters, reset_table
from rig.redundancy.discrete import DiscreteVoter, vote_discretes
from rig.redundancy.managers import Manager, ManagerLike, load_manager, vote_signals


class Redundancy:
    """The stage: the chosen manager for the continuous signals, the voter for the discretes."""

    def __init__(
        self, config: Config, ranges: NDArray[np.float64], channels: NDArray[np.int64], rate_hz: float
    ) -> None:
        """``ranges`` (S, 2) and ``channels`` (S,) are those of the sensors.  BadInput: the user's manager."""
        params = parameters(config.signals, ranges, channels, rate_hz)
        own = config.manager not in MANAGERS
        self.own: ManagerLike | None = load_manager(config.manager, params) if own else None
        name = MANAGERS[0] if own else config.manager
        self.manager = Manager(name, params, reset_table(config.resets, rate_hz))
        self.discretes = DiscreteVoter(config.discrete_persistence)

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What ``vote_row`` needs besides the row: the manager's part and the discretes' part."""
        return self.manager.arguments, self.discretes.arguments

    def step(self, block: Block, k: int) -> None:
        """Vote and monitor row k; see manager.manage for what is written."""
        if self.own is None:
            vote_row(block, k, *self.arguments)
            return
        self.own.step(block, k)
        self.discretes.step(block, k)


@kernel
def vote_row(block, k, of_manager, of_discretes):
    """Row k through the chosen manager and the voter of the discretes; tuples hold their own data."""
    vote_signals(block, k, *of_manager)
    vote_discretes(block, k, *of_discretes)


__all__ = ["MANAGERS", "Config", "Redundancy", "SignalConfig", "vote_row"]
