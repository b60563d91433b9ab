"""Runs, beginnings and clusters against a count by hand and a plain loop."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rig.core.runs import cluster_starts, runs, runs_where


def test_runs_of_nothing_are_none():
    assert runs(np.zeros(0)).shape == (0, 2)
    assert runs_where(np.zeros(0, bool)).shape == (0, 2)
    assert len(cluster_starts(np.zeros(0, np.int64))) == 0


@given(st.lists(st.integers(0, 2), min_size=1, max_size=30))
def test_runs_cover_all_rows_once_and_neighbours_differ(numbers):
    values = np.array(numbers)
    spans = runs(values)
    assert np.concatenate([np.arange(first, end) for first, end in spans]).tolist() == list(range(len(values)))
    assert all(len(set(numbers[first:end])) == 1 for first, end in spans)
    assert all(numbers[end - 1] != numbers[end] for _, end in spans[:-1])


def test_a_run_of_true_ends_before_its_second_number():
    assert runs_where(np.array([1, 1, 0, 1, 0, 0, 1], bool)).tolist() == [[0, 2], [3, 4], [6, 7]]


def test_a_cluster_begins_after_more_than_the_gap():
    assert cluster_starts(np.array([0, 1, 4, 5, 9])).tolist() == [0, 2, 4]
    assert cluster_starts(np.array([0, 1, 4, 5, 9]), gap=3).tolist() == [0, 4]
