"""The clusters of a search over a plant, each simulated again: with seeds, or at points, that did not choose it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from rig.core.progress import tell
from rig.studies.campaign.statistics import proportion
from rig.studies.search.clusters import Cluster, apart, clusters
from rig.studies.search.plants.plant_rounds import Simulated, Simulating, seeds_of
from rig.studies.search.rounds import Draw
from rig.verdict.requirements.robustness import number_of

MOST: Final = 5  # clusters that are confirmed
CONFIRM: Final = 20  # simulations whose share is told
_CHOOSE: Final = 5  # seeds on which the worst of as many candidates is chosen
_FRESH: Final = 1 << 31  # number of the first simulation that confirms: no draw has it
_WIDER: Final = 0.02  # of the cube, on each side of a cluster: one that is a point has neighbours too
_POINTS: Final = 58  # spawn key of the points


def found_in(draws: Sequence[Draw], results: Sequence[Simulated]) -> list[Cluster]:
    """Return the clusters of the draws that violate."""
    return clusters(draws, [each.value for each in results], [each.violated for each in results])


def confirmed(
    simulating: Simulating, draws: Sequence[Draw], results: Sequence[Simulated], found: Sequence[Cluster], seed: int
) -> list[dict[str, Any]]:
    """Return the figures of the first MOST clusters, those that violate most often first, then the largest."""
    told = []
    for number, cluster in enumerate(found[:MOST]):
        tell(f"confirming cluster {number + 1} of {min(len(found), MOST)}")
        again = _Again(simulating, seed, number)
        if simulating.takes_seed:
            place, shown, on = *again.with_seeds(draws, cluster), "new seeds"
        else:
            place, shown, on = (
                cluster.places[0],
                again.at_points(draws, cluster),
                f"new points within {100 * _WIDER:g} % of its ranges",
            )
        violate = sum(each.violations for each in shown)
        share = proportion(violate, CONFIRM)
        told.append(
            {
                "arm": simulating.space.arms[cluster.arm].name,
                "simulations": len(cluster.places),
                "robustness": number_of(results[cluster.places[0]].robustness),
                "number": place + 1,
                "inputs": _plain(simulating.space.inputs(cluster.arm, draws[place].point)),
                "ranges": ranges(simulating, draws, cluster),
                "confirmed": [violate, CONFIRM],
                "interval": [share.low, share.high],
                "confirmed_on": on,
            }
        )
    return sorted(told, key=lambda each: (-each["confirmed"][0], -each["simulations"]))


class _Again:
    """Further simulations of one cluster."""

    def __init__(self, simulating: Simulating, seed: int, number: int) -> None:
        self._simulating, self._seed, self._number = simulating, seed, number

    def with_seeds(self, draws: Sequence[Draw], cluster: Cluster) -> tuple[int, list[Simulated]]:
        """Return the place of the worst of a few apart, and its results on seeds that did not choose it."""
        places = apart(draws, cluster.places, _CHOOSE)
        first = _FRESH + self._number * (_CHOOSE + CONFIRM)
        few, many = seeds_of(self._seed, first, _CHOOSE), seeds_of(self._seed, first + _CHOOSE, CONFIRM)
        chosen = self._round("choosing", [draws[place] for place in places], [few for _ in places])
        worst = min(range(len(places)), key=lambda i: (-chosen[i].violations, chosen[i].robustness, i))
        return places[worst], self._round("confirming", [draws[places[worst]]], [many])

    def at_points(self, draws: Sequence[Draw], cluster: Cluster) -> list[Simulated]:
        """Return the results at random points of the box around the cluster's draws, a little wider."""
        points = np.array([draws[place].point for place in cluster.places])
        rng = np.random.default_rng([self._seed, _POINTS, self._number])
        low, high = np.clip([points.min(axis=0) - _WIDER, points.max(axis=0) + _WIDER], 0.0, 1.0)
        drawn = rng.uniform(low, high, (CONFIRM, points.shape[1]))
        return self._round("confirming", [Draw(cluster.arm, point) for point in drawn], [[0]] * CONFIRM)

    def _round(self, what: str, draws: Sequence[Draw], seeds: Sequence[Sequence[int]]) -> list[Simulated]:
        return self._simulating.round(f"{what}/{self._number}.json", draws, seeds)


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


def _plain(inputs: dict[str, Any]) -> dict[str, Any]:
    return {name: of.tolist() if isinstance(of, np.ndarray) else of for name, of in inputs.items()}
