"""The next draws by CMA-ES, for comparison: random ones first, then generations in each arm from its best point.

Hansen, The CMA Evolution Strategy: A Tutorial, 2016.  The package ``cma`` is imported only here and late, because the
import takes seconds.  Its seed 0 is the clock, and its instances share numpy's global generator, so each instance gets
its own generator and no seed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from rig.studies.search.rounds import Draw, Point, Schedule, Space, first_count, random_draws

STEP: Final = 0.25  # of the unit cube
NARROW: Final = 1e-3  # of the unit cube: smaller steps are not resolved by a search with flights
ALL: Final = 4  # in every fourth round no arm pauses
_STARTS: Final = 1  # spawn key of the generators; 0 draws the random flights


def cma(arms: Sequence[Space], draws: int, seed: int) -> Schedule:
    """Yield the next draws, a generation of each active arm at a time, ``draws`` in all; the worse half pauses."""
    first = random_draws(arms, first_count(arms, draws), seed)
    results = yield first
    starts: dict[int, list[Point]] = {}
    for i in sorted(range(len(first)), key=lambda i: results[i].value):
        starts.setdefault(first[i].arm, []).append(first[i].point)
    left, number = draws - len(first), 0
    strategies = [Strategy(of_arm, seed, arm) for arm, of_arm in starts.items()] if left else []  # the best arm first
    while left:
        half = math.ceil(len(strategies) / 2)
        active = strategies[:half] if number % ALL else strategies
        asked = [Draw(each.arm, point) for each in active for point in each.ask()][:left]
        values = [each.value for each in (yield asked)]
        left -= len(asked)
        for each in active if left else ():  # the last generation may be cut
            each.tell(values[: each.population])
            del values[: each.population]
        strategies.sort(key=lambda each: (each.best, each.arm))
        number += 1
    return f"CMA-ES began {sum(each.begun for each in strategies)} times, in {len(strategies)} of {len(arms)} arms"


class Strategy:
    """The generations of one arm: ``ask`` for points, ``tell`` their values; the smallest is best."""

    def __init__(self, starts: Sequence[Point], seed: int, arm: int) -> None:
        """Begin at the first of ``starts``, the arm's random points, best first; at the next where it ends."""
        self._starts, self._seed, self.arm = starts, seed, arm
        self.population = population(len(starts[0]))
        self.best, self.begun = math.inf, 0
        self._begin()

    def ask(self) -> list[Point]:
        """Return the points of the next generation, within the cube."""
        self._asked = self._cma.ask()
        return [_fold(point)[: len(self._starts[0])] for point in self._asked]

    def tell(self, values: Sequence[float]) -> None:
        """Take the values of the last generation; begin again if the strategy has come to its end."""
        self._cma.tell(self._asked, list(values))
        self.best = min(self.best, *values)
        if self._cma.stop():
            self._begin()

    def _begin(self) -> None:
        from cma import CMAEvolutionStrategy

        rng = np.random.default_rng([self._seed, self.arm, self.begun, _STARTS])
        start = self._starts[self.begun % len(self._starts)]
        self.begun += 1
        options: dict[str, Any] = {
            "seed": math.nan,
            "randn": lambda *shape: rng.standard_normal(shape),
            "popsize": self.population,
            "tolx": NARROW,
            "tolfun": 1e-9,
            "verbose": -10,  # neither prints nor reads and writes files
            "verb_log": 0,
        }
        padded = [*start, *[0.5] * (2 - len(start))]  # the package refuses one dimension
        self._cma = CMAEvolutionStrategy(padded, STEP, options)


def population(dimensions: int) -> int:
    """Return the size of a generation for a number of dimensions, from the package."""
    return 4 + int(3 * math.log(max(dimensions, 2)))


def _fold(point: Point) -> Point:
    """Return a point mirrored into the unit cube at its faces."""
    return 1.0 - np.abs(1.0 - np.mod(point, 2.0))
