"""``rig vote --align``: the segment, the delays and offsets that were removed, and warnings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from rig.log.recordings.align import DEFAULT_S, MIN_ROWS, Corrections, align
from rig.log.recordings.align_matrix import Matrix, take_off_matrices
from rig.log.recordings.injection_file import Injected
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
    if options.matrix:
        moved, matrices = take_off_matrices(moved, settings, triads, (start, end))
    moves = offset_moves(moved, settings)
    warnings = [*_in_stretch(recording, injected, start, end), *_moved(moves, settings)]
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
