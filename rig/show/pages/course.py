"""The course of a flight: which state each lane took when, which faults acted."""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import INDEX, SIGNALS, Pattern, Source, State, Table
from rig.flight.failures import became_failed
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer.state_strips import Changes, changed, changes

# Of FLAT, that the pictures show.
FIELDS: Final = (
    *("frame", "acting", "truth", "channels", "voted", "reference", "state", "level", "pattern", "resolver", "source"),
    *("discrete_state", "law", "surface", "actuator", "flight"),
)
_LEVELS = {0: "no channel", 1: "1 channel", 2: "2 channels", 3: "3 channels", 4: "4 channels"}


def level_path(name: str) -> str:
    """Return the lane of a signal's level."""
    return f"/{name}/level"


class Course:
    """What happened when in ``flight``; faults : how many the scenario has."""

    def __init__(self, flight: Table, faults: int) -> None:
        self.flight, self.frames, self._faults = flight, len(flight), range(faults)
        self.acting: NDArray[np.uint8] = flight["acting"]  # (n, bytes) a bit a fault that acts
        self._failed = became_failed(flight["state"])

    @cached_property
    def odd(self) -> dict[str, int]:
        """By signal, the first frame that was not as all others."""
        rows = self.flight
        doubted = np.isin(rows["state"], (State.SUSPECT, State.FAILED)).any(axis=2)
        odd = doubted | (rows["pattern"] != Pattern.NORMAL) | (rows["source"] != Source.VOTED)
        return {name: int(odd[:, s].argmax()) for name, s in INDEX.items() if odd[:, s].any()}

    def failed(self, name: str) -> list[int]:
        """Return the frames in which a channel of a signal became failed."""
        return self._failed[self._failed[:, 1] == INDEX[name], 0].tolist()

    def suspected(self, name: str, frame: int) -> int:
        """Return from which frame on a channel of a signal was suspect that became failed in ``frame``."""
        first = frame
        for c in range(SIGNALS[INDEX[name]].channels):
            _, rows, states = self.lanes[f"/{name}/channel_{c + 1}"]
            k = int(np.searchsorted(rows, frame))
            if 0 < k < len(rows) and rows[k] == frame and states[k - 1 : k + 1] == ["SUSPECT", "FAILED"]:
                first = min(first, int(rows[k - 1]))
        return first

    @cached_property
    def lanes(self) -> dict[str, Changes]:
        """The changes of each lane of the viewer's signals, computers and servos, and of the levels."""
        flight = self.flight
        found = list(changes(flight.rows, None, self._faults))
        for s, signal in enumerate(SIGNALS):
            found += changed(level_path(signal.name), _LEVELS, flight["level"][:, s], None)
        for shown in (computers.SHOWN, servos.SHOWN):
            found += shown.changes(flight, None) if shown.part in flight.parts else ()
        return {change.path: change for change in found}
