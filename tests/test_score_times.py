"""Histograms of the wall clock in a score."""

import numpy as np

from rig.frame import TIMING
from rig.score.times import histogram, times


def test_a_time_on_an_edge_is_not_below_it():
    found = histogram(np.array([0.0, 9.99, 10.0, 19.0, 2e5, 100_000.0, 99_999.0]))
    assert {name: count for name, count in found.items() if count} == {
        "below_10_us": 2,
        "below_20_us": 2,
        "below_100000_us": 1,
        "more": 2,
    }
    assert sum(found.values()) == 7


def test_a_flight_without_clock_or_unit_has_no_times():
    timing = np.zeros(3, TIMING)
    assert times(timing) == {}
    timing["reply_us"] = 12.0
    assert times(timing) == {"replies": {**histogram(np.zeros(0)), "below_20_us": 3}}
