"""A search by any method over arms that are unit cubes, without flights."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rig.studies.search.regions import regions
from rig.studies.search.rounds import Draw, Schedule, Space, drive

Method = Callable[[Sequence[Space], int, int], Schedule]


class Cube(NamedTuple):
    """An arm of which only the dimensions are known."""

    dimensions: int


class Worth(NamedTuple):
    """A result; below zero it is a find."""

    value: float

    @property
    def violated(self) -> bool:
        return self.value < 0.0


def cube(count: int, dimensions: int = 5) -> list[Cube]:
    return [Cube(dimensions)] * count


def searched(
    space: Sequence[Space], draws: int, value: Callable[[Draw], float], seed: int = 0, method: Method = regions
) -> tuple[list[list[Draw]], list[float]]:
    """All lists of draws that a method asks for, and all values."""
    lists, values, _ = searched_to_the_end(space, draws, value, seed, method)
    return lists, values


def searched_to_the_end(
    space: Sequence[Space], draws: int, value: Callable[[Draw], float], seed: int = 0, method: Method = regions
) -> tuple[list[list[Draw]], list[float], str]:
    """As ``searched``, with how the method stands when no draw is left."""
    lists: list[list[Draw]] = []
    values: list[float] = []

    def results_of(asked: list[Draw]) -> list[Worth]:
        lists.append(asked)
        values.extend(new := [value(draw) for draw in asked])
        return [Worth(each) for each in new]

    standing = drive(method(space, draws, seed), results_of)
    return lists, values, standing
