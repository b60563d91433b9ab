"""A search by any method over arms that are unit cubes, without flights."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from rig.studies.search.regions import regions
from rig.studies.search.rounds import Draw, Schedule, Space

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
    coming, lists, values = method(space, draws, seed), [], []
    asked = next(coming)
    while True:
        lists.append(asked)
        new = [value(draw) for draw in asked]
        values += new
        try:
            asked = coming.send([Worth(each) for each in new])
        except StopIteration:
            return lists, values
