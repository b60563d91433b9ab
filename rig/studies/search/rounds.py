"""The next flights: random ones over the arms, then rounds of generations, in which the worse half of the arms pauses.

The schedule depends only on its arguments and the values that it gets, in their order.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from rig.core.errors import BadInput
from rig.studies.search.cma_es import Strategy, population
from rig.studies.search.space import Arm, Point

LEAST_RANDOM: Final = 24  # and a tenth of all draws
EACH: Final = 5  # random draws of an arm, at least
GENERATIONS: Final = 2  # of a round
ALL: Final = 4  # in every fourth round no arm pauses
Method = Literal["cma", "random"]
_RANDOM: Final = 0  # spawn key, see cma_es


@dataclass(frozen=True, slots=True)
class Draw:
    """A point of an arm."""

    arm: int
    point: Point


Values = Sequence[float]
Schedule = Generator[list[Draw], Values, None]  # yields draws, is sent their values; the smallest is best


def random_count(arms: Sequence[Arm], draws: int, method: Method = "cma") -> int:
    """Return the number of random draws.  BadInput: too few for the arms, or none left for a generation."""
    count = draws if method == "random" else max(LEAST_RANDOM, -(-draws // 10))
    if count < EACH * len(arms):
        enough = EACH * len(arms) * (1 if method == "random" else 10)
        raise BadInput(
            f"--flights: {count} random draws over {len(arms)} arms are fewer than {EACH} each; give {enough} or more"
        )
    largest = max(population(arm.dimensions) for arm in arms)
    if method == "cma" and draws < count + largest:
        raise BadInput(f"--flights: {draws} draws are too few for {count} random ones and a population of {largest}")
    return count


def schedule(arms: Sequence[Arm], draws: int, seed: int, method: Method = "cma") -> Schedule:
    """Yield the next draws, a list at a time, at most ``draws`` in all."""
    first = random_draws(arms, random_count(arms, draws, method), seed)
    values = yield first
    if method == "random":
        return
    best = [min(values[i] for i in range(len(first)) if first[i].arm == a) for a in range(len(arms))]
    strategies = [Strategy(_starts(first, values, a), seed, a) for a in range(len(arms))]
    left, number, active = draws - len(first), 0, list(range(len(arms)))
    while True:
        active = active if number % ALL else list(range(len(arms)))
        before = left
        for _ in range(GENERATIONS):
            left = yield from _generation(strategies, sorted(active, key=lambda a: (best[a], a)), left, best)
        if left == before:
            return  # no complete generation
        active = sorted(active, key=lambda a: (best[a], a))[: math.ceil(len(active) / 2)]
        number += 1


def random_draws(arms: Sequence[Arm], count: int, seed: int) -> list[Draw]:
    """Return random draws, from the arms in turn."""
    rngs = [np.random.default_rng([seed, a, 0, _RANDOM]) for a in range(len(arms))]
    return [Draw(i % len(arms), rngs[i % len(arms)].random(arms[i % len(arms)].dimensions)) for i in range(count)]


def _starts(first: Sequence[Draw], values: Values, arm: int) -> list[Point]:
    """Return the random points of an arm, the best first."""
    ranked = sorted((values[i], i) for i in range(len(first)) if first[i].arm == arm)
    return [first[i].point for _, i in ranked]


def _generation(
    strategies: Sequence[Strategy], active: Sequence[int], left: int, best: list[float]
) -> Generator[list[Draw], Values, int]:
    """Yield one complete generation of each active arm within ``left`` draws; return the number that is left."""
    asked: list[Draw] = []
    sizes: dict[int, int] = {}
    for arm in active:
        size = strategies[arm].population
        if size <= left - len(asked):
            asked += [Draw(arm, point) for point in strategies[arm].ask()]
            sizes[arm] = size
    if not asked:
        return left
    values, at = (yield asked), 0
    for arm, size in sizes.items():
        own = values[at : at + size]
        strategies[arm].tell(own)
        best[arm], at = min(best[arm], *own), at + size
    return left - len(asked)
