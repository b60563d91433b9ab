"""``max_change`` of a signal: a sample that changes faster from row to row than the quantity can is invalid.

A sample is kept if it is within ``max_change`` of the sample before it, or of the last one that was kept, times the
rows between.  So a spike goes alone; after a step the first sample goes, and the monitor compares the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.core.units.angles import short_way
from rig.log.recordings.recorded_signal import RecordedSignal
from rig.log.recordings.recording import Bytes, Recording, Samples
from rig.log.recordings.stamps import Floats


def limited(recording: Recording, settings: Mapping[str, RecordedSignal]) -> Recording:
    """Return the recording with the samples flagged invalid that change by more than ``max_change``."""
    signals = dict(recording.signals)
    at = np.round((recording.time_s - recording.time_s[0]) * recording.rate_hz)
    for name, chosen in settings.items():
        if chosen.max_change is not None:
            signals[name] = _limited(signals[name], chosen, chosen.max_change, at)
    return replace(recording, signals=signals)


def _limited(samples: Samples, settings: RecordedSignal, most: float, at: Floats) -> Samples:
    low, high = settings.limits
    before = samples.valid or [np.ones(len(at), np.uint8) for _ in samples.channels]
    flags: list[Bytes] = []
    for column, flag in zip(samples.channels, before, strict=True):
        usable = np.flatnonzero((column >= low) & (column <= high) & (flag != 0))
        too_fast = usable[jumps(column[usable], at[usable], most, settings.wraps)]
        flags.append(np.where(np.isin(np.arange(len(at)), too_fast), 0, flag).astype(np.uint8))
    untouched = samples.valid is None and all(flag.all() for flag in flags)
    return samples if untouched else replace(samples, valid=flags)


def jumps(values: Floats, at: Floats, most: float, wraps: bool = False) -> NDArray[np.bool_]:
    """Return (m,) True for each of ``values`` (m,) that changes faster than ``most`` a row.

    at : (m,) row of each, which may be missing between
    """
    found = np.zeros(len(values), bool)
    if len(values) < 2:
        return found
    moved, rows = np.diff(values), np.maximum(np.diff(at), 1.0)
    moved = np.abs(short_way(moved) if wraps else moved)
    kept = 0  # last sample that was
    for k in (np.flatnonzero(moved > most * rows) + 1).tolist():
        kept = kept if found[k - 1] else k - 1
        change = values[k : k + 1] - values[kept]
        change = abs(float((short_way(change) if wraps else change)[0]))
        found[k] = change > most * max(at[k] - at[kept], 1.0)
    return found
