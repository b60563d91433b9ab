"""Histograms of the wall clock in a score."""

import numpy as np

from rig.core.frame import TIMING, new_block
from rig.flight.time_histogram import BINS, Times, binned, keyed
from rig.verdict.of_log import Miss, misses


def test_a_time_on_an_edge_is_not_below_it():
    found = keyed(binned(np.array([0.0, 9.99, 10.0, 19.0, 2e5, 100_000.0, 99_999.0])))
    assert {name: count for name, count in found.items() if count} == {
        "below_1_us": 1,
        "below_10_us": 1,
        "below_20_us": 2,
        "below_100000_us": 1,
        "more": 2,
    }
    assert sum(found.values()) == 7


def test_a_flight_without_clock_or_unit_has_no_times():
    timing = np.zeros(3, TIMING)
    times = Times()
    times.add(timing)
    assert times.as_dict() == {}
    timing["reply_us"] = 12.0
    times.add(timing)
    assert times.as_dict() == {"replies": {**keyed(np.zeros(BINS, int)), "below_1_us": 3, "below_20_us": 3}}


def test_misses_are_told_by_their_frames_and_first_status():
    rows = new_block(10, 5)
    rows["unit"] = [1, 2, 2, 1, 6, 4, 5, 1, 1, 2]
    assert misses(rows) == [Miss(6, 7, "held"), Miss(9, 10, "refused"), Miss(14, 14, "held")]
    rows["unit"] = 0
    assert misses(rows) == []
