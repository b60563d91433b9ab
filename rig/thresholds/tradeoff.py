"""What a design finds: one channel made faulty in pieces of the design data, voted by the flight's manager.

Right: the faulty channel is failed within the time of the fault, and no healthy channel is failed in the whole piece.
Sizes follow the motion of the signal, not the design, so all designs of a signal are asked the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.recordings.settings import RecordedSignal
from rig.thresholds import faults
from rig.thresholds.design import Design, Flight
from rig.thresholds.faults import Fault
from rig.thresholds.monitored import NEVER, failures

Floats = NDArray[np.float64]
PIECES: Final = 48
BEFORE_S: Final = 1.0  # healthy
WITHIN_S: Final = 1.0  # for an offset
LATER_S: Final = 8.0  # for what begins small, or shows only in motion
SHARES: Final = (0.1, 0.2, 0.5, 1.0, 2.0)  # of the signal's motion: offsets; a ramp grows by the first a second
NOISE: Final = 10.0
GAIN: Final = 0.5
FOUND: Final = 0.95
_STEP: Final = 1.1  # of the search for the smallest offset
_STEPS: Final = 64


class Found(NamedTuple):
    """Pieces in which a fault was found rightly, another channel was failed, or nobody; and the delays, s."""

    right: int
    wrong: int
    missed: int
    delay_s: float | None  # median of the right ones
    delay_95_s: float | None


@dataclass(frozen=True, slots=True)
class Pieces:
    """``samples`` (R, n, C) from BEFORE_S before the onset on, and the channel (R,) that becomes faulty."""

    samples: Floats
    channel: NDArray[np.int64]
    onset: int
    rate_hz: float

    def short(self) -> Pieces:
        """Only what an offset needs."""
        end = self.onset + round(WITHIN_S * self.rate_hz) + 1
        return Pieces(self.samples[:, :end], self.channel, self.onset, self.rate_hz)


@dataclass(frozen=True, slots=True)
class Tradeoff:
    """One design's row: None where no offset is found often enough."""

    smallest_offset: float | None  # found in FOUND of the pieces within WITHIN_S
    at_twice: Found  # an offset of twice the threshold
    kinds: dict[str, Found]

    @property
    def share(self) -> float:
        """Faults found rightly, of all that were injected."""
        return sum(found.right for found in self.kinds.values()) / sum(sum(found[:3]) for found in self.kinds.values())


def pieces(flights: Sequence[Flight], count: int = PIECES) -> Pieces | None:
    """``count`` pieces spread evenly over the flights; None when the flights are all too short for one."""
    rate = flights[0].rate_hz
    onset, length = round(BEFORE_S * rate), round((BEFORE_S + LATER_S) * rate) + 1
    room = np.array([max(flight.samples.shape[1] - length + 1, 0) for flight in flights])
    if not room.any():
        return None
    at = ((np.arange(count) + 0.5) * room.sum() / count).astype(np.int64)
    flight = np.searchsorted(np.cumsum(room), at, side="right")
    start = at - (np.cumsum(room) - room)[flight]
    cut = [flights[f].samples[:, k : k + length].T for f, k in zip(flight, start, strict=True)]
    samples = np.ascontiguousarray(cut)
    return Pieces(samples, np.arange(count) % samples.shape[2], onset, rate)


def tradeoff(cut: Pieces, design: Design, given: RecordedSignal, motion: float) -> Tradeoff:
    """Evaluate ``design`` on the pieces; ``motion`` is the size of the signal, in its unit."""
    settings, short = design.settings(given), cut.short()
    kinds: dict[str, Found] = {}
    for share in SHARES:
        kinds[f"offset {share:g}"] = inject(cut, settings, faults.offset(share * motion), WITHIN_S)
    kinds["ramp"] = inject(cut, settings, faults.ramp(SHARES[0] * motion, cut.rate_hz), LATER_S)
    kinds["noise"] = inject(cut, settings, faults.noise(NOISE), LATER_S)
    kinds["gain"] = inject(cut, settings, faults.gain(GAIN), LATER_S)
    kinds["stuck"] = inject(cut, settings, faults.stuck(), LATER_S)
    twice = inject(short, settings, faults.offset(2.0 * design.threshold.upper), WITHIN_S)
    return Tradeoff(_smallest(short, settings, design.threshold.upper), twice, kinds)


def inject(cut: Pieces, settings: RecordedSignal, fault: Fault, within_s: float) -> Found:
    """Vote all pieces with the fault in one channel of each."""
    faulty = cut.samples.copy()
    rows = np.arange(len(faulty))
    faulty[rows, :, cut.channel] = fault(cut.samples, cut.channel, cut.onset)
    first = failures(faulty, settings, cut.rate_hz)
    mine = first[rows, cut.channel]
    others = first.copy()
    others[rows, cut.channel] = NEVER
    wrong = (others != NEVER).any(axis=1) | ((mine != NEVER) & (mine < cut.onset))
    delay = (mine - cut.onset) / cut.rate_hz
    right = ~wrong & (mine != NEVER) & (delay <= within_s)
    delays = delay[right]
    quantiles = (float(q) for q in np.quantile(delays, [0.5, 0.95])) if len(delays) else (None, None)
    return Found(int(right.sum()), int(wrong.sum()), int((~right & ~wrong).sum()), *quantiles)


def _smallest(cut: Pieces, settings: RecordedSignal, threshold: float) -> float | None:
    """Return the smallest size threshold / 4 * 1.1^i that is found in FOUND of the pieces, as all larger ones are."""
    low, high = -1, _STEPS  # a size that is not found often enough, one that is

    def enough(step: int) -> bool:
        found = inject(cut, settings, faults.offset(threshold / 4.0 * _STEP**step), WITHIN_S)
        return found.right >= FOUND * len(cut.samples)

    if not enough(high):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return threshold / 4.0 * _STEP**high


def best(designs: Sequence[Design], found: Sequence[Tradeoff]) -> int:
    """Return the design that finds the largest share rightly; of equals the shortest persistence and filter."""

    def order(i: int) -> tuple[float, int, float]:
        return -round(found[i].share, 9), designs[i].persistence, designs[i].filter_s

    return min(range(len(designs)), key=order)
