"""The clusters of a search over a plant, each simulated again: with seeds, or at points, that did not choose it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import Any, Final, NamedTuple

import numpy as np

from rig.core.progress import tell
from rig.studies.campaign.statistics import proportion
from rig.studies.search.clusters import Cluster, apart, clusters
from rig.studies.search.confirm_worst import SEEDS as CONFIRM
from rig.studies.search.plants.plant_rounds import Simulated, Simulating, seeds_of
from rig.studies.search.plants.plant_smallest import smaller
from rig.studies.search.rounds import Draw
from rig.studies.search.shrink import SEEDS, UNDO_SEEDS, on_most, simplest
from rig.studies.search.worst_cases import CANDIDATES, MOST
from rig.verdict.requirements.robustness import number_of

_FRESH: Final = 1 << 31  # number of the first simulation that confirms: no draw has it
_WIDER: Final = 0.02  # of the cube, on each side of a cluster: one that is a point has neighbours too
_POINTS: Final = 58  # spawn key of the points


def found_in(draws: Sequence[Draw], results: Sequence[Simulated]) -> list[Cluster]:
    """Return the clusters of the draws that violate."""
    return clusters(draws, [each.value for each in results], [each.violated for each in results])


class PlantCase(NamedTuple):
    """A cluster of a plant, simulated again."""

    figures: dict[str, Any]
    draw: Draw  # the worst case of the cluster
    seeds: list[int]  # of the simulation of the search
    smallest: Draw  # that still violates; ``draw`` if none is smaller
    smallest_seeds: list[int]


def confirmed(
    simulating: Simulating, draws: Sequence[Draw], results: Sequence[Simulated], found: Sequence[Cluster], seed: int
) -> list[PlantCase]:
    """Return the first MOST clusters, those that violate most often first, then the largest."""
    cases, repeats = [], simulating.space.plan.repeats
    for number, cluster in enumerate(found[:MOST]):
        tell(f"confirming cluster {number + 1} of {min(len(found), MOST)}")
        again = _Again(simulating, seed, number)
        place, again_figures, smallest, of_smallest = (
            again.with_seeds(draws, cluster) if simulating.takes_seed else again.at_points(draws, cluster)
        )
        figures = {
            "arm": simulating.space.arms[cluster.arm].name,
            "simulations": len(cluster.places),
            "robustness": number_of(results[cluster.places[0]].robustness),
            "number": place + 1,
            "inputs": inputs_of(simulating, draws[place]),
            "ranges": ranges(simulating, draws, cluster),
            **again_figures,
            "smallest": {"inputs": inputs_of(simulating, smallest), **of_smallest},
        }
        seeds = seeds_of(seed, place * repeats, repeats)
        cases.append(PlantCase(figures, draws[place], seeds, smallest, again.few))
    return sorted(cases, key=lambda each: (-each.figures["confirmed"][0], -each.figures["simulations"]))


class _Again:
    """Further simulations of one cluster."""

    def __init__(self, simulating: Simulating, seed: int, number: int) -> None:
        self._simulating, self._seed, self._number, self._tried = simulating, seed, number, 0
        counts = (SEEDS, CONFIRM, SEEDS, UNDO_SEEDS)
        left = iter(seeds_of(seed, _FRESH + number * sum(counts), sum(counts)))
        self.few, self._many, self._shrinking, self._undoing = (list(islice(left, count)) for count in counts)

    def with_seeds(self, draws: Sequence[Draw], cluster: Cluster) -> _Told:
        """Return what seeds tell that did not choose it of the worst of a few draws, and of a smaller one."""
        places = apart(draws, cluster.places, CANDIDATES)
        chosen = self._round("choosing", [draws[place] for place in places], [self.few for _ in places])
        worst = min(range(len(places)), key=lambda i: (-chosen[i].violations, chosen[i].robustness, i))
        draw = draws[places[worst]]
        kept = smaller(self._simulating.space, draw, lambda tried: on_most(tried, self._shrinking, self._violations))
        smallest = simplest(kept, self._undoing, self._violations)
        both = self._round("confirming", [draw, smallest], [self._many, self._many])
        shares = [_share(each.violations, "new seeds") for each in both]
        return _Told(places[worst], shares[0], smallest, shares[1])

    def at_points(self, draws: Sequence[Draw], cluster: Cluster) -> _Told:
        """Return what random points tell of the box around the cluster's draws, a little wider; and a smaller draw."""
        points = np.array([draws[place].point for place in cluster.places])
        rng = np.random.default_rng([self._seed, _POINTS, self._number])
        low, high = np.clip([points.min(axis=0) - _WIDER, points.max(axis=0) + _WIDER], 0.0, 1.0)
        drawn = rng.uniform(low, high, (CONFIRM, points.shape[1]))
        found = self._round("confirming", [Draw(cluster.arm, point) for point in drawn], [[0]] * CONFIRM)
        share = _share(sum(each.violations for each in found), f"new points within {100 * _WIDER:g} % of its ranges")
        place = cluster.places[0]
        smallest = smaller(self._simulating.space, draws[place], lambda tried: self._violations(tried, [0]) > 0)[-1]
        robustness = number_of(self._shrunk(smallest, [0]).robustness)
        return _Told(place, share, smallest, {"robustness": robustness})

    def _violations(self, draw: Draw, seeds: Sequence[int]) -> int:
        return self._shrunk(draw, seeds).violations

    def _shrunk(self, draw: Draw, seeds: Sequence[int]) -> Simulated:
        self._tried += 1
        name = f"shrinking/{self._number}-{self._tried}.json"
        return self._simulating.round(name, [draw], [seeds])[0]

    def _round(self, what: str, draws: Sequence[Draw], seeds: Sequence[Sequence[int]]) -> list[Simulated]:
        return self._simulating.round(f"{what}/{self._number}.json", draws, seeds)


class _Told(NamedTuple):
    """The further simulations of a cluster."""

    place: int  # of the worst case among the draws
    figures: dict[str, Any]
    smallest: Draw
    of_smallest: dict[str, Any]  # figures


def _share(violate: int, on: str) -> dict[str, Any]:
    share = proportion(violate, CONFIRM)
    return {"confirmed": [violate, CONFIRM], "interval": [share.low, share.high], "confirmed_on": on}


def ranges(simulating: Simulating, draws: Sequence[Draw], cluster: Cluster) -> dict[str, Any]:
    """Return the least and largest of each number of a cluster; of a signal a list, a pair for each of its values."""
    every = [simulating.space.inputs(cluster.arm, draws[place].point) for place in cluster.places]
    plan, out = simulating.space.plan, dict[str, Any]()
    for name in every[0]:
        if name in plan.signals:
            of = np.array([each[name] for each in every])
            out[name] = np.stack([of.min(axis=0), of.max(axis=0)], axis=1).tolist()
        elif name not in simulating.space.arms[cluster.arm].fixed:
            out[name] = [min(each[name] for each in every), max(each[name] for each in every)]
    return out


def inputs_of(simulating: Simulating, draw: Draw) -> dict[str, Any]:
    """Return the inputs of a draw; of a signal a list."""
    inputs = simulating.space.inputs(draw.arm, draw.point)
    return {name: of.tolist() if isinstance(of, np.ndarray) else of for name, of in inputs.items()}
