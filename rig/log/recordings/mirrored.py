"""Mirrored axes of a triad: a recorder whose axes are left-handed against those of the others.

No mounting mirrors an axis: a sign was left out, or two axes were exchanged.  The recorder is compared with the median
of the others.  The best orthogonal matrix between them (Schoenemann 1966) has determinant -1, and leaves much less of
the difference than the best rotation does; or one axis follows the others with the opposite sign, and two with theirs.
Both are looked at where the vector moves: in means of SMOOTHED rows, without their mean; and where the delay between
them, one for all axes of a recorder, is taken off.
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from rig.log.recordings.delays import MAX_DELAY, bridged
from rig.log.recordings.offset_moves import median_of
from rig.log.recordings.stamps import Floats

SMOOTHED: Final = 12  # rows; 0.1 s at 120 Hz
_FEWEST: Final = 64  # rows
_WHOLE: Final = 0.5  # of the samples of each axis, at least
_LEFT: Final = 0.5  # of what the best rotation leaves: more is no sign of a mirror
_FOLLOWS: Final = 0.5  # correlation of an axis with that of the others
_HINT: Final = 0.25  # of an axis that is named by the matrix
_TURNED_RAD: Final = np.pi / 6  # largest rotation beside the mirror for which the axis can be named
_SIGNS: Final = [np.array(s) for s in product((1.0, -1.0), repeat=3) if np.prod(s) < 0]


class Mirror(NamedTuple):
    """A recorder whose axes are mirrored; one of two if there are only two."""

    channel: int  # from 1
    axes: tuple[int, ...]  # that have the opposite sign, from 0; (): it cannot be told which
    of_two: bool = False


def mirrors(x: Floats) -> list[Mirror]:
    """Return the mirrored recorders of ``x`` (3, C, rows), NaN for a sample that is not valid."""
    count = x.shape[1]
    if count == 2:
        axes = _mirror(x[:, 0], x[:, 1])
        return [] if axes is None else [Mirror(1, axes, True)]
    every = set(range(count))
    found = {c: axes for c in every if (axes := _against(x, c, every - {c})) is not None}
    kept: list[Mirror] = []
    for c in found:  # once more without the others that were found: they are in the median
        others = every - found.keys()
        axes = _against(x, c, others) if others else found[c]
        if axes is not None:
            kept.append(Mirror(c + 1, axes))
    return kept


def _against(x: Floats, c: int, others: Collection[int]) -> tuple[int, ...] | None:
    return _mirror(x[:, c], np.array([median_of(columns[sorted(others)]) for columns in x]))


def _mirror(v: Floats, m: Floats) -> tuple[int, ...] | None:
    """Return the axes of v (3, rows) that are mirrored against m; (): not known which; None: it is not mirrored."""
    if v.shape[1] < _FEWEST + SMOOTHED + 2 * MAX_DELAY or min(np.isfinite(x).mean() for x in (*v, *m)) < _WHOLE:
        return None
    v, m = _at_least_delay(*(_moving(np.array([bridged(axis) for axis in x])) for x in (v, m)))
    left, sizes, right = np.linalg.svd(m @ v.T)
    power, total = float((m**2).sum() + (v**2).sum()), float(sizes.sum())
    is_mirror = np.linalg.det(left @ right) < 0
    by_rotation = power - 2.0 * (total - 2.0 * float(sizes[-1]))
    follows = np.array([_correlation(a, b) for a, b in zip(v, m, strict=True)])
    against = tuple(np.flatnonzero(follows < -_FOLLOWS).tolist())
    if is_mirror and power - 2.0 * total < _LEFT * by_rotation:
        named = _axes(left @ right)
        return named if all(follows[axis] < -_HINT for axis in named) else ()
    return against if len(against) % 2 and (np.abs(follows) > _FOLLOWS).all() else None


def _at_least_delay(v: Floats, m: Floats) -> tuple[Floats, Floats]:
    """Return v and m (3, rows) where they overlap when v is moved by the whole rows at which it resembles m most."""
    inner = m[:, MAX_DELAY:-MAX_DELAY]
    moved = [v[:, lag : lag + inner.shape[1]] for lag in range(2 * MAX_DELAY + 1)]
    alike = [float(np.linalg.svd(inner @ one.T, compute_uv=False).sum()) for one in moved]
    return moved[int(np.argmax(alike))], inner


def _axes(matrix: Floats) -> tuple[int, ...]:
    """Return the axes whose signs make the orthogonal ``matrix`` a small rotation; (): none do."""
    angles = [float(np.arccos(np.clip((np.trace(matrix * signs) - 1.0) / 2.0, -1.0, 1.0))) for signs in _SIGNS]
    best = int(np.argmin(angles))
    return tuple(np.flatnonzero(_SIGNS[best] < 0).tolist()) if angles[best] <= _TURNED_RAD else ()


def _moving(x: Floats) -> Floats:
    """Return means of SMOOTHED rows that follow each other, less their mean; x : (3, rows)."""
    sums = np.cumsum(np.concatenate([np.zeros((len(x), 1)), x], axis=1), axis=1)
    means = (sums[:, SMOOTHED:] - sums[:, :-SMOOTHED]) / SMOOTHED
    return means - means.mean(axis=1, keepdims=True)


def _correlation(a: Floats, b: Floats) -> float:
    power = float(a @ a) * float(b @ b)
    return float(a @ b) / power**0.5 if power > 0.0 else 0.0
