"""An instance in another unit: a constant factor between what the instances measure."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from rig.bench.diagnose.findings import Convention, Findings
from rig.bench.diagnose.sensor_groups import Group
from rig.bench.diagnose.smoothing import changes, smoothed, spread
from rig.log.recordings.stamps import Floats


class _Factor(NamedTuple):
    """A factor between two units, and the unit of the smaller and of the larger numbers."""

    factor: float
    small: str
    large: str


_FACTORS: Final = {
    "gyro": (_Factor(57.29578, "rad/s", "deg/s"),),
    "accel": (_Factor(9.80665, "g", "m/s^2"),),
    "": (
        _Factor(57.29578, "rad", "deg"),
        _Factor(9.80665, "g", "m/s^2"),
        _Factor(100.0, "a unit 100 times as large", "the smaller unit, as Pa against hPa"),
        _Factor(1e3, "a unit 1000 times as large", "the smaller unit, as milligauss against gauss"),
        _Factor(1e4, "a unit 10000 times as large", "the smaller unit, as gauss against tesla"),
    ),
}
_ALIKE: Final = 1.35  # a factor is accepted within this of a standard one
_SAME: Final = 2.5  # instances of one unit may differ in gain and filter by this
_CORRELATED: Final = 0.5  # of the sizes of what changes, so that noise of two instruments is no motion
_STEADY: Final = 10.0  # spreads that a level is away from zero, to be compared itself


def take_off_units(group: Group, x: Floats, rows: int, found: Findings) -> None:
    """Tell an instance whose unit differs, and convert it in ``x`` (axes, C, n), without NaN.

    Angles that wrap are left: each was unrolled to within half a turn of the first, so sizes do not show a unit.
    """
    if group.first.wraps:
        return
    levels = _levels(x) if group.kind != "gyro" else None
    sizes = levels if levels is not None else _motions(x, rows)
    if sizes is None:
        return
    odd = _odd(sizes)
    if odd is None:
        return
    ratio = float(sizes[odd] / np.median(np.delete(sizes, odd)))
    known = _FACTORS[group.kind if group.kind in _FACTORS else ""]
    best = min(known, key=lambda each: abs(abs(np.log(ratio)) - np.log(each.factor)))
    if abs(abs(np.log(ratio)) - np.log(best.factor)) > np.log(_ALIKE):
        return
    if len(sizes) == 2:  # of two the numbers that are not in the unit of the signal
        wrong_is_large = group.kind != "accel"
        if (ratio > 1.0) != wrong_is_large:
            odd, ratio = 1 - odd, 1.0 / ratio
    factor = best.factor if ratio > 1.0 else 1.0 / best.factor
    instance = group.instances[odd]
    unit = best.large if ratio > 1.0 else best.small
    named = len(sizes) > 2 or group.kind in ("gyro", "accel")
    text = f"measures {ratio:.3g} times the others, about {factor:.4g}: it is in {unit}"
    matrix = tuple(tuple(row) for row in (np.eye(len(x)) / factor).tolist())
    found.conventions.append(Convention(group.name, instance, "unit", factor, text, named, matrix=matrix))
    x[:, odd] /= factor


def _levels(x: Floats) -> Floats | None:
    """Return the usual length (C,) of x where all instances stay away from zero; None: they do not."""
    lengths = np.linalg.norm(x, axis=0)
    middle = np.median(lengths, axis=-1)
    spreads = np.array([spread(length) for length in lengths])
    return middle if (middle > _STEADY * spreads).all() and (middle > 0).all() else None


def _motions(x: Floats, rows: int) -> Floats | None:
    """Return how much each instance (C,) changes within ``rows`` rows; None if they do not change together."""
    lag = max(rows, 1)
    made = changes(smoothed(smoothed(x, lag), lag), lag)
    sizes = np.array([float(np.linalg.norm([spread(axis) for axis in made[:, c]])) for c in range(x.shape[1])])
    lengths: Floats = np.sqrt((made**2).sum(axis=0))
    if not (np.ptp(lengths, axis=-1) > 0).all():
        return None
    odd = _odd(sizes)
    if odd is None:
        return sizes
    together = np.asarray(np.corrcoef(lengths))[odd]
    return sizes if np.median(np.delete(together, odd)) > _CORRELATED else None


def _odd(sizes: Floats) -> int | None:
    """Return the one instance whose size differs from all others, which agree; of two the second."""
    count = len(sizes)
    agree = np.abs(np.log(sizes[:, None] / sizes[None])) < np.log(_SAME)
    if agree.all():
        return None
    if count == 2:
        return 1
    odd = [c for c in range(count) if agree.sum(axis=1)[c] == 1 and np.delete(np.delete(agree, c, 0), c, 1).all()]
    return odd[0] if len(odd) == 1 else None
