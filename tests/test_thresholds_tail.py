"""Peaks over a threshold, the law of their tail, and how it moves with other flights: known laws are recovered."""

from __future__ import annotations

import numpy as np
import pytest

from rig.studies.thresholds.tail import CLUSTERS, DRAWS, Peaks, draws, level, pareto, peaks, point, upper


def generalised_pareto(shape: float, scale: float, count: int):
    """Ascending quantiles of the law at the middle of ``count`` equal probabilities."""
    p = (np.arange(count) + 0.5) / count
    return scale * (-np.log1p(-p) if shape == 0 else ((1 - p) ** -shape - 1) / shape)


@pytest.mark.parametrize("shape", [0.0, 0.1, 0.3])
def test_scale_and_shape_of_a_known_law_are_recovered(shape: float):
    scale, found = pareto(generalised_pareto(shape, 2.0, 20_000))
    assert found[0] == pytest.approx(shape, abs=0.01)
    assert scale[0] == pytest.approx(2.0, rel=0.02)


def test_a_bounded_tail_is_taken_as_exponential_and_a_wild_one_as_a_half():
    bounded = np.linspace(0.01, 1.0, 100)
    assert pareto(bounded)[1][0] == 0.0
    assert pareto(bounded)[0][0] == pytest.approx(bounded.mean())
    assert pareto(generalised_pareto(0.95, 1.0, 5000))[1][0] == 0.5
    assert pareto(np.zeros(5))[0][0] == 0.0


def test_weights_count_an_excess_so_many_times():
    excess = np.sort(np.random.default_rng(0).exponential(size=12))
    times = np.array([[0, 1, 2, 0, 3, 1, 1, 0, 2, 1, 0, 4], [1] * 12], np.float64)
    scale, shape = pareto(excess, times)
    for row in range(2):
        alone = pareto(np.repeat(excess, times[row].astype(int)))
        assert scale[row] == pytest.approx(alone[0][0], rel=1e-12)
        assert shape[row] == pytest.approx(alone[1][0], abs=1e-12)


def test_the_return_level_is_exceeded_as_often_as_the_budget():
    scale, rate = np.array([2.0]), np.array([400.0])
    assert level(1.0, scale, np.zeros(1), rate, 4.0)[0] == pytest.approx(1.0 + 2.0 * np.log(100.0))
    shape = np.array([0.25])
    found = level(1.0, scale, shape, rate, 4.0)[0]
    chance = (1.0 + 0.25 * (found - 1.0) / 2.0) ** (-1.0 / 0.25)  # of the law to exceed it
    assert 400.0 * chance == pytest.approx(4.0)
    assert level(1.0, scale, shape, rate, 500.0)[0] == 1.0  # u is not exceeded so often


def bursts(heights: list[float], every: int, width: int, ripple: float = 0.0):
    series = ripple * np.random.default_rng(1).random(every * len(heights))
    for k, height in enumerate(heights):
        series[k * every + 10 : k * every + 10 + width] = height
    return series


def test_a_burst_is_one_cluster_and_its_peak_counts():
    heights = [5.0 + k / 10 for k in range(50)]
    found = peaks([bursts(heights, 200, 20, 1.0)], [100.0], 1.0)
    assert found.clusters >= CLUSTERS
    assert np.array_equal(found.excess + found.u, heights[-found.clusters :])
    together = peaks([bursts(heights, 60, 20, 1.0)], [100.0], 1.0)  # 0.4 s apart: all one
    assert together.clusters < CLUSTERS


def test_clusters_do_not_reach_from_one_flight_into_the_next():
    ends = np.zeros(1000)
    ends[-5:] = 2.0
    begins = ends[::-1].copy()
    found = peaks([ends, begins] * 30, [100.0] * 60, 1.0)
    assert found.clusters == 60
    assert np.bincount(found.block).tolist() == [1] * 60
    assert found.hours == pytest.approx(np.full(60, 1000 / 360_000))


def test_a_large_budget_takes_a_threshold_that_is_exceeded_more_often():
    series = [np.random.default_rng(k).normal(size=30_000) for k in range(4)]
    few, many = peaks(series, [100.0] * 4, 1.0), peaks(series, [100.0] * 4, 300.0)
    assert few.clusters >= CLUSTERS and many.clusters >= 2 * 300 * few.hours.sum() and many.u < few.u


def same_blocks(count: int) -> Peaks:
    excess = np.repeat(generalised_pareto(0.2, 1.0, 10), count)
    return Peaks(3.0, excess, np.tile(np.arange(count), 10), np.full(count, 0.5))


def test_flights_that_are_all_the_same_leave_nothing_to_doubt():
    found = same_blocks(8)
    spread = draws(found, 2.0, np.random.default_rng(0))
    assert len(spread) == DRAWS
    assert spread == pytest.approx(point(found, 2.0)[0], rel=1e-9)


def test_flights_are_drawn_and_not_clusters():
    """All events in one flight of five: without it, a third of the draws, the threshold is u."""
    few = Peaks(3.0, generalised_pareto(0.2, 1.0, 50), np.zeros(50, np.int64), np.ones(5))
    spread = draws(few, 1.0, np.random.default_rng(0))
    assert np.mean(spread == 3.0) == pytest.approx(0.8**5, abs=0.05)
    assert upper(spread) > point(few, 1.0)[0]
    assert np.array_equal(spread, draws(few, 1.0, np.random.default_rng(0)))
