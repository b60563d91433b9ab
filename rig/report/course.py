"""The course of a flight, found block by block: which state each lane took when, which faults acted."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rig.frame import INDEX, SIGNALS, Block, LaneBlock, Pattern, Source, State, has_part
from rig.record.failures import became_failed
from rig.view import computers, servos
from rig.view.lanes import Changes, changed, changes

_LEVELS = {0: "no channel", 1: "1 channel", 2: "2 channels", 3: "3 channels", 4: "4 channels"}


def level_path(name: str) -> str:
    """Return the lane of a signal's level."""
    return f"/{name}/level"


class Course:
    """What happened when; faults : how many the scenario has."""

    def __init__(self, faults: int) -> None:
        self.frames = 0
        self.odd: dict[str, int] = {}  # by signal, the first frame that was not as all others
        self._faults = range(faults)
        self._failed: list[NDArray[np.intp]] = []
        self._acting: list[NDArray[np.uint8]] = []
        self._changes: dict[str, list[Changes]] = {}
        self._before: Block | None = None  # (1,)
        self._beside: LaneBlock | None = None  # (1,)

    def add(self, rows: Block, lanes: LaneBlock | None = None) -> None:
        """Take the next rows (n,) of the flight, and those of lanes beside them."""
        before = self._before
        became = became_failed(rows["state"], None if before is None else before[0]["state"])
        self._failed.append(became[:, :2] + [self.frames, 0])
        self._acting.append(rows["acting"].copy())
        self._note_odd(rows)
        for found in (changes(rows, before, self._faults), _level_changes(rows, before)):
            self._note(found)
        for shown in (computers.SHOWN, servos.SHOWN):
            if has_part(lanes, shown.part):
                self._note(shown.changes(lanes, self._beside))
        self._beside = None if lanes is None else lanes[-1:].copy()
        self.frames += len(rows)
        self._before = rows[-1:].copy()

    def _note_odd(self, rows: Block) -> None:
        for name, s in INDEX.items():
            if name not in self.odd:
                doubted = np.isin(rows["state"][:, s], (State.SUSPECT, State.FAILED)).any(axis=1)
                odd = doubted | (rows["pattern"][:, s] != Pattern.NORMAL) | (rows["source"][:, s] != Source.VOTED)
                if odd.any():
                    self.odd[name] = self.frames + int(np.argmax(odd))

    def _note(self, found: Iterable[Changes]) -> None:
        for change in found:
            moved = change._replace(rows=change.rows + self.frames)
            self._changes.setdefault(change.path, []).append(moved)

    @property
    def acting(self) -> NDArray[np.uint8]:
        """(n, bytes) a bit a fault that acts, of all rows that came."""
        return np.concatenate(self._acting)

    def failed(self, name: str) -> list[int]:
        """Return the frames in which a channel of a signal became failed."""
        found = np.concatenate(self._failed)
        return found[found[:, 1] == INDEX[name], 0].tolist()

    def suspected(self, name: str, frame: int) -> int:
        """Return from which frame on a channel of a signal was suspect that became failed in ``frame``."""
        lanes, first = self.lanes(), frame
        for c in range(SIGNALS[INDEX[name]].channels):
            _, rows, states = lanes[f"/{name}/channel_{c + 1}"]
            k = int(np.searchsorted(rows, frame))
            if 0 < k < len(rows) and rows[k] == frame and states[k - 1 : k + 1] == ["SUSPECT", "FAILED"]:
                first = min(first, int(rows[k - 1]))
        return first

    def lanes(self) -> dict[str, Changes]:
        """Return the changes of each lane of view.lanes, view.computers and view.servos, and of the levels."""
        return {
            path: Changes(
                path, np.concatenate([part.rows for part in parts]), [s for part in parts for s in part.states]
            )
            for path, parts in self._changes.items()
        }


def _level_changes(rows: Block, before: Block | None) -> Iterable[Changes]:
    for s, signal in enumerate(SIGNALS):
        last = None if before is None else before["level"][:, s]
        yield from changed(level_path(signal.name), _LEVELS, rows["level"][:, s], last)
