"""The space of a plant: a combination of listed values is an arm; ranges and the values of signals are a unit cube."""

from __future__ import annotations

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from rig.core.errors import BadInput
from rig.studies.campaign.campaign_file import Levels, Range
from rig.studies.campaign.sampling import valuer
from rig.studies.search.plants.plant_file import PlantPlan
from rig.studies.search.space import MOST_ARMS, Arm, Point


class PlantSpace(NamedTuple):
    """The arms of a plan, and the places of the values of each signal in a point."""

    plan: PlantPlan
    arms: list[Arm]
    pieces: list[list[int]]

    def inputs(self, arm: int, point: Point) -> dict[str, Any]:
        """Return the arguments of the plant at a point: numbers, and of a signal its values (count,)."""
        chosen = self.arms[arm].choice(point)
        out = {name: chosen[name] for name in self.plan.parameters}
        for name, of in self.plan.signals.items():
            out[name] = np.array([chosen[_key(name, i)] for i in range(of.count)])
        return out


def space_of(plan: PlantPlan) -> PlantSpace:
    """Return the space of a plan.  BadInput: too many combinations of listed values."""
    listed = {name: of.values for name, of in plan.parameters.items() if isinstance(of, Levels)}
    count = int(np.prod([len(values) for values in listed.values()], dtype=object))
    if count > MOST_ARMS:
        raise BadInput(f"parameters: {count} combinations of listed values; at most {MOST_ARMS} are allowed")
    varied = {name: valuer(of) for name, of in plan.parameters.items() if not isinstance(of, Levels)}
    pieces, first = list[list[int]](), len(varied)
    for name, of in plan.signals.items():
        value = valuer(Range(low=of.low, high=of.high))
        varied |= {_key(name, i): value for i in range(of.count)}
        pieces.append(list(range(first, first + of.count)))
        first += of.count
    arms = [Arm(dict(zip(listed, values, strict=True)), varied) for values in product(*listed.values())]
    return PlantSpace(plan, arms, pieces)


def _key(signal: str, i: int) -> str:
    return f"{signal}[{i}]"
