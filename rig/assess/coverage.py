"""Voter-state coverage: which patterns, levels and transitions a flight exercised, of how many there are."""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.assess.record import Coverage
from rig.frame import CHANNELS, SIGNALS, Block, Pattern, S
from rig.kernels import kernel

_PATTERNS: Final = len(Pattern)
_LEVELS: Final = CHANNELS + 1
# What a voter of so many channels can meet; a sample that is lost for a frame makes any number below possible.
POSSIBLE: Final = {
    2: (Pattern.NORMAL, Pattern.P1_1, Pattern.LOST),
    3: (Pattern.NORMAL, Pattern.ISOLATED, Pattern.P1_1_1, Pattern.P1_1, Pattern.LOST),
    4: tuple(Pattern),
}


def coverage(rows: Block, fitted: NDArray[np.int64]) -> dict[str, Coverage]:
    """By signal, and ``overall``: what any signal met.  ``fitted`` (S,) channels of each signal."""
    patterns = np.zeros((S, _PATTERNS, _PATTERNS), np.int64)
    levels = np.zeros((S, _LEVELS, _LEVELS), np.int64)
    count(rows, patterns, levels)
    met, stood, any_of = patterns > 0, levels > 0, np.logical_or.reduce
    found = {signal.name: _coverage(met[s], stood[s], int(fitted[s])) for s, signal in enumerate(SIGNALS)}
    return {**found, "overall": _coverage(any_of(met, axis=0), any_of(stood, axis=0), int(fitted.max()))}


@kernel
def count(rows, patterns, levels):
    """Add one to [signal, before, now] for each frame; the first counts as one that stays as it is.

    patterns : (S, 7, 7) and levels : (S, 5, 5), in place.  What a manager says beyond is not counted.
    """
    for k in range(len(rows)):
        now, before = rows[k], rows[max(k - 1, 0)]
        for s in range(len(patterns)):
            a, b = before["pattern"][s], now["pattern"][s]
            if a < _PATTERNS and b < _PATTERNS:
                patterns[s, a, b] += 1
            a, b = before["level"][s], now["level"][s]
            if a < _LEVELS and b < _LEVELS:
                levels[s, a, b] += 1


def _coverage(met: NDArray[np.bool_], stood: NDArray[np.bool_], fitted: int) -> Coverage:
    return _told(met.tobytes(), stood.tobytes(), fitted)


@cache
def _told(met: bytes, stood: bytes, fitted: int) -> Coverage:
    """The coverage of (7, 7) and (5, 5) flags [before, now]; nearly all signals of nearly all flights are alike."""
    patterns = np.frombuffer(met, bool).reshape(_PATTERNS, _PATTERNS)
    levels = np.frombuffer(stood, bool).reshape(_LEVELS, _LEVELS)
    kinds = len(POSSIBLE[fitted])
    return Coverage(
        patterns=tuple(Pattern(i).label for i in np.flatnonzero(patterns.any(axis=0))),
        patterns_possible=kinds,
        levels=tuple(np.flatnonzero(levels.any(axis=0)).tolist()[::-1]),
        levels_possible=fitted + 1,
        pattern_transitions=tuple(f"{Pattern(a).label}>{Pattern(b).label}" for a, b in _moves(patterns)),
        pattern_transitions_possible=kinds * (kinds - 1),
        level_transitions=tuple(f"{a}>{b}" for a, b in _moves(levels)),
        level_transitions_possible=fitted * (fitted + 1),
    )


def _moves(seen: NDArray[np.bool_]) -> list[tuple[int, int]]:
    return [(int(a), int(b)) for a, b in np.argwhere(seen) if a != b]
