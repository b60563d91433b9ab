"""The form of a method: it yields the next draws, a round at a time, and is sent their results.

A round is the unit of interruption: what a method yields depends only on its arguments and the results that it was
sent, in their order.  Nothing here needs a campaign or a flight.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

LEAST_FIRST: Final = 24  # draws before a method chooses, and a tenth of all
EACH: Final = 4  # of them for each arm, while they are at most half of all
Method = Literal["regions", "cma", "random"]
Point = NDArray[np.float64]  # (dimensions,) of the unit cube
NEAR: Final = 0.35  # radius of a region in six dimensions; see ``radius``
_RANDOM: Final = 0  # spawn key of the generators


class Space(Protocol):
    """An arm, as a method sees it: a unit cube."""

    @property
    def dimensions(self) -> int:
        """Return the number of varied numbers."""
        ...


class Result(Protocol):
    """The worth of a draw."""

    @property
    def value(self) -> float:
        """Return the minimised number, which is finite."""
        ...

    @property
    def violated(self) -> bool:
        """Return True if the draw is a find."""
        ...


@dataclass(frozen=True, slots=True)
class Draw:
    """A point of an arm."""

    arm: int
    point: Point


# Yields draws, is sent their results; the smallest is best.  Its value: how the method stands when no draw is left.
Schedule = Generator[list[Draw], Sequence[Result], str]


def drive(schedule: Schedule, results_of: Callable[[list[Draw]], Sequence[Result]]) -> str:
    """Let a method draw to its end; return how it stands there, "" if there is nothing to tell."""
    draws = next(schedule)
    while True:
        results = results_of(draws)
        try:
            draws = schedule.send(results)
        except StopIteration as end:
            return str(end.value)


def radius(dimensions: int) -> float:
    """Return the radius of a region; distances in a cube grow with the root of its dimensions."""
    return NEAR * math.sqrt(dimensions / 6.0)


def first_count(arms: Sequence[Space], draws: int) -> int:
    """Return the number of draws before a method chooses: 24 or a tenth; EACH for each arm, up to half of all."""
    return min(draws, max(LEAST_FIRST, -(-draws // 10), min(EACH * len(arms), draws // 2)))


def in_turn(arms: Sequence[Space], count: int, seed: int) -> list[int]:
    """Return the arms of ``count`` draws, from all in turn; chance decides which are left out."""
    order = np.random.default_rng([seed, len(arms)]).permutation(len(arms)).tolist() if count < len(arms) else None
    return [order[i] if order else i % len(arms) for i in range(count)]


def random_draws(arms: Sequence[Space], count: int, seed: int) -> list[Draw]:
    """Return random draws, from the arms in turn."""
    rngs: dict[int, np.random.Generator] = {}
    draws = []
    for arm in in_turn(arms, count, seed):
        rng = rngs.setdefault(arm, np.random.default_rng([seed, arm, 0, _RANDOM]))
        draws.append(Draw(arm, rng.random(arms[arm].dimensions)))
    return draws


def at_random(arms: Sequence[Space], draws: int, seed: int) -> Schedule:
    """Yield random draws alone."""
    yield random_draws(arms, draws, seed)
    return ""
