"""CMA-ES in the unit cube of one arm, started again when it stagnates.

Hansen, The CMA Evolution Strategy: A Tutorial, 2016.  The package ``cma`` is imported only here and late, because the
import takes seconds.  Its seed 0 is the clock, and its instances share numpy's global generator, so each instance gets
its own generator and no seed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from rig.studies.search.space import Point

STEP: Final = 0.25  # of the unit cube
MOST_DOUBLED: Final = 3  # times that a population is doubled
PATIENCE: Final = 24  # generations without a better flight
NARROW: Final = 1e-3  # of the unit cube: smaller steps are not resolved by a search with flights
_RESTARTS: Final = 1  # spawn key of the generators; 0 draws the random flights


class Strategy:
    """The generations of one arm: ``ask`` for points, ``tell`` their values; the smallest is best."""

    def __init__(self, starts: Sequence[Point], seed: int, arm: int) -> None:
        """Begin at the first of ``starts``, the arm's random flights, best first."""
        self._starts, self._seed, self._arm = starts, seed, arm
        self._restart = -1
        self._begin()

    @property
    def population(self) -> int:
        """Return the number of flights of the next generation."""
        return population(len(self._starts[0])) << min(self._restart, MOST_DOUBLED)

    def ask(self) -> list[Point]:
        """Return the points of the next generation, within the cube."""
        self._asked = self._cma.ask()
        return [_fold(point)[: len(self._starts[0])] for point in self._asked]

    def tell(self, values: Sequence[float]) -> None:
        """Take the values of the last generation; start again if the search stagnates."""
        self._cma.tell(self._asked, list(values))
        self._waited = 0 if min(values) < self._best else self._waited + 1
        self._best = min(self._best, *values)
        if self._waited >= PATIENCE or self._cma.stop():
            self._begin()

    def _begin(self) -> None:
        from cma import CMAEvolutionStrategy

        self._restart += 1
        rng = np.random.default_rng([self._seed, self._arm, self._restart, _RESTARTS])
        start = self._starts[self._restart % len(self._starts)]
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
        self._best, self._waited = math.inf, 0


def population(dimensions: int) -> int:
    """Return the first population for a number of dimensions, from the package."""
    return 4 + int(3 * math.log(max(dimensions, 2)))


def _fold(point: Point) -> Point:
    """Return a point mirrored into the unit cube at its faces."""
    return 1.0 - np.abs(1.0 - np.mod(point, 2.0))
