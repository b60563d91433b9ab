"""Remove the constant delay and the constant offset of each channel against the others; see delays.py."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.units.angles import into_range, short_way, unwrapped
from rig.log.recordings.delays import MAX_DELAY, bridged, delays, interpolated
from rig.log.recordings.recording import Recording, Samples
from rig.log.recordings.stamps import Floats, digits
from rig.log.recordings.vote_config import RecordedSignal

MIN_ROWS: Final = 256
DEFAULT_S: Final = 6.0  # of the stretch from its begin on, when no end is given
_LARGEST: Final = 1e100  # a sample beyond it is invalid here: powers of larger ones are no numbers


@dataclass(frozen=True, slots=True)
class Correction:
    """Delay and offset removed from a channel; ``aligned`` is False if it correlates with no other and is unchanged."""

    aligned: bool
    delay_frames: float
    delay_s: float
    offset: float  # unit of the signal
    correlation: float  # best with another channel


Corrections = dict[str, list[Correction]]


def align(
    recording: Recording,
    settings: dict[str, RecordedSignal],
    start_s: float | None = None,
    end_s: float | None = None,
) -> tuple[Recording, Corrections]:
    """Return the recording with the delays and offsets found between ``start_s`` and ``end_s`` taken off everywhere.

    Delays are against the channel in the middle, whose samples stay as they are; offsets against the median.
    Rows in which a delayed channel has no sample are cut off at both ends; discretes stay as they are.
    BadInput: too few rows.
    """
    part = _stretch(recording.time_s, start_s, end_s)
    n = len(recording.time_s)
    corrections: Corrections = {}
    for name, chosen in settings.items():
        columns = [bridged(column[part]) for column in _valid(recording.signals[name], chosen)]
        corrections[name] = _correct(columns, chosen, recording.rate_hz)
    shifts = [0.0, *(correction.delay_frames for signal in corrections.values() for correction in signal)]
    rows = slice(ceil(-min(shifts)), n - ceil(max(shifts)))
    at = np.arange(rows.start, rows.stop)
    signals = {name: _taken_off(recording.signals[name], corrections[name], settings[name], at) for name in settings}
    discretes = {name: samples.of(rows) for name, samples in recording.discretes.items()}
    first = recording.first_row + rows.start
    moved = replace(recording, time_s=recording.time_s[rows], signals=signals, discretes=discretes, first_row=first)
    return moved, corrections


def _stretch(time_s: Floats, start_s: float | None, end_s: float | None) -> slice:
    start = 0 if start_s is None else int(np.searchsorted(time_s, start_s))
    end = len(time_s) if end_s is None else int(np.searchsorted(time_s, end_s, side="right"))
    if end - start < MIN_ROWS:
        first, last = float(time_s[0]), float(time_s[-1])
        asked = f"{digits(first if start_s is None else start_s)} to {digits(last if end_s is None else end_s)} s"
        there = f"the recording is from {digits(first)} to {digits(last)} s"
        raise BadInput(f"align: {max(end - start, 0)} rows from {asked}; at least {MIN_ROWS} are needed; {there}")
    return slice(start, end)


def _correct(columns: list[Floats], settings: RecordedSignal, rate_hz: float) -> list[Correction]:
    """Return the delay and offset of every channel of a signal."""
    delay, trusted, best = delays(columns)
    if not trusted.any():  # nothing but noise: no delay can be seen in it, an offset can
        trusted = np.array([bool(np.isfinite(column).all()) for column in columns])
    offset = _offsets(columns, delay, trusted, settings.wraps)
    return [
        Correction(bool(trusted[c]), float(d), float(d) / rate_hz, float(offset[c]), float(best[c]))
        for c, d in enumerate(delay)
    ]


def _valid(samples: Samples, settings: RecordedSignal) -> list[Floats]:
    """Return the channels with NaN for each sample that is flagged or out of range; angles without their jumps."""
    low, high = max(settings.limits[0], -_LARGEST), min(settings.limits[1], _LARGEST)
    columns: list[Floats] = []
    for c, raw in enumerate(samples.channels):
        good = (raw >= low) & (raw <= high)
        if samples.valid is not None:
            good &= samples.valid[c] != 0
        column = np.where(good, raw, np.nan)
        columns.append(unwrapped(column) if settings.wraps else column)
    return columns


def _offsets(columns: list[Floats], delay: Floats, trusted: NDArray[np.bool_], wraps: bool) -> Floats:
    """Median of each trusted channel less the median of them all; zero for the others."""
    offset = np.zeros(len(columns))
    inside = np.flatnonzero(trusted)
    if len(inside) < 2:
        return offset
    at = np.arange(MAX_DELAY, len(columns[0]) - MAX_DELAY - 1)
    aligned = np.array([interpolated(columns[c], at + delay[c]) for c in inside])
    if wraps:
        aligned = aligned[0] + short_way(aligned - aligned[0])
    offset[inside] = np.median(aligned - np.median(aligned, axis=0), axis=1)
    return offset


def _taken_off(
    samples: Samples, corrections: list[Correction], settings: RecordedSignal, at: NDArray[np.int64]
) -> Samples:
    """Return a signal's samples at the rows ``at`` without delay and offset; invalid ones are NaN."""
    low, high = settings.limits
    columns: list[Floats] = []
    for column, correction in zip(_valid(samples, settings), corrections, strict=True):
        moved = interpolated(column, at + correction.delay_frames) - correction.offset
        columns.append(into_range(moved, low, high, settings.wraps))
    ilm = samples.ilm
    if ilm is not None:
        ilm = [flags[np.rint(at + c.delay_frames).astype(np.int64)] for flags, c in zip(ilm, corrections, strict=True)]
    reference, second = (None if of is None else of[at] for of in (samples.reference, samples.second_reference))
    others = {number: column[at] for number, column in samples.others.items()}
    return Samples(columns, ilm, reference, second_reference=second, numbers=samples.numbers, others=others)
