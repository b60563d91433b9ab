"""The next draws by a forest over arm and point: one region of finds after the other.

First a Sobol sequence in each arm.  Then rounds of eight: of many candidates, most of them near the best points, those
that a forest of extremely randomised trees expects to be worst, or is unsure of (Geurts, Ernst and Wehenkel, Machine
Learning 63, 2006).  A region, a ball around its best point, is closed when it is full, with ENOUGH finds, or after
PATIENCE poor rounds; the next region begins at the best point outside.  A search that cannot leave its first basin
depends on chance: where half of the cube is flat, its best random point decides.  A search that never comes back wastes
its draws where no other basin is: after a poor region the full ones are open again, for ENOUGH finds more.

The forest is imported only here and late: the import takes seconds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.studies.search.rounds import Draw, Result, Schedule, Space, first_count, in_turn, radius

if TYPE_CHECKING:
    from scipy.stats.qmc import Sobol

ROUND: Final = 8  # draws
ENOUGH: Final = 24  # finds that fill a region
PATIENCE: Final = 4  # poor rounds that close it
_SEVERAL: Final = 2  # finds of a round that is not poor
EXPLORE: Final = 3 / 8  # of a round, taken anywhere until the region has a find
_APART: Final = 0.08  # between the draws of a round
_BETTER: Final = 1e-3  # of a value, that counts
_FLAT: Final = 0.1  # share of points of the least value beyond which nothing shows the way
_TREES: Final = 40
_CANDIDATES: Final = 600
_LOCAL: Final = 0.65  # of the candidates
_STEP: Final = 0.12
_STEPS: Final = (0.3, 1.0, 2.0)  # times _STEP
_BEST: Final = 10  # points that have neighbours among the candidates
_LEARNT: Final = 1000  # points of which a forest learns: the best and the last ones
_COLUMNS: Final = 64  # arms that have a column each; more arms have the digits of their numbers
_RNG, _SOBOL = 47, 48  # spawn keys of the generators


def forest_version() -> str:
    """Return the libraries that decide the draws, for the identity of a search; imports none."""
    return ", ".join(f"{name} {version(name)}" for name in ("scikit-learn", "scipy"))


def regions(
    arms: Sequence[Space],
    draws: int,
    seed: int,
    *,
    pieces: Sequence[Sequence[int]] = (),
    starts: Sequence[Draw] = (),
    size: int = ROUND,
) -> Schedule:
    """Yield the next draws, a round at a time, ``draws`` in all.

    starts : draws that another search recommends, made after the first ones; size : of a round
    pieces : of every arm, for each signal the places of its pieces in the point, in the order of time.  A signal is
        first drawn in 1, 2, 4, ... equal parts, and stretches of it move together.
    """
    rng, cubes = np.random.default_rng([seed, _RNG]), _Cubes(arms, seed, pieces)
    flown = _Flown(arms)
    first = first_count(arms, draws)
    asked = [cubes.even(arm) for arm in in_turn(arms, first, seed)]
    flown.add(asked, (yield asked))
    if asked := list(starts[: draws - len(flown)]):
        flown.add(asked, (yield asked))
    best, waited = math.inf, 0
    while len(flown) < draws:
        while not flown.open.any() or flown.found() >= flown.enough or waited >= PATIENCE:
            flown.close()
            best, waited = math.inf, 0
        count = min(size, draws - len(flown))
        chance = 0 if flown.found() else count if flown.flat() else math.ceil(EXPLORE * count)
        asked = _expected(flown, cubes, count - chance, rng)
        while len(asked) < count:
            untried = flown.untried(asked)
            arm = untried[0] if untried else int(rng.integers(len(arms)))
            asked.append(cubes.even(arm) if len(asked) % 2 else cubes.uniform(arm, rng))
        results = yield asked
        flown.add(asked, results)
        now = float(flown.value[flown.open].min()) if flown.open.any() else math.inf
        better = now < best - _BETTER and not flown.full  # where finds are known, a slope alone is little
        waited = 0 if better or sum(each.violated for each in results) >= _SEVERAL else waited + 1
        best = min(best, now)
    return flown.standing() if len(flown) > first else ""


def _expected(flown: _Flown, cubes: _Cubes, count: int, rng: Generator) -> list[Draw]:
    """Return at most ``count`` candidates outside of closed regions, of the least mean minus one deviation, apart."""
    if count == 0:
        return []
    top = flown.ranked()[:_BEST]
    picked = [top[min(int(rng.exponential(0.25 * _BEST)), len(top) - 1)] for _ in range(int(_LOCAL * _CANDIDATES))]
    tried = [cubes.moved(flown.draws[i], rng) for i in picked]
    tried += [cubes.uniform(int(arm), rng) for arm in rng.integers(cubes.arms, size=_CANDIDATES - len(tried))]
    outside = flown.outside(tried)
    tried = [draw for draw, is_open in zip(tried, outside, strict=True) if is_open]
    taken: list[Draw] = []
    for i in np.argsort(flown.forecast(tried, int(rng.integers(1 << 30))), kind="stable") if tried else ():
        if len(taken) == count:
            break
        near = (each for each in taken if each.arm == tried[i].arm)
        if all(np.linalg.norm(each.point - tried[i].point) > _APART for each in near):
            taken.append(tried[i])
    return taken


def best_apart(draws: Sequence[Draw], values: Sequence[float]) -> Iterator[int]:
    """Yield the place of the best draw of each region, the best first; no region begins within another."""
    arm, point = _places(draws, max(len(draw.point) for draw in draws))
    left = np.argsort(values, kind="stable")
    while len(left):
        yield int(left[0])
        left = left[~_within(draws[left[0]], arm[left], point[left])]


def in_parts(count: int, parts: int) -> NDArray[np.intp]:
    """Return of each of ``count`` pieces (count,) the first one of its part, of as many about equal ``parts``."""
    parts = min(parts, count)
    return np.arange(count) * parts // count * count // parts


class _Cubes:
    """Points of the arms: evenly spread, by chance, and near others."""

    def __init__(self, arms: Sequence[Space], seed: int, pieces: Sequence[Sequence[int]]) -> None:
        self._dimensions = [arm.dimensions for arm in arms]
        self._seed, self._pieces = seed, [list(of_signal) for of_signal in pieces]
        self._sequences: dict[int, Sobol] = {}
        self.arms = len(arms)
        self._drawn = [0] * len(arms)

    def even(self, arm: int) -> Draw:
        """Return the next point of the arm's Sobol sequence, each signal in 1, 2, 4, ... equal parts in turn."""
        from scipy.stats.qmc import Sobol

        if arm not in self._sequences:
            rng = np.random.default_rng([self._seed, _SOBOL, arm])
            self._sequences[arm] = Sobol(self._dimensions[arm], scramble=True, rng=rng)
        point = self._sequences[arm].random(1)[0]
        for of in self._pieces:
            parts = 1 << (self._drawn[arm] % (1 + math.ceil(math.log2(len(of)))))
            point[of] = point[np.array(of)[in_parts(len(of), parts)]]
        self._drawn[arm] += 1
        return Draw(arm, point)

    def uniform(self, arm: int, rng: Generator) -> Draw:
        """Return a random point."""
        return Draw(arm, rng.random(self._dimensions[arm]))

    def moved(self, draw: Draw, rng: Generator) -> Draw:
        """Return a neighbour within the cube: a few numbers moved, or a stretch of one signal as a whole."""
        old = draw.point
        if self._pieces and rng.random() < 0.5:
            of = self._pieces[rng.integers(len(self._pieces))]
            first, last = sorted(rng.integers(0, len(of), 2).tolist())
            stretch, point = of[first : last + 1], old.copy()
            to_level = rng.random() < 0.5
            level, step = rng.choice([0.0, 1.0, rng.random()]), rng.normal(0.0, 2.0 * _STEP)
            point[stretch] = level if to_level else point[stretch] + step
        else:
            few = rng.random(len(old)) < max(0.2, min(0.6, 4.0 / len(old)))
            step = rng.normal(0.0, _STEP * rng.choice(_STEPS), len(old))
            point = np.where(few, old + step, old)
        return Draw(draw.arm, np.clip(point, 0.0, 1.0))


