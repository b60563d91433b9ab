"""The verdict: what a flight came to, gathered block by block in bounded memory."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rig.core.event import Event
from rig.core.frame import FLIGHT_INDEX, INDEX, Block, End, Table, copied, new_block, sig
from rig.core.kernels import kernel
from rig.core.units.angles import wrap
from rig.flight.failures import failed_channels
from rig.flight.suspects import Suspect, count_suspects, new_counts, suspects

MOST_EVENTS = 10_000  # kept for the summary; all of them are in the log
_HEADING, _ALTITUDE = INDEX["heading"], FLIGHT_INDEX["altitude_m"]


@dataclass(frozen=True, slots=True)
class Peaks:
    """Largest true excursions of a flight."""

    angle_of_attack_min_rad: float  # rad
    angle_of_attack_max_rad: float  # rad
    load_factor_min: float  # normal load factor, g
    load_factor_max: float  # normal load factor, g
    pitch_rate_max_rad_s: float  # absolute value, rad/s
    altitude_deviation_m: float  # from the first frame, m
    heading_deviation_rad: float  # from the first frame, rad


@kernel
def widen(rows, start, peaks):
    """Widen ``peaks`` (7,), in the order of Peaks, by the finite truth of ``rows``; ``start`` (1,) the first row."""
    altitude, heading = start[0]["flight"][_ALTITUDE], start[0]["truth"][_HEADING]
    for k in range(len(rows)):
        truth = rows[k]["truth"]
        alpha, n_z = truth[sig.ALPHA], truth[sig.N_Z]
        climbed = abs(rows[k]["flight"][_ALTITUDE] - altitude)
        turned = abs(wrap(truth[_HEADING] - heading))
        # A comparison with NaN is false, so a flight that ends in NaN keeps the peaks before it.
        peaks[0] = alpha if alpha < peaks[0] else peaks[0]
        peaks[1] = alpha if alpha > peaks[1] else peaks[1]
        peaks[2] = n_z if n_z < peaks[2] else peaks[2]
        peaks[3] = n_z if n_z > peaks[3] else peaks[3]
        peaks[4] = abs(truth[sig.Q]) if abs(truth[sig.Q]) > peaks[4] else peaks[4]
        peaks[5] = climbed if climbed > peaks[5] else peaks[5]
        peaks[6] = turned if turned > peaks[6] else peaks[6]


@dataclass(slots=True)
class Verdict:
    """Digest, end, failed and suspect channels, peaks and events of the frames seen so far.

    The digest is SHA-256 over every row as it stands in memory; of a flight with servos or several computers, SHA-256
    over that of its rows and that of theirs.  The same flight, bit for bit, has the same digest, in blocks of whatever
    length it comes.  Wall-clock timing is no part of a row.
    """

    frames: int = 0
    events: list[Event] = field(default_factory=list)
    _suspects: NDArray[np.void] = field(default_factory=new_counts)
    _start: Block = field(default_factory=lambda: new_block(0))
    _last: Block = field(default_factory=lambda: new_block(1))
    _peaks: NDArray[np.float64] = field(default_factory=lambda: np.array([np.inf, -np.inf, np.inf, -np.inf, 0, 0, 0]))
    _hash: hashlib._Hash = field(default_factory=hashlib.sha256)  # of the rows
    _beside: hashlib._Hash | None = None  # of those of servos and lanes, once there are any

    def __post_init__(self) -> None:
        """Compile the kernel before the first frame."""
        widen(self._start, self._last, self._peaks)

    def add(self, table: Table, events: Sequence[Event]) -> None:
        """Take in the next frames of the flight and their events: block by block, for a flight is not kept."""
        rows = table.rows
        if not len(self._start):
            self._start = copied(rows[:1])
        self._hash.update(rows.view(np.uint8).data)
        if table.beside is not None:
            self._beside = self._beside or hashlib.sha256()
            self._beside.update(table.beside.view(np.uint8).data)
        self.frames += len(rows)
        self._last = copied(rows[-1:])
        widen(rows, self._start, self._peaks)
        count_suspects(rows, self._suspects)
        self.events += events[: MOST_EVENTS - len(self.events)]

    @property
    def end(self) -> End:
        """Return how the last frame ended the flight, if it did."""
        return End(self._last["end"][0])

    @property
    def failed(self) -> dict[str, list[int]]:
        """Failed channels, numbered from 1, by signal or discrete."""
        return failed_channels(self._last[0])

    @property
    def suspects(self) -> list[Suspect]:
        """Every channel that had a state, and in how many frames it was suspect."""
        return suspects(self._suspects, self.frames)

    @property
    def peaks(self) -> Peaks:
        """Largest true excursions so far."""
        return Peaks(*map(float, self._peaks))

    @property
    def digest(self) -> str:
        """SHA-256 of the flight so far, in hexadecimal."""
        if self._beside is None:
            return self._hash.hexdigest()
        return hashlib.sha256(self._hash.digest() + self._beside.digest()).hexdigest()

    @property
    def survived(self) -> bool:
        """Return whether the aircraft was still flying at the end."""
        return self.end == End.FLYING
