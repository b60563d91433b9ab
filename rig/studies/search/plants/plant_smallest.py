"""The smallest input of a plant that still violates: signals in few parts, two digits, numbers near zero."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.studies.campaign.campaign_file import Range, Vary
from rig.studies.search.plants.plant_file import SignalRange
from rig.studies.search.plants.plant_space import PlantSpace
from rig.studies.search.regions import in_parts
from rig.studies.search.rounds import Draw, Point
from rig.studies.search.shrink import shrunk

_PARTS: Final = (0.5, 0.75, 0.9)  # that are left of the way to the number nearest to zero
_DIGITS: Final = (2, 3)
Places = NDArray[np.intp]


def smaller(space: PlantSpace, draw: Draw, violates: Callable[[Draw], bool]) -> list[Draw]:
    """Return ``draw``, then each smaller one that violates, the smallest last."""
    of = _Of(space, draw.arm)
    rounded = of.rounded
    points = shrunk(
        draw.point, (of.fewer_parts, rounded, of.nearer_zero), lambda point: violates(Draw(draw.arm, point)), (rounded,)
    )
    return [Draw(draw.arm, point) for point in points]


class _Of:
    """The steps for the points of one arm."""

    def __init__(self, space: PlantSpace, arm: int) -> None:
        signals = space.plan.signals
        of_signals = [of for of in signals.values() for _ in range(of.count)]
        count = space.arms[arm].dimensions - len(of_signals)
        names = list(space.arms[arm].valuers)[:count]
        self._ranges: list[Vary | SignalRange] = [*(space.plan.parameters[name] for name in names), *of_signals]
        self._alone = [np.array([i]) for i in range(count)]
        self._signals = [np.array(of) for of in space.pieces]
        self._zero = np.array([_nearest_zero(of) for of in self._ranges])  # share; NaN: not known

    def fewer_parts(self, point: Point) -> Iterator[Point]:
        """Draw signals in 1, 2, 4, ... equal parts of one level each: all signals at once, then each."""
        most = max((len(of) for of in self._signals), default=1)
        for parts in (1 << k for k in range(most.bit_length())):
            for several in ([self._signals] if len(self._signals) > 1 else []) + [[of] for of in self._signals]:
                tried = point.copy()
                for of in several:
                    level = in_parts(len(of), parts)
                    tried[of] = [point[of][level == part].mean() for part in level]
                if _stretches(tried, several) < _stretches(point, several):
                    yield tried

    def rounded(self, point: Point) -> Iterator[Point]:
        """Round all numbers."""
        for digits in _DIGITS:
            yield self._short(point, np.arange(len(point)), digits)

    def nearer_zero(self, point: Point) -> Iterator[Point]:
        """Move all numbers to zero, each number and each stretch of a signal, all a part of the way, each half way."""
        known = np.flatnonzero(~np.isnan(self._zero) & (np.abs(point - self._zero) > 1e-9))
        if not len(known):
            return
        stretches = [stretch for of in self._signals for stretch in np.split(of, _changes(point, of))]
        each = [found for of in (*self._alone, *stretches) if len(found := np.intersect1d(of, known))]
        alone = each if len(each) > 1 else []
        for several, factors in (([known], (0.0,)), (alone, (0.0,)), ([known], _PARTS), (alone, _PARTS[:1])):
            for factor in factors:
                for of in several:
                    yield self._moved(point, of, factor)

    def _moved(self, point: Point, places: Places, factor: float) -> Point:
        tried = point.copy()
        tried[places] = self._zero[places] + factor * (point[places] - self._zero[places])
        return self._short(tried, places, _DIGITS[0]) if factor else tried

    def _short(self, point: Point, places: Places, digits: int) -> Point:
        """Return a point whose values at ``places`` have so many digits, where their range is linear."""
        out = point.copy()
        for i in places.tolist():
            of = self._ranges[i]
            if isinstance(of, SignalRange) or (isinstance(of, Range) and not of.log and not of.whole):
                value = float(f"{of.low + out[i] * (of.high - of.low):.{digits}g}")
                out[i] = np.clip((value - of.low) / (of.high - of.low), 0.0, 1.0)
        return out


def _nearest_zero(of: Vary | SignalRange) -> float:
    """Return the share of the number of a range that is nearest to zero; NaN of a distribution."""
    if not isinstance(of, Range | SignalRange):
        return np.nan
    if isinstance(of, Range) and of.whole:
        return float(np.clip((0.5 - of.low) / (of.high - of.low + 1.0), 0.0, 1.0))
    return float(np.clip(-of.low / (of.high - of.low), 0.0, 1.0))


def _changes(point: Point, of: Places) -> Places:
    return np.flatnonzero(np.diff(point[of])) + 1


def _stretches(point: Point, signals: list[Places]) -> int:
    return sum(len(_changes(point, of)) for of in signals)
