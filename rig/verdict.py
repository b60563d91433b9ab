"""The verdict: what a flight came to, gathered block by block in bounded memory."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rig.angles import wrap
from rig.events import Event
from rig.frame import DISCRETES, FLIGHT_INDEX, INDEX, SIGNALS, Block, End, State

MOST_EVENTS = 10_000  # kept for the summary; all of them are in the log
_ALPHA, _N_Z, _Q = INDEX["angle_of_attack"], INDEX["normal_load_factor"], INDEX["pitch_rate"]
_HEADING, _ALTITUDE = INDEX["heading"], FLIGHT_INDEX["altitude_m"]


@dataclass(slots=True)
class Peaks:
    """Largest true excursions of a flight; deviations are from the first frame."""

    angle_of_attack_min_rad: float = np.inf
    angle_of_attack_max_rad: float = -np.inf
    load_factor_min: float = np.inf
    load_factor_max: float = -np.inf
    pitch_rate_max_rad_s: float = 0.0
    altitude_deviation_m: float = 0.0
    heading_deviation_rad: float = 0.0

    def add(self, rows: Block, start: Block) -> None:
        """Widen by the rows of one block; ``start`` (1,) is the first row of the flight."""
        truth = rows["truth"]
        alpha, n_z = truth[:, _ALPHA], truth[:, _N_Z]
        self.angle_of_attack_min_rad = min(self.angle_of_attack_min_rad, float(alpha.min()))
        self.angle_of_attack_max_rad = max(self.angle_of_attack_max_rad, float(alpha.max()))
        self.load_factor_min = min(self.load_factor_min, float(n_z.min()))
        self.load_factor_max = max(self.load_factor_max, float(n_z.max()))
        self.pitch_rate_max_rad_s = max(self.pitch_rate_max_rad_s, float(np.abs(truth[:, _Q]).max()))
        climbed = rows["flight"][:, _ALTITUDE] - start["flight"][0, _ALTITUDE]
        turned = wrap(truth[:, _HEADING] - start["truth"][0, _HEADING])
        self.altitude_deviation_m = max(self.altitude_deviation_m, float(np.abs(climbed).max()))
        self.heading_deviation_rad = max(self.heading_deviation_rad, float(np.abs(turned).max()))


@dataclass(slots=True)
class Verdict:
    """Digest, end, failed channels, peaks and events of the frames seen so far.

    The digest is SHA-256 over every row as it stands in memory: the same flight, bit for bit, has the
    same digest.  Wall-clock timing is no part of a row.
    """

    frames: int = 0
    end: End = End.FLYING
    failed: dict[str, list[int]] = field(default_factory=dict)
    peaks: Peaks = field(default_factory=Peaks)
    events: list[Event] = field(default_factory=list)
    _start: Block | None = None
    _hash: hashlib._Hash = field(default_factory=hashlib.sha256)

    def add(self, rows: Block, events: Sequence[Event]) -> None:
        """Take in the next rows of the flight and their events."""
        if self._start is None:
            self._start = rows[:1].copy()
        self._hash.update(rows.view(np.uint8).data)
        self.frames += len(rows)
        last = rows[-1]
        self.end = End(last["end"])
        self.failed = _failed(last["state"], last["discrete_state"])
        self.peaks.add(rows if self.end != End.NOT_FINITE else _finite(rows), self._start)
        self.events += events[: MOST_EVENTS - len(self.events)]

    @property
    def digest(self) -> str:
        """SHA-256 of all rows so far, in hexadecimal."""
        return self._hash.hexdigest()

    @property
    def survived(self) -> bool:
        """Whether the aircraft was still flying at the end."""
        return self.end == End.FLYING


def _failed(state: NDArray[np.uint8], discrete_state: NDArray[np.uint8]) -> dict[str, list[int]]:
    """Failed channels, numbered from 1, by signal."""
    named = [*zip(SIGNALS, state, strict=True), *zip(DISCRETES, discrete_state, strict=True)]
    lists = {signal.name: [int(c) + 1 for c in np.flatnonzero(row == State.FAILED)] for signal, row in named}
    return {name: channels for name, channels in lists.items() if channels}


def _finite(rows: Block) -> Block:
    """The rows before the one whose numbers are gone; all of them when none is left."""
    return rows[:-1] if len(rows) > 1 else rows
