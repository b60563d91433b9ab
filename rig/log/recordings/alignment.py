"""``rig vote --align``: the segment, the delays and offsets that were removed, and warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from rig.log.recordings.align import DEFAULT_S, MIN_ROWS, Corrections, align
from rig.log.recordings.align_matrix import Matrix, take_off_matrices
from rig.log.recordings.injection_file import Injected
from rig.log.recordings.mirrored import Mirror, mirrors
from rig.log.recordings.offset_moves import OffsetMove, offset_moves
from rig.log.recordings.recording import Recording
from rig.log.recordings.stamps import of_rows
from rig.log.recordings.vote_config import RecordedSignal


@dataclass(frozen=True, slots=True)
class AlignOptions:
    """Segment of the recording in which delays and offsets are found."""

    from_s: float | None = None  # start, s; None: the first row
    to_s: float | None = None  # end, s; None: 6 s after the start
    matrix: bool = False  # True: also find matrices of triads


@dataclass(frozen=True, slots=True)
class Alignment:
    """The alignment found in the rows from ``from_s`` to ``to_s``."""

    from_s: float
    to_s: float
    rows: int
    by_default: bool  # the end was not given
    corrections: Corrections
    moves: dict[str, list[OffsetMove]]
    matrices: list[Matrix] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """Plain data, but for what stands with the channels."""
        plain = {key: getattr(self, key) for key in ("from_s", "to_s", "rows", "by_default", "warnings")}
        return {**plain, "matrices": [asdict(matrix) for matrix in self.matrices]}


def stretch(recording: Recording, options: AlignOptions) -> tuple[float, float]:
    """Begin and end in s: the end is DEFAULT_S after the begin, or MIN_ROWS rows if they last longer, if not given."""
    time_s = recording.time_s
    start = float(time_s[0]) if options.from_s is None else options.from_s
    if options.to_s is not None:
        return start, options.to_s
    enough = min(int(np.searchsorted(time_s, start)) + MIN_ROWS, len(time_s)) - 1
    return start, min(max(start + DEFAULT_S, float(time_s[enough])), float(time_s[-1]))


def run_alignment(
    recording: Recording,
    settings: dict[str, RecordedSignal],
    options: AlignOptions,
    triads: Mapping[str, Sequence[str]],
    injected: Sequence[Injected] = (),
) -> tuple[Recording, Alignment]:
    """Return the recording with what the stretch shows taken off everywhere. BadInput: too few rows, no triads."""
    start, end = stretch(recording, options)
    rows = int(np.searchsorted(recording.time_s, end, "right") - np.searchsorted(recording.time_s, start))
    moved, corrections = align(recording, settings, start, end)
    matrices: list[Matrix] = []
    mirrored: dict[str, list[Mirror]] = {}
    if options.matrix:
        mirrored = {triad: _mirrors(recording, settings, axes, (start, end)) for triad, axes in triads.items()}
        known = {triad: {mirror.channel for mirror in found} for triad, found in mirrored.items()}
        moved, matrices = take_off_matrices(moved, settings, triads, (start, end), known)
    moves = offset_moves(moved, settings)
    warnings = [*_in_stretch(recording, injected, start, end), *_moved(moves, settings)]
    warnings += [line for triad, found in mirrored.items() for line in _named(triad, triads[triad], found, recording)]
    warnings += _mirrored_by_matrix(matrices, mirrored)
    return moved, Alignment(start, end, rows, options.to_s is None, corrections, moves, matrices, warnings)


def _in_stretch(recording: Recording, injected: Sequence[Injected], start: float, end: float) -> list[str]:
    """Faults that act within the stretch."""
    lines: list[str] = []
    for fault in injected:
        if fault.first is None or fault.last is None:
            continue
        first, last = float(recording.time_s[fault.first]), float(recording.time_s[fault.last])
        onset = of_rows(first, float(recording.time_s[0]))
        if first <= end and last >= start:
            lines.append(
                f"{fault.label}: {fault.signal}.{fault.channel} is faulty from {onset}, within the alignment "
                "segment: a part of the fault is removed as an offset"
            )
    return lines


def _moved(moves: dict[str, list[OffsetMove]], settings: Mapping[str, RecordedSignal]) -> list[str]:
    lines: list[str] = []
    for name, channels in moves.items():
        shown = settings[name].shown
        lines += [
            f"{name}.{c}: its offset differs by {shown(move.offset_move):.4g} between quarters of the recording, its "
            f"spread is {shown(move.spread):.4g}: a fault, or a bias that is not constant; choose a healthy segment "
            "with --align-to"
            for c, move in enumerate(channels, 1)
            if move.moved
        ]
    return lines


def _mirrors(
    recording: Recording, settings: Mapping[str, RecordedSignal], axes: Sequence[str], between: tuple[float, float]
) -> list[Mirror]:
    """Return the mirrored recorders of a triad before alignment, which takes their axes for those of no other."""
    start, end = np.searchsorted(recording.time_s, between[0]), np.searchsorted(recording.time_s, between[1], "right")
    fitted = min(len(recording.signals[axis].channels) for axis in axes)
    x = np.array([[column[start:end] for column in recording.signals[axis].channels[:fitted]] for axis in axes])
    low, high = np.array([settings[axis].limits for axis in axes]).T[..., None, None]
    x[~((x >= low) & (x <= high))] = np.nan
    return mirrors(x)


def _named(triad: str, axes: Sequence[str], found: Sequence[Mirror], recording: Recording) -> list[str]:
    """Return a line on each mirrored recorder, with the way to mend it."""
    lines: list[str] = []
    for mirror in found:
        number = recording.signals[axes[0]].number(mirror.channel - 1)
        flipped = [f"{axes[axis]}.{number}" for axis in mirror.axes]
        keys = " and ".join(f'[channel."{name}"]' for name in flipped)
        who = f"{triad}, channel {mirror.channel}" if not mirror.of_two else f"{triad}, one of channels 1 and 2"
        what = f"opposite sign of {' and '.join(flipped)}" if flipped else "left-handed axes"
        mend = f"sign = -1 in {keys} of CONFIG" if flipped else "check signs and order of its axes"
        lines.append(f"{who}: mirrored, {what}: no mounting, not corrected; {mend}")
    return lines


def _mirrored_by_matrix(matrices: Sequence[Matrix], told: Mapping[str, Sequence[Mirror]]) -> list[str]:
    """Return a line on each recorder that only its matrix shows to be mirrored."""
    known = {(triad, mirror.channel) for triad, found in told.items() for mirror in found}
    return [
        f"{matrix.triad}, channel {matrix.channel}: mirrored, left-handed axes: no mounting, not corrected; check "
        "signs and order of its axes"
        for matrix in matrices
        if matrix.mirrored and (matrix.triad, matrix.channel) not in known
    ]
