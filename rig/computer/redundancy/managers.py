"""The managers of the rig: what each is, and which one votes the continuous signals (own.py: a manager of the user's).

To add one: its kernel (baselines.py), its row in ``KINDS`` and its branch in ``vote_signals``.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.baselines import average, cross_voter, plain_median, select, select_unit
from rig.computer.redundancy.box import BOXES
from rig.computer.redundancy.manager import ManagerData, manage, new_state
from rig.kernels import kernel


class ManagerKind(NamedTuple):
    """Traits of a manager, for what runs it and what assesses it."""

    name: str
    kernel: Any = None  # of a row: bus, fcc, ManagerData; None: the user's own
    compares: bool = False  # channels with each other: by outlier thresholds too, with references and boxes
    latches: bool = False  # keeps a channel that it has failed out for good
    takes_back: bool = False  # fails a channel only for as long as it distrusts it, which it integrates over time
    chooses_units: bool = False  # one channel for all signals that are axes of one unit


KINDS: Final = (
    ManagerKind("cross-channel", manage, compares=True, latches=True),
    ManagerKind("mean", average),
    ManagerKind("median", plain_median),
    ManagerKind("cross-voter", cross_voter, latches=True),
    ManagerKind("selection", select, takes_back=True, chooses_units=True),
)
MANAGERS: Final = tuple(kind.name for kind in KINDS)
DEFAULT: Final = MANAGERS[0]
_CROSS_CHANNEL, _MEAN, _MEDIAN, _CROSS_VOTER, _SELECTION = range(len(KINDS))
_UNIT: Final = len(KINDS)  # "selection", with all signals the axes of one unit


def manager_kind(name: str) -> ManagerKind:
    """Return the row of a manager; for the user's own one that claims nothing."""
    return KINDS[MANAGERS.index(name)] if name in MANAGERS else ManagerKind(name)


class Manager:
    """A manager of the house; ``state`` is plain data and can be copied.

    name : of KINDS; params : (S,) config.PARAMS
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
        """Data of ``vote_signals`` besides the row."""
        return ManagerData(self.choice, self.params, self.state, self.boxes)


@kernel
def vote_signals(bus, fcc, data):
    """Vote a row by the chosen manager, its place in KINDS; numba calls no kernel that a table holds."""
    choice = data.choice
    if choice == _CROSS_CHANNEL:
        manage(bus, fcc, data)
    elif choice == _MEAN:
        average(bus, fcc, data)
    elif choice == _MEDIAN:
        plain_median(bus, fcc, data)
    elif choice == _CROSS_VOTER:
        cross_voter(bus, fcc, data)
    elif choice == _SELECTION:
        select(bus, fcc, data)
    elif choice == _UNIT:
        select_unit(bus, fcc, 0, len(data.params), data)
