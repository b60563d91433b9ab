"""Execution of faults, from the rows of a flight alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from rig.core.frame import MOST_FAULTS, Block, State, copied
from rig.world.faults.places import CHANNELLED, number, site
from rig.world.faults.scenario_faults import Fault

NEVER: Final = "never triggered"
OUT: Final = "its channels were already isolated or absent"


class Execution:
    """Find the faults that acted, from the rows of a flight, block after block.

    A fault is executed if it acts in a frame at whose beginning one of its channels is in use: neither FAILED nor
    ABSENT in the frame before.  A place without channels is always in use; so are all channels of a unit under test
    that transmits no states.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = faults
        self._waiting = np.zeros(MOST_FAULTS, np.uint8)
        self._waiting[: len(faults)] = 1
        self._acted = np.zeros(MOST_FAULTS, np.uint8)
        self._last: Block | None = None  # the last row seen

    def add(self, rows: Block) -> None:
        """Add the next rows; a flight is not kept in memory until its end."""
        acted = np.unpackbits(np.bitwise_or.reduce(rows["acting"], axis=0), bitorder="little")
        self._acted |= acted
        for i in np.flatnonzero(acted & self._waiting):
            if self._did(rows, int(i)):
                self._waiting[i] = 0
        self._last = copied(rows[-1:])

    def _did(self, rows: Block, i: int) -> bool:
        """Return True if fault i acts in one of ``rows`` on something that is in use."""
        fault = self._faults[i]
        acts = rows["acting"][:, i >> 3] >> np.uint8(i & 7) & 1 == 1
        for place, channel in fault.points:
            where = site(place)
            if where not in CHANNELLED or channel is None:
                return True
            field, at = ("state" if where == "channel" else "discrete_state"), (number(place), channel - 1)
            state = rows[field][:, *at]
            first = state[0] if self._last is None else self._last[field][0, *at]
            if self._last is None and first == State.FAILED:
                first = State.OK  # before the first frame no channel is isolated
            before = np.concatenate([[first], state[:-1]])
            silent = (rows[field][:, at[0]] == State.ABSENT).all(axis=-1)  # a unit that transmits no states
            if (acts & ((before < State.FAILED) | silent)).any():
                return True
        return False

    @property
    def executed(self) -> list[bool]:
        """(faults,) True for each fault of the scenario that acted."""
        return (self._waiting[: len(self._faults)] == 0).tolist()

    @property
    def missing(self) -> list[tuple[str, str]]:
        """The faults that did not act: name and reason."""
        did = zip(self._faults, self.executed, self._acted.tolist(), strict=False)
        return [(fault.label, OUT if acted else NEVER) for fault, done, acted in did if not done]
