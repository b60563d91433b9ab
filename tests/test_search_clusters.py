"""Clusters of finds: around a best point, of one arm; each told with an interval that holds its true share."""

import subprocess
import sys
from collections.abc import Sequence
from itertools import count

import numpy as np
import pytest

from rig.studies.search.clusters import APART, Cluster, apart, clusters
from rig.studies.search.confirm_worst import Table
from rig.studies.search.objective import Measured
from rig.studies.search.rounds import NEAR, Draw
from rig.studies.search.worst_cases import MOST, worst_cases


def on_a_line(*shares: float, arm: int = 0, dimensions: int = 6) -> list[Draw]:
    return [Draw(arm, np.array([share, *[0.5] * (dimensions - 1)])) for share in shares]


def test_a_cluster_is_of_one_arm_and_near_its_best_point():
    draws = [*on_a_line(0.1, 0.1 + NEAR, 0.9, 0.95), *on_a_line(0.1, arm=1)]
    found = clusters(draws, [-5.0, -1.0, -2.0, -3.0, -4.0], [True] * 5)
    assert found == [Cluster(0, (0, 1)), Cluster(1, (4,)), Cluster(0, (3, 2))]


def test_a_point_belongs_to_the_nearest_cluster_and_one_that_violates_not_to_none():
    draws = on_a_line(0.1, 0.6, 0.4, 0.11)
    assert clusters(draws, [-3.0, -2.0, -1.0, -9.0], [True, True, True, False]) == [
        Cluster(0, (0,)),
        Cluster(0, (1, 2)),
    ]
    assert clusters(draws, [1.0] * 4, [False] * 4) == []


def test_a_cluster_is_as_wide_in_every_number_of_dimensions():
    for dimensions, together in ((6, 1), (1, 2)):  # 0.3 of one number is far
        draws = on_a_line(0.1, 0.4, dimensions=dimensions)
        assert len(clusters(draws, [0.0, 1.0], [True, True])) == together


def test_clusters_do_not_depend_on_the_order_of_draws_with_other_values():
    rng = np.random.default_rng(1)
    draws, values = [Draw(0, point) for point in rng.random((60, 3))], rng.random(60)
    order = rng.permutation(60)
    mixed = clusters([draws[i] for i in order], values[order].tolist(), [True] * 60)
    named = [tuple(int(order[i]) for i in each.places) for each in mixed]
    assert named == [each.places for each in clusters(draws, values.tolist(), [True] * 60)]


def test_candidates_of_a_cluster_are_apart():
    draws = on_a_line(0.5, 0.51, 0.65, 0.505, 0.1)
    assert apart(draws, range(5), 5) == [0, 2, 4] and apart(draws, range(5), 2) == [0, 2]
    assert 0.05 < APART < 0.15


class Simulated:
    """Scenarios of one fault that violate with a known probability, by the seed and the scenario alone."""

    def __init__(self) -> None:
        self.seeds: set[int] = set()

    @staticmethod
    def probability(table: Table) -> float:
        return min(1.0, sum(each["offset"] for each in table["faults"]))

    def __call__(self, tables: Sequence[Table]) -> list[Measured]:
        self.seeds |= {each["seed"] for each in tables}
        keys = [[each["seed"], *(round(1e6 * fault["offset"]) for fault in each["faults"])] for each in tables]
        drawn = [np.random.default_rng(key).random() for key in keys]
        return [
            Measured(u - self.probability(t), 0.0, u < self.probability(t)) for u, t in zip(drawn, tables, strict=True)
        ]


def simulated(search: int) -> tuple[list[tuple[float, float, float]], list[int]]:
    """The true share and the interval of each share that a search tells, and the clusters' flights."""
    rng, fly = np.random.default_rng(search), Simulated()
    draws = [Draw(int(arm), rng.random(6) * 0.3) for arm in np.repeat(np.arange(MOST), 24)]  # a cluster an arm
    tables: list[Table] = [
        {"duration_s": 20.0, "faults": [{"kind": "offset", "offset": size} for size in sizes]}
        for sizes in rng.random((len(draws), 2)) * rng.uniform(0.02, 0.6, len(draws))[:, None]
    ]
    flown = fly([{**table, "seed": i} for i, table in enumerate(tables)])
    groups = clusters(draws, [each.value for each in flown], [each.violated for each in flown])
    before = set(fly.seeds)
    cases = worst_cases(groups, draws, tables.__getitem__, count(1000 * (search + 1)), fly)
    told = [one for each in cases for one in {id(c): c for c in (each.found, each.smallest)}.values()]
    assert not before.intersection(seed for one in told for seed in one.seeds)
    shares = [(fly.probability(one.table), one.share.low or 0.0, one.share.high or 1.0) for one in told]
    return shares, [len(each.cluster.places) for each in cases]


def test_at_least_95_percent_of_the_intervals_hold_the_true_share_of_what_was_chosen():
    told, flights = zip(*(simulated(search) for search in range(16)), strict=True)  # 80 clusters
    shares = [share for each in told for share in each]
    held = [low <= true <= high for true, low, high in shares]
    assert sum(map(len, flights)) >= 2 * 40 and len(held) > 80
    assert sum(held) >= 0.95 * len(held)


def test_the_first_case_violates_most_often_and_is_told_on_seeds_of_its_own():
    seen: list[tuple[int, ...]] = []

    def fly(tables: Sequence[Table]) -> list[Measured]:
        seen.append(tuple(each["seed"] for each in tables))
        return [Measured(-1.0, 0.0, each["seed"] % 10 < each["of"]) for each in tables]

    draws = [*on_a_line(0.1), *on_a_line(0.1, arm=1)]
    groups = clusters(draws, [-2.0, -1.0], [True, True])
    cases = worst_cases(groups, draws, lambda place: {"of": 2 if place == 0 else 9, "faults": []}, count(), fly)
    assert [(each.cluster.arm, each.found.violations) for each in cases] == [(1, 18), (0, 4)]
    told = {seed for each in cases for seed in each.found.seeds}
    assert not told.intersection(seed for of in seen if not set(of) <= told for seed in of)
    assert all(each.smallest is each.found for each in cases)


@pytest.mark.parametrize("module", ["clusters", "worst_cases"])
def test_clusters_of_any_plant_load_no_flight(module: str):
    code = (
        f"import sys, rig.studies.search.{module}; print('jsbsim' in sys.modules or 'rig.flight.loop' in sys.modules)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "False"
