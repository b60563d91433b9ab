"""Axes of an instance that are flipped or swapped, and instances that are mounted at an angle.

Flips and swaps are found by the correlations of every axis with every axis, over a range of delays: a flipped axis
turns only its own sign, a delay turns all.  An angle is the rotation of least squares (orthogonal Procrustes) of
what changes, and is accepted if both halves of the log show it and two directions move in both instances.
"""

from __future__ import annotations

from itertools import combinations, permutations, product
from typing import Final, NamedTuple

import numpy as np

from rig.bench.diagnose.findings import Convention, Findings
from rig.bench.diagnose.sensor_groups import AXES, Group
from rig.bench.diagnose.smoothing import changes, smoothed, without_hum
from rig.log.recordings.stamps import Floats

TAKEN_OFF_DEG: Final = 20.0  # from here on: smaller ones are no better known than the motion
TOLD_DEG: Final = 4.0
_AGREE_DEG: Final = 5.0  # of the halves of the log, or a third of the angle
_CORRELATED: Final = 0.4  # of an axis that is said to be flipped or swapped
_BETTER: Final = 0.6  # sum of three correlations, of other axes less that of the same axes
_BETTER_IN_HALVES: Final = 0.2  # the same in each half of the log
_LEFT: Final = 0.3  # of the difference, with other axes; twice that in each half
_SHARED: Final = 0.5  # correlation of the second direction in which both move
_SAME_TURN: Final = 2.6  # trace of one turn back and the other forth, of 3: within 37 deg
_DELAY_S: Final = 0.3
_SAMPLED_HZ: Final = 50.0
_GRAVITY: Final = 3.0  # m/s^2, of an axis whose sign gravity shows
_WITHIN_S: Final = {"accel": 2.0}  # changes within this; 0.5 s of others
_PERMUTATIONS: Final = [
    np.diag(signs)[list(order)] for order in permutations(range(3)) for signs in product((1, -1), repeat=3)
]


class Turn(NamedTuple):
    """The orthogonal matrix that turns one instance into another, and whether it is made of whole axes."""

    matrix: Floats
    whole: bool

    @property
    def degrees(self) -> float:
        """Return the angle of rotation; 180 of a matrix that mirrors."""
        return 180.0 if np.linalg.det(self.matrix) < 0 else rotation_deg(self.matrix)


def take_off_axes(group: Group, x: Floats, found: Findings) -> float:
    """Tell how instances are turned and take off what is large in ``x`` (3, C, n), without NaN.

    Return the angle that stays in it, degrees.
    """
    count = x.shape[1]
    motion = _Motion.of(group, x)
    turns = {pair: _sure(motion, *pair) for pair in combinations(range(count), 2)}
    large = {p: t is not None and t.degrees > TAKEN_OFF_DEG for p, t in turns.items()}
    odd = _odd(large, count)
    if odd is None:
        return _tell_small(group, turns, found)
    pair = next(pair for pair in turns if odd in pair)
    turn = turns[pair]
    assert turn is not None  # it is large
    matrix = turn.matrix if pair[0] == odd else turn.matrix.T
    mirrored, named = np.linalg.det(matrix) < 0, count > 2
    what = _axes(matrix) if turn.whole else f"turned by {rotation_deg(matrix):.0f} deg"
    kind = "axes" if turn.whole and mirrored else "mounting"
    value = what if kind == "axes" else round(rotation_deg(matrix), 1)
    text = (
        f"{what}, which no mounting explains: a flipped or swapped axis" if mirrored else f"mounted otherwise: {what}"
    )
    turned = tuple(tuple(row) for row in matrix.tolist())
    convention = Convention(
        group.name, group.instances[odd], kind, value, text, named, angle=not turn.whole, matrix=turned
    )
    found.conventions.append(convention)
    x[:, odd] = np.einsum("ab,bn->an", matrix, x[:, odd])
    return 0.0 if turn.whole else _AGREE_DEG


def _odd(large: dict[tuple[int, int], bool], count: int) -> int | None:
    """Return the one instance of every large turn, the others being alike; of two the second."""
    if not any(large.values()):
        return None
    odd = [c for c in range(count) if all(is_large == (c in pair) for pair, is_large in large.items())]
    return 1 if count == 2 else odd[0] if len(odd) == 1 else None


