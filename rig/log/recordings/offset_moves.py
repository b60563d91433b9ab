"""Change of a channel's offset: its medians in the quarters of a recording.

A slow fault or a drifting bias is no constant offset: alignment cannot remove it, and may have taken a
part of the fault for it.  Quarters and not halves: a fault that fills more than half of each half would not show.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rig.core.units.angles import short_way
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.stamps import Floats
from rig.log.recordings.vote_config import RecordedSignal

PARTS: Final = 4
MOST_SPREADS: Final = 1.0  # docs/reference/recordings.md says what healthy recordings have
_ROWS: Final = 100_000  # that are looked at; of longer recordings every second, third, ...
_SIGMA: Final = 1.4826  # standard deviations in a median absolute deviation, of a normal distribution


@dataclass(frozen=True, slots=True)
class OffsetMove:
    """Offset of one channel against the median of the channels, unit of the signal."""

    offset_move: float  # largest less smallest median of the quarters; 0 where too few samples are there
    spread: float  # within the quarters, as a standard deviation

    @property
    def moved(self) -> bool:
        """Return True if the change is more than the spread explains."""
        return self.offset_move > MOST_SPREADS * self.spread


def offset_moves(recording: Recording, settings: dict[str, RecordedSignal]) -> dict[str, list[OffsetMove]]:
    """Return the change of the offset of every channel of the signals in ``settings``."""
    step = -(-len(recording.time_s) // _ROWS)
    return {name: _of_signal(recording.signals[name], settings[name], step) for name in settings}


def _of_signal(samples: Samples, settings: RecordedSignal, step: int) -> list[OffsetMove]:
    low, high = settings.limits
    x = np.array([column[::step] for column in samples.channels])
    x[~((x >= low) & (x <= high))] = np.nan
    off = (x[:, None] - x[None]) if settings.wraps else np.empty(0)
    if settings.wraps:  # against the median of the differences, which has no jump
        turned = short_way(off)
        return [_move(median_of(turned[c])) for c in range(len(x))]
    center = median_of(x)
    return [_move(column - center) for column in x]


def median_of(x: Floats) -> Floats:
    """Return the median over the first axis, NaN if no value is a number."""
    whole = np.isfinite(x)
    if whole.all():
        return np.median(x, axis=0)
    some = whole.any(axis=0)
    median = np.full(x.shape[1], np.nan)
    median[some] = np.nanmedian(x[:, some], axis=0)
    return median


def _move(off: Floats) -> OffsetMove:
    parts = [part[np.isfinite(part)] for part in np.array_split(off, PARTS)]
    parts = [part for part in parts if len(part) > 0]
    if len(parts) < 2:
        return OffsetMove(0.0, 0.0)
    medians = [float(np.median(part)) for part in parts]
    mads = [float(np.median(np.abs(part - m))) for part, m in zip(parts, medians, strict=True)]
    return OffsetMove(max(medians) - min(medians), _SIGMA * float(np.median(mads)))
