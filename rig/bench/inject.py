"""Faults of the flight on recorded channels, by the flight's own kernel: a recording becomes a test.

The rows are frames of the flight with the concerned signals in them.  A fault begins in the first row at or after its
``start_s``, a time of the recording; durations are counted in rows at the recording's rate.  Samples that are no number
or out of range are NaN to a fault, and stay as they are where the fault leaves NaN.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.bench.run import ROWS, Stages, run
from rig.bench.signal_slots import Slots, slots, translated
from rig.errors import BadInput
from rig.faults import Fault, Faults
from rig.frame import DISCRETE_INDEX, INDEX, Block, Ilm, nested, new_block
from rig.recordings.clock import Floats
from rig.recordings.injection_file import Fitted, Injected, Table, number
from rig.recordings.recording import Bytes, Recording, Samples
from rig.recordings.settings import RecordedDiscrete, RecordedSignal


@dataclass(frozen=True, slots=True)
class Injection:
    """A recording with faults, and where they are."""

    recording: Recording
    injected: list[Injected]


def inject(
    recording: Recording,
    faults: Sequence[Table],
    signals: Mapping[str, RecordedSignal],
    discretes: Mapping[str, RecordedDiscrete] | None = None,
    *,
    seed: int = 0,
    source: str = "inject",
) -> Injection:
    """Return the recording with ``faults``, tables as in ``[[faults]]``, on its channels; the given one stays as it is.

    signals, discretes : settings of those that are voted, as ``VoteConfig.signals`` gives them: range, wraps, threshold
    seed : what random faults draw depends on it and on the fault's name alone
    BadInput, one line, names ``source``, the fault and the key: what a recording has not, what does not fit it.
    """
    fitted = _fitted(recording, signals, discretes or {})
    try:
        for i, fault in enumerate(faults):
            fitted.check(i, fault, recording)
    except ValueError as error:
        raise BadInput(f"{source}: {error}") from None
    at = slots(faults, fitted, source)
    flown = translated(faults, at, fitted, signals, recording, source)
    stage = Faults(
        flown,
        at.ranges(signals),
        float(f"{recording.rate_hz:.9g}"),  # k / 100 has differences of 0.01 but for a rounding
        SeedSequence(seed),
        thresholds=at.thresholds(signals),
        signals=at.descriptors(signals),
    )
    _schedule(stage, flown, faults, recording.time_s)
    through = _Run(recording, at, signals)
    acted = through.through(stage, len(flown))
    return Injection(through.result(flown), _injected(flown, at, acted))


def _fitted(
    recording: Recording, signals: Mapping[str, RecordedSignal], discretes: Mapping[str, RecordedDiscrete]
) -> Fitted:
    return Fitted(
        {name: len(recording.signals[name].channels) for name in signals},
        {name: len(recording.discretes[name].channels) for name in discretes},
    )


def _schedule(stage: Faults, flown: Sequence[Fault], tables: Sequence[Table], time_s: Floats) -> None:
    """Begin and end each fault in the first row at or after its time."""
    for i in range(len(flown)):
        if (start := number(tables[i], "start_s")) is not None:
            stage.arm(i, int(np.searchsorted(time_s, start)))
        if (end := number(tables[i], "end_s")) is not None:
            stage.end(i, int(np.searchsorted(time_s, end)))


class _Run:
    """The concerned samples of a recording, as they go through the frames."""

    def __init__(self, recording: Recording, at: Slots, settings: Mapping[str, RecordedSignal]) -> None:
        self.recording, self.at = recording, at
        self.limits = {name: settings[name].limits for name in at.signals}
        named = [*((name, recording.signals[name]) for name in at.signals)]
        named += [(name, recording.discretes[name]) for name in at.discretes]
        self.before = dict(named)
        n = len(recording.time_s)
        self.samples = {name: [np.empty(n) for _ in samples.channels] for name, samples in named}
        self.valid = {name: [np.empty(n, np.uint8) for _ in samples.channels] for name, samples in named}
        self.ilm = {name: [np.empty(n, np.uint8) for _ in samples.channels] for name, samples in named}

    def through(self, stage: Faults, faults: int) -> list[tuple[int | None, int | None]]:
        """All rows through the kernel; the first and last row in which each fault acts."""
        n = len(self.recording.time_s)
        acted: list[tuple[int | None, int | None]] = [(None, None)] * faults
        block = new_block(ROWS)
        for start in range(0, n, ROWS):
            part = slice(start, min(start + ROWS, n))
            rows = block[: part.stop - start]
            self._put(rows, part)
            stage.prepare(rows)
            run(nested(rows), Stages(faults=stage.data))
            self._take(rows, part)
            acted = [_seen(rows, i, start, was) for i, was in enumerate(acted)]
        return acted

    def _put(self, rows: Block, part: slice) -> None:
        rows["frame"], rows["acting"], rows["valid"] = np.arange(part.start, part.stop), 0, 1
        rows["ilm"] = rows["discrete_ilm"] = Ilm.ABSENT
        for name, samples in self.before.items():
            (field, valid, ilm), i = self._place(name)
            for c, column in enumerate(samples.channels):
                rows[field][:, i, c] = self._number(name, column[part])
                if name in self.at.discretes:
                    rows[valid][:, i, c] = ~np.isnan(column[part])
            for c, flags in enumerate(samples.valid or ()):
                rows[valid][:, i, c] &= flags[part] != 0
            for c, flags in enumerate(samples.ilm or ()):
                rows[ilm][:, i, c] = flags[part]

    def _take(self, rows: Block, part: slice) -> None:
        for name, columns in self.samples.items():
            (field, valid, ilm), i = self._place(name)
            for c, column in enumerate(columns):
                column[part] = rows[field][:, i, c]
                self.valid[name][c][part], self.ilm[name][c][part] = rows[valid][:, i, c], rows[ilm][:, i, c]

    def _place(self, name: str) -> tuple[tuple[str, str, str], int]:
        """Return the frame's fields of samples, validity and in-line monitors, and the row in them."""
        if name in self.at.signals:
            return ("channels", "valid", "ilm"), INDEX[self.at.signals[name]]
        return ("discrete_channels", "discrete_valid", "discrete_ilm"), DISCRETE_INDEX[self.at.discretes[name]]

    def _number(self, name: str, column: Floats) -> Floats:
        """Return a column as the kernel takes it: NaN where a signal's sample is not usable, 0 for a discrete's."""
        if name in self.at.discretes:
            return np.nan_to_num(column)
        low, high = self.limits[name]
        return np.where((column >= low) & (column <= high), column, np.nan)

    def result(self, faults: Sequence[Fault]) -> Recording:
        """Return the recording with what came back for the channels that have faults."""
        touched = {(point.place, point.channel) for fault in faults for point in fault.points}
        changed = {name: self._changed(name, touched) for name in self.before}
        signals, discretes = (
            {name: changed[name] if name in concerned else samples for name, samples in all_of.items()}
            for all_of, concerned in (
                (self.recording.signals, self.at.signals),
                (self.recording.discretes, self.at.discretes),
            )
        )
        return replace(self.recording, signals=signals, discretes=discretes)

    def _changed(self, name: str, touched: set[tuple[str, int | None]]) -> Samples:
        before, place = self.before[name], {**self.at.signals, **self.at.discretes}[name]
        columns, flags, ilm = list(before.channels), list(before.valid or ()), list(before.ilm or ())
        for c, column in enumerate(before.channels):
            if (place, c + 1) not in touched:
                continue
            columns[c], own = self._column(name, c, column)
            if flags or not own.all():
                flags = flags or [np.ones(len(column), np.uint8) for _ in columns]
                flags[c] = own
            if ilm:
                ilm[c] = self.ilm[name][c]
        return replace(before, channels=columns, ilm=ilm or before.ilm, valid=flags or before.valid)

    def _column(self, name: str, c: int, column: Floats) -> tuple[Floats, Bytes]:
        """Return a channel and its validity flags; what was not usable stays as it was where the fault leaves it so."""
        new, valid = self.samples[name][c], self.valid[name][c]
        if name in self.at.discretes:
            empty = np.isnan(column)
            return np.where(empty & (valid == 0), column, new), np.where(empty, 1, valid).astype(np.uint8)
        return np.where(np.isnan(new) & np.isnan(self._number(name, column)), column, new), valid


def _seen(rows: Any, i: int, start: int, was: tuple[int | None, int | None]) -> tuple[int | None, int | None]:
    acts: NDArray[np.int64] = np.flatnonzero((rows["acting"][:, i >> 3] >> (i & 7)) & 1)
    if len(acts) == 0:
        return was
    return start + int(acts[0]) if was[0] is None else was[0], start + int(acts[-1])


def _injected(faults: Sequence[Fault], at: Slots, acted: Sequence[tuple[int | None, int | None]]) -> list[Injected]:
    return [
        Injected(i, fault.label, fault.kind, at.recorded(point.place), point.channel or 0, *acted[i])
        for i, fault in enumerate(faults)
        for point in fault.points
    ]