def _tell_small(group: Group, turns: dict[tuple[int, int], Turn | None], found: Findings) -> float:
    """Tell angles that are not taken off; return the largest, degrees."""
    told = {p: t.degrees for p, t in turns.items() if t is not None and TOLD_DEG < t.degrees < 180.0}
    count = group.x.shape[1]
    odd = _odd({p: p in told for p in turns}, count)
    for (i, j), angle in told.items():
        if odd is not None and (i, j) != next(p for p in told if odd in p):
            continue
        c = j if odd is None else odd
        of = "the others" if odd is not None and count > 2 else str(group.instances[i])
        text = f"turned by about {angle:.0f} deg to {of}; this is not corrected"
        named = odd is not None and count > 2
        convention = Convention(group.name, group.instances[c], "mounting", round(angle, 1), text, named, False)
        found.conventions.append(convention)
    return max(told.values(), default=0.0)


class _Motion(NamedTuple):
    """What the instances of a vector share: changes (3, C, n), values of as many rows or more, the longest delay."""

    changed: Floats
    values: Floats | None  # of accelerometers
    delay: int

    @property
    def level(self) -> Floats | None:
        """Return the usual values (3, C), gravity; None if it is not measured."""
        return None if self.values is None else np.median(self.values, axis=-1)

    @classmethod
    def of(cls, group: Group, x: Floats) -> _Motion:
        rate_hz = group.rate_hz
        step = max(1, round(rate_hz / _SAMPLED_HZ))
        quarter = max(1, round(0.25 * rate_hz))
        fine = smoothed(smoothed(x, quarter), quarter)[..., ::step]
        lag = max(1, round(_WITHIN_S.get(group.kind, 0.5) * rate_hz / step))
        lag = min(lag, max(1, fine.shape[-1] // 4))
        return cls(
            changes(fine, lag),
            fine if group.kind == "accel" else None,
            min(round(_DELAY_S * rate_hz / step), fine.shape[-1] // 8),
        )

    def part(self, rows: slice) -> _Motion:
        values = None if self.values is None else self.values[..., rows]
        return _Motion(self.changed[..., rows], values, self.delay)

    def without_hum(self) -> _Motion:
        """Return the motion without its two strongest frequencies."""
        return self._replace(changed=without_hum(self.changed))

    def lags(self) -> list[int]:
        """Return the delays that are tried, rows, the smallest first."""
        several = np.linspace(-self.delay, self.delay, 2 * min(self.delay, 8) + 1).round().astype(int)
        return sorted(np.unique(several).tolist(), key=abs)

    def halves(self) -> tuple[_Motion, _Motion]:
        """Return the two halves of the log."""
        n = self.changed.shape[-1]
        return self.part(slice(0, n // 2)), self.part(slice(n // 2, n))


def _sure(motion: _Motion, i: int, j: int) -> Turn | None:
    """Return how instance i is turned into instance j; None: the motion does not show it.

    A large turn must be there without the strongest frequencies, too.  A hum is coherent between instances, but has
    another phase in each of their axes, and looks like other axes.
    """
    turn = _turn(motion, i, j)
    if turn is None or turn.degrees <= TAKEN_OFF_DEG:
        return turn
    rest = _turn(motion.without_hum(), i, j)
    return turn if rest is not None and float((rest.matrix * turn.matrix).sum()) > _SAME_TURN else None


def _turn(motion: _Motion, i: int, j: int) -> Turn | None:
    """Return how instance i is turned into instance j; None: the motion does not show it."""
    if motion.changed.shape[-1] < 16:
        return None
    matrix, alike = _best_axes(motion, i, j)
    moved = [a for a in range(3) if matrix[a, a] != 1]
    if not moved or not all(float(matrix[a] @ alike[a]) > _CORRELATED for a in moved):
        return _rotation(motion, i, j)
    clear = _better(motion, i, j, matrix) > _BETTER
    clear = clear and all(_better(half, i, j, matrix) > _BETTER_IN_HALVES for half in motion.halves())
    left = [_left(part, i, j, matrix) for part in (motion, *motion.halves())]
    if clear or (left[0] < _LEFT and max(left) < 2.0 * _LEFT):
        return Turn(matrix, True)
    return None if _better(motion, i, j, matrix) > _BETTER else _rotation(motion, i, j)


def _best_axes(motion: _Motion, i: int, j: int) -> tuple[Floats, Floats]:
    """Return the signed permutation of axes that makes i most like j, and the correlations (3, 3) at its delay."""
    best, alike_best, top = np.eye(3), np.zeros((3, 3)), -np.inf
    for lag in motion.lags():
        alike = _correlations(motion, i, j, lag)
        sums = [float((p * alike).sum()) for p in _PERMUTATIONS]
        k = int(np.argmax(sums))
        if sums[k] > top + 1e-9:
            top, best, alike_best = sums[k], _PERMUTATIONS[k].astype(np.float64), alike
    return best, alike_best


def _better(motion: _Motion, i: int, j: int, matrix: Floats) -> float:
    """Return by how much a permutation correlates better than the same axes, the sum of three axes."""
    alike = [_correlations(motion, i, j, lag) for lag in motion.lags()]
    return max(float((matrix * each).sum()) for each in alike) - max(float(np.trace(each)) for each in alike)


def _left(motion: _Motion, i: int, j: int, matrix: Floats) -> float:
    """Return the share of the difference of changes that is left with other axes: small if axes move alike, too."""
    with_it = min(_apart(motion, i, j, lag, matrix) for lag in motion.lags())
    without = min(_apart(motion, i, j, lag, np.eye(3)) for lag in motion.lags())
    return with_it / (without + 1e-30)


def _apart(motion: _Motion, i: int, j: int, lag: int, matrix: Floats) -> float:
    a, b = _shifted(motion, i, j, lag)
    return float(np.mean((b - matrix @ a) ** 2))


def _shifted(motion: _Motion, i: int, j: int, lag: int) -> tuple[Floats, Floats]:
    """Return the changes of i, ``lag`` rows later, and of j."""
    a, b = motion.changed[:, i], motion.changed[:, j]
    return (a[:, lag:], b[:, : b.shape[1] - lag]) if lag >= 0 else (a[:, :lag], b[:, -lag:])


def _correlations(motion: _Motion, i: int, j: int, lag: int) -> Floats:
    """Return (3, 3) the correlation of each axis of j with each of i, i shifted by ``lag`` rows."""
    a, b = _shifted(motion, i, j, lag)
    a, b = a - a.mean(axis=1, keepdims=True), b - b.mean(axis=1, keepdims=True)
    sizes = np.sqrt((b**2).sum(axis=1))[:, None] * np.sqrt((a**2).sum(axis=1))[None]
    made = np.divide(b @ a.T, sizes, out=np.zeros((3, 3)), where=sizes > 0)
    level = motion.level
    if level is None:
        return made
    one, other = level[:, i], level[:, j]
    near = np.abs(np.log(np.maximum(np.abs(other)[:, None], 1e-9) / np.maximum(np.abs(one)[None], 1e-9))) < 0.35
    heavy = (np.abs(one)[None] > _GRAVITY) & (np.abs(other)[:, None] > _GRAVITY)
    return np.where(heavy & near, np.sign(other)[:, None] * np.sign(one)[None], made)


def _rotation(motion: _Motion, i: int, j: int) -> Turn | None:
    """Return the rotation of least squares from i to j, if both halves show it."""
    if _second_shared(motion.changed[:, i], motion.changed[:, j]) < _SHARED:
        return None
    whole, one, two = (_procrustes(*_directions(part, i, j)) for part in (motion, *motion.halves()))
    near = rotation_deg(one @ two.T) < max(_AGREE_DEG, rotation_deg(whole) / 3.0)
    return Turn(whole, False) if near else None


def _directions(motion: _Motion, i: int, j: int) -> tuple[Floats, Floats]:
    """Return (3, n) each what instances i and j measure in common; gravity is as good as motion."""
    a, b = motion.changed[:, i], motion.changed[:, j]
    level = motion.level
    if level is None:
        return a, b
    weight = np.sqrt(a.shape[1]) / 4.0
    return np.hstack([a, weight * level[:, [i]]]), np.hstack([b, weight * level[:, [j]]])


def _second_shared(a: Floats, b: Floats) -> float:
    """Return the second canonical correlation of (3, n) and (3, n): of one shared direction no rotation is known."""
    eye = 1e-9 * np.eye(3)
    root_a, root_b = (np.linalg.cholesky(m @ m.T + (np.trace(m @ m.T) + 1e-30) * eye) for m in (a, b))
    crossed = np.linalg.solve(root_b, np.linalg.solve(root_a, a @ b.T).T)
    return float(np.linalg.svd(crossed, compute_uv=False)[1])


def _procrustes(a: Floats, b: Floats) -> Floats:
    """Return the rotation matrix (3, 3) that turns a into b best; P. Schoenemann, Psychometrika 31 (1966)."""
    u, _, v = np.linalg.svd(b @ a.T)
    return u @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ v)))]) @ v


def rotation_deg(matrix: Floats) -> float:
    """Return the angle of an orthogonal matrix, a mirroring one as the rotation that it is times minus one."""
    trace = float(np.trace(matrix)) * float(np.sign(np.linalg.det(matrix)))
    return float(np.degrees(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))))


def _axes(matrix: Floats) -> str:
    """Return the axes that a signed permutation moves: y is -y."""
    found = []
    for k, row in enumerate(np.rint(matrix).astype(int)):
        of = int(np.flatnonzero(row)[0])
        if row[k] != 1:
            found.append(f"{AXES[k]} is {'-' if row[of] < 0 else ''}{AXES[of]}")
    return ", ".join(found)
