"""Which built-in manager votes the continuous signals: ours or one of the baselines (own.py: a class of the user's)."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.baselines import average, cross_voter, plain_median, select, select_unit
from rig.computer.redundancy.box import BOXES
from rig.computer.redundancy.config import MANAGERS
from rig.computer.redundancy.manager import ManagerData, manage, new_state
from rig.frame import Block, nested
from rig.kernels import kernel

_MEAN: Final = MANAGERS.index("mean")
_MEDIAN: Final = MANAGERS.index("median")
_CROSS_VOTER: Final = MANAGERS.index("cross-voter")
_SELECTION: Final = MANAGERS.index("selection")
_UNIT: Final = len(MANAGERS)  # "selection", with all signals the axes of one unit


class Manager:
    """A manager of the house; ``state`` is plain data and can be copied.

    name : one of MANAGERS; params : (S,) config.PARAMS
    box_signals, box_persistence : as in config.Config; 0 signals: no channel is failed as a box
    as_unit : the signals are the axes of one unit, of which "selection" selects one channel
    """

    def __init__(
        self,
        name: str,
        params: NDArray[np.void],
        *,
        box_signals: int = 0,
        box_persistence: int = 1,
        as_unit: bool = False,
    ) -> None:
        self.choice = _UNIT if as_unit else MANAGERS.index(name)
        self.params = params
        self.state = new_state(params)
        self.boxes = np.zeros(1, BOXES)
        self.boxes["signals"], self.boxes["persistence"] = box_signals, box_persistence

    @property
    def data(self) -> ManagerData:
        """What ``vote_signals`` needs besides the row."""
        return ManagerData(self.choice, self.params, self.state, self.boxes)

    def step(self, block: Block, k: int) -> None:
        """Vote and monitor every signal of row k."""
        rows = nested(block)
        self.vote(rows["bus"], rows["fcc"], k)

    def vote(self, bus: Any, fcc: Any, k: int) -> None:
        """The same of row k of a block's parts."""
        vote_signals(bus[k], fcc[k], self.data)


@kernel
def vote_signals(bus, fcc, data):
    """A row through the chosen manager, its place in MANAGERS."""
    choice = data.choice
    if choice == _MEAN:
        average(bus, fcc, data)
    elif choice == _MEDIAN:
        plain_median(bus, fcc, data)
    elif choice == _CROSS_VOTER:
        cross_voter(bus, fcc, data)
    elif choice == _SELECTION:
        select(bus, fcc, data)
    elif choice == _UNIT:
        select_unit(bus, fcc, 0, len(data.params), data)
    else:
        manage(bus, fcc, data)