class _Flown:
    """The draws with their results, and which of them are outside of closed regions."""

    def __init__(self, arms: Sequence[Space]) -> None:
        self._dimensions = np.array([arm.dimensions for arm in arms])
        self._width = int(self._dimensions.max())
        self.draws: list[Draw] = []
        self.enough = ENOUGH
        self.full, self._poor = list[Draw](), list[Draw]()  # the centres of closed regions
        self.value, self._violated, self.open = np.zeros(0), np.zeros(0, bool), np.zeros(0, bool)
        self._arm, self._point = np.zeros(0, np.int64), np.zeros((0, self._width))
        self._tried = np.zeros(len(arms), bool)

    def __len__(self) -> int:
        return len(self.draws)

    def add(self, draws: Sequence[Draw], results: Sequence[Result]) -> None:
        """Take the results of the last draws."""
        arm, point = _places(draws, self._width)
        self._tried[arm] = True
        self.draws += draws
        self._arm, self._point = np.append(self._arm, arm), np.append(self._point, point, axis=0)
        self.value = np.append(self.value, [each.value for each in results])
        self._violated = np.append(self._violated, [each.violated for each in results])
        self.open = np.append(self.open, self.outside(draws))

    def ranked(self) -> NDArray[np.int64]:
        """Return the places of open points, the best first."""
        places = np.flatnonzero(self.open)
        return places[np.argsort(self.value[places], kind="stable")]

    def found(self) -> int:
        """Return the number of finds in the region around the best open point, outside of closed ones."""
        here = _within(self.draws[self.ranked()[0]], self._arm, self._point)
        return int((self._violated & self.open & here).sum())

    def close(self) -> None:
        """Close the region around the best open point; open the full ones where nothing better is known."""
        if self.open.any():
            is_full, centre = self.found() >= self.enough, self.draws[self.ranked()[0]]
            (self.full if is_full else self._poor).append(centre)
            self.open &= ~_within(centre, self._arm, self._point)
            if is_full:
                return
        if self.full:
            self.full.clear()
            self.enough += ENOUGH
        elif not self.open.any():
            self._poor.clear()
        self.open = self.outside(self.draws)

    def standing(self) -> str:
        """Return how many regions are closed, and why; and what the open one has."""
        full, poor = len(self.full), len(self._poor)
        which, found = "last" if full or poor else "first", self.found() if self.open.any() else 0
        parts = [
            f"{full} full with {self.enough} violations or more" if full else "",
            f"{poor} closed after {PATIENCE} poor rounds" if poor else "",
            f"the {which} is open with {found} violation{'s' * (found != 1)}" if self.open.any() else "none is open",
        ]
        again = f"; full ones were opened again, and are now full with {self.enough}" if self.enough > ENOUGH else ""
        return f"regions: {', '.join(filter(None, parts))}{again}"

    def outside(self, draws: Sequence[Draw]) -> NDArray[np.bool_]:
        """Return whether each point is outside of all closed regions."""
        arm, point = _places(draws, self._width)
        out = np.ones(len(draws), bool)
        for centre in (*self.full, *self._poor):
            out &= ~_within(centre, arm, point)
        return out

    def flat(self) -> bool:
        """Return True if too many open points share the least value for a forest to learn from."""
        value = self.value[self.open]
        return float((value <= value.min() + 1e-9).mean()) > _FLAT

    def untried(self, asked: Sequence[Draw]) -> list[int]:
        """Return the arms without a draw, those of ``asked`` included."""
        return sorted({*np.flatnonzero(~self._tried).tolist()} - {draw.arm for draw in asked})

    def forecast(self, candidates: Sequence[Draw], seed: int) -> NDArray[np.float64]:
        """Return the mean minus one standard deviation of the trees for each candidate; the least is best."""
        from sklearn.ensemble import ExtraTreesRegressor

        learnt = self._learnt()
        y = _stretched(self.value[learnt])
        forest = ExtraTreesRegressor(_TREES, max_features=0.7, random_state=seed, n_jobs=1)
        forest.fit(self._encoded(self._arm[learnt], self._point[learnt]), y)
        code = self._encoded(*_places(candidates, self._width))
        of_trees = np.array([tree.predict(code) for tree in forest.estimators_])
        return of_trees.mean(0) - of_trees.std(0)

    def _learnt(self) -> NDArray[np.int64]:
        """Return the places of the points of which the forest learns: all, or the best half and the last half."""
        every = np.arange(len(self))
        if len(self) <= _LEARNT:
            return every
        best = np.argsort(self.value, kind="stable")[: _LEARNT // 2]
        return np.union1d(best, every[-(_LEARNT // 2) :])

    def _encoded(self, arm: NDArray[np.int64], point: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the columns of the forest: the point, then a column for each arm or each digit of its number."""
        count = len(self._dimensions)
        numbers = np.arange(count)
        if count <= _COLUMNS:
            codes = np.eye(count, dtype=np.float32)
        else:
            codes = ((numbers[:, None] >> np.arange(count.bit_length())) & 1).astype(np.float32)
        return np.hstack([point.astype(np.float32), codes[arm]])


def _places(draws: Sequence[Draw], width: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return arms and points, filled up to one width."""
    point = np.full((len(draws), width), 0.5)
    for i, draw in enumerate(draws):
        point[i, : len(draw.point)] = draw.point
    return np.array([draw.arm for draw in draws], np.int64), point


def _within(centre: Draw, arm: NDArray[np.int64], point: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which of the points are in the region around ``centre``."""
    d = len(centre.point)
    distance = np.linalg.norm(point[:, :d] - centre.point, axis=1)
    return (arm == centre.arm) & (distance <= radius(d))


def _stretched(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the ranks of the values, the good end stretched to their own distances."""
    ranks = np.argsort(np.argsort(value, kind="stable"), kind="stable") / len(value)
    middle = np.median(value)
    return ranks + np.minimum(0.0, (value - middle) / (middle - value.min() + 1e-9))
