"""The aircraft stepped from outside, a frame at a time, with the flight computer outside too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import End, Nested, nested, new_block
from rig.core.kernels import bind
from rig.flight.loop import ComputerStep, Rig, StageData, after, before, blank_blocks
from rig.scenario.scenario import Scenario

_ENDLESS_S: Final = 1e9  # the master determines when the flight ends


class _Outside:
    """A binder for Rig of a flight computer that is called by someone else."""

    lane = None

    def __call__(self, rig: Rig) -> ComputerStep:
        return _leave_out


def _leave_out(block: Nested, k: int, data: StageData) -> None:
    """Do nothing: SteppedAircraft calls the other stretches of the frame itself."""


class SteppedAircraft:
    """One flight of a scenario; row ``frame`` is always as a flight computer reads it.

    row : its place in the block;  raw : (n, bytes) the block;  numbers : (n, bytes / 8) the same memory as f8
    end : why the flight is over; FLYING before that
    """

    def __init__(self, scenario: Scenario) -> None:
        """Trim the aircraft and fill the first row.  BadInput: it cannot be loaded or trimmed."""
        self._rig = rig = Rig(scenario, _Outside())
        self.trim: tuple[float, ...] = tuple(map(float, rig.plant.trim))
        self.frame, self.end, self.row = 0, End.FLYING, 0
        self._blocks = blank_blocks(scenario.model_copy(update={"duration_s": _ENDLESS_S}))
        self._next_block()
        rows = nested(new_block(1))
        self._before, self._after = bind(before, rows, 0, rig.data), bind(after, rows, 0, rig.data)
        self._fill()

    def step(self, surfaces: Sequence[float]) -> bool:
        """Fly one frame with four surface commands; False: the flight is over, and nothing moved."""
        if self.end != End.FLYING:
            return False
        rig, k = self._rig, self.row
        self._surface[k] = surfaces
        self._after(self._nested, k, rig.data)
        rig.plant.step(self.rows, k)
        self.frame += 1
        self.row = k + 1
        if self.row == len(self.rows):
            self._next_block()
        self._fill()
        return True

    def _fill(self) -> None:
        """Fill the present row up to the flight computer."""
        if end := self._rig.plant.read(self.rows, self.row):
            self.end = End(end)
        self._before(self._nested, self.row, self._rig.data)

    def _next_block(self) -> None:
        self.rows, _ = next(self._blocks)
        self.row = 0
        self._rig.prepare(self.rows)
        self._nested, self._surface = nested(self.rows), self.rows["surface"]
        whole: NDArray[Any] = np.asarray(self.rows)
        self.raw = whole.view(np.uint8).reshape(len(whole), -1)
        self.numbers = self.raw.view(np.float64)
