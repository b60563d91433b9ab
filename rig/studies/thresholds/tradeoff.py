"""Measure which faults a design isolates: one channel is made faulty in pieces of the data, and the manager votes.

A fault is correctly isolated if the faulty channel is isolated in time and no healthy channel is isolated in the whole
piece.  Sizes follow the motion of the signal, not the design, so all designs of a signal get the same faults.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.threads import heed
from rig.core.units.angles import into_range, near
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.design import DataBlock, Design
from rig.studies.thresholds.pieces import outcomes
from rig.studies.thresholds.residual_series import learned
from rig.verdict.signal_kernels import NEVER
from rig.verdict.words import INJECTED, fault_words

Floats = NDArray[np.float64]
Kind = Literal["offset", "small", "ramp", "noise", "gain", "stuck"]
PIECES: Final = 48
BEFORE_S: Final = 1.0  # healthy
WITHIN_S: Final = 1.0  # for an offset
LATER_S: Final = 8.0  # for what begins small, or shows only in motion
SHARES: Final = (0.1, 0.2, 0.5, 1.0, 2.0)  # of the signal's motion: offsets; a ramp grows by the first a second
NOISE: Final = 10.0
GAIN: Final = 0.5
SMALL: Final = (0.02, 0.05)  # offsets that may take LATER_S
FOUND: Final = 0.95
_STEP: Final = 1.1  # of the search for the smallest offset
_STEPS: Final = 64


class Found(NamedTuple):
    """Pieces with a correct isolation, with a wrong isolation, and with none; and the delays, s."""

    correct: int
    wrong: int
    missed: int
    delay_s: float | None  # median of the correct isolations
    delay_95_s: float | None


@dataclass(frozen=True, slots=True)
class Pieces:
    """The pieces: ``samples`` (R, n, C) from some seconds before the onset on, and the faulty channel (R,) of each."""

    samples: Floats
    channel: NDArray[np.int64]
    onset: int
    rate_hz: float
    first: NDArray[Any] | None = None  # (R,) states of the manager that have learned; None: those of a start
    flight: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))  # (R,) that each is of, if known

    def short(self) -> Pieces:
        """Return the pieces cut to the length that an offset needs."""
        end = self.onset + round(WITHIN_S * self.rate_hz) + 1
        return Pieces(self.samples[:, :end], self.channel, self.onset, self.rate_hz, self.first)


@dataclass(frozen=True, slots=True)
class Tradeoff:
    """The trade-off of one design; ``smallest_offset`` is None if no offset is isolated often enough."""

    smallest_offset: float | None  # isolated in FOUND of the pieces within WITHIN_S
    at_twice: Found  # an offset of twice the threshold
    kinds: dict[str, Found]
    small: dict[str, Found] = field(default_factory=dict)  # offsets that may take LATER_S, for which the CUSUM is made

    @property
    def share(self) -> float:
        """The share of the injected faults that was correctly isolated."""
        return _share(self.kinds)

    @property
    def share_with_small(self) -> float:
        """The same share with the small offsets included."""
        return _share({**self.kinds, **self.small})


def _share(kinds: dict[str, Found]) -> float:
    return sum(counts.correct for counts in kinds.values()) / sum(sum(counts[:3]) for counts in kinds.values())


def pieces(
    flights: Sequence[DataBlock],
    count: int = PIECES,
    before_s: float = BEFORE_S,
    given: RecordedSignal | None = None,
) -> Pieces | None:
    """Return ``count`` pieces spread evenly over the flights; None if all flights are too short for one.

    given : settings whose slow-fault tests have learned from the flight before each piece; None: no manager has
    """
    rate = flights[0].rate_hz
    onset, length = round(before_s * rate), round((before_s + LATER_S) * rate) + 1
    room = np.array([max(flight.samples.shape[1] - length + 1, 0) for flight in flights])
    if not room.any():
        return None
    at = ((np.arange(count) + 0.5) * room.sum() / count).astype(np.int64)
    flight = np.searchsorted(np.cumsum(room), at, side="right")
    start = at - (np.cumsum(room) - room)[flight]
    cut = [flights[f].samples[:, k : k + length].T for f, k in zip(flight, start, strict=True)]
    samples = np.ascontiguousarray(cut)
    first = None
    if given is not None and given.slow_tests is not None:
        before = [flights[f].samples[:, :k] for f, k in zip(flight, start, strict=True)]
        first = learned(before, given, samples.shape[2], rate)
    return Pieces(samples, np.arange(count) % samples.shape[2], onset, rate, first, flight)


def tradeoff(cut: Pieces, design: Design, given: RecordedSignal, motion: float) -> Tradeoff:
    """Evaluate ``design`` on the pieces; ``motion`` is the size of the signal, in its unit."""
    settings, short = design.settings(given), cut.short()
    kinds: dict[str, Found] = {}
    for share in SHARES:
        kinds[f"offset {share:g}"] = inject(cut, settings, "offset", share * motion)
    small = {f"small {share:g}": inject(cut, settings, "small", share * motion) for share in SMALL}
    sizes: dict[Kind, float] = {"ramp": SHARES[0] * motion, "noise": NOISE, "gain": GAIN, "stuck": 0.0}
    for kind, size in sizes.items():
        kinds[kind] = inject(cut, settings, kind, size)
    twice = inject(short, settings, "offset", 2.0 * design.threshold.upper)
    return Tradeoff(_smallest(short, settings, design.threshold.upper), twice, kinds, small)


def inject(cut: Pieces, settings: RecordedSignal, kind: Kind, size: float) -> Found:
    """Vote all pieces with a fault of a ``kind`` and ``size``, in the unit of the signal, in one channel of each."""
    heed()
    samples, pieces = cut.samples.copy(), np.arange(len(cut.samples))
    samples[pieces, :, cut.channel] = faulty(cut, kind, size, circle_of(settings))
    signals = outcomes(samples, cut.channel, cut.onset, settings, cut.rate_hz, cut.first)
    failed_at = signals["failed_at"][pieces, cut.channel]
    wrong = np.asarray((signals["false_isolations"] > 0).any(axis=1))
    delay = (failed_at - cut.onset) / cut.rate_hz
    failed = (failed_at != NEVER) & (delay <= (WITHIN_S if kind == "offset" else LATER_S))
    words = fault_words(True, failed, True, wrong)
    delays = delay[words == "isolated"]
    quantiles = (float(q) for q in np.quantile(delays, [0.5, 0.95])) if len(delays) else (None, None)
    return Found(*(int((words == word).sum()) for word in INJECTED), *quantiles)


def circle_of(settings: RecordedSignal) -> float | None:
    """Return where the circle of an angle begins, rad; None for other signals."""
    return settings.limits[0] if settings.wraps else None


def faulty(cut: Pieces, kind: Kind, size: float, circle: float | None = None) -> Floats:
    """Return (R, n) the samples of the channel of each piece with a fault from the onset on.

    circle : of an angle, where it begins, rad: the samples are of it, and what is compared is taken the short way

    offset, small, ramp : ``size``, or ``size`` a second, is added, to either side in turn
    gain : the samples times ``size``
    noise : the channel's difference from the median of all, times ``size``; stuck : the last sample
    """
    own, frames = cut.samples[np.arange(len(cut.samples)), :, cut.channel], np.arange(cut.samples.shape[1]) - cut.onset
    sides = np.where(np.arange(len(own)) // cut.samples.shape[2] % 2 == 0, 1.0, -1.0)[:, None]
    if kind in ("offset", "small"):
        after = own + sides * size
    elif kind == "ramp":
        after = own + sides * (size * frames / cut.rate_hz)
    elif kind == "noise":
        lost = np.all(np.isnan(cut.samples), axis=2, keepdims=True)
        samples = cut.samples if circle is None else near(cut.samples, own[..., None])
        middle = np.nanmedian(np.where(lost, 0.0, samples), axis=2)
        after = middle + size * (own - middle)
    else:
        after = size * own if kind == "gain" else own[:, cut.onset - 1 : cut.onset]
    if circle is not None:
        after = into_range(after, circle, circle, True)
    return np.where(frames < 0, own, after)


def _smallest(cut: Pieces, settings: RecordedSignal, threshold: float) -> float | None:
    """Return the smallest size threshold / 4 * 1.1^i that is isolated in FOUND of the pieces, as all larger sizes."""
    low, high = -1, _STEPS  # a size that is not found often enough, one that is

    def enough(step: int) -> bool:
        counts = inject(cut, settings, "offset", threshold / 4.0 * _STEP**step)
        return counts.correct >= FOUND * len(cut.samples)

    if not enough(high):
        return None
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return threshold / 4.0 * _STEP**high


def ranked(designs: Sequence[Design], tradeoffs: Sequence[Tradeoff]) -> list[int]:
    """Return the places of the designs, the largest share of correct isolations first.

    Ties: the shorter persistence, then the shorter filter."""

    def order(i: int) -> tuple[float, int, float]:
        design = designs[i]
        return -round(tradeoffs[i].share, 9), design.persistence, design.filter_s

    return sorted(range(len(designs)), key=order)
