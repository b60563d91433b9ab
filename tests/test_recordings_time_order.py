"""A lone wrong stamp goes, and its neighbours with the fault in them stay."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from time import process_time

import numpy as np
import polars as pl
import pytest

from rig.bench.vote_rows import vote
from rig.core.errors import BadInput
from rig.log.recordings.read import read
from rig.log.recordings.stamps import clock
from rig.log.recordings.time_order import out_of_order
from rig.log.recordings.vote_config import VoteConfig

N = 400
T = np.arange(N) / 100


def longest(stamps: tuple[float, ...]) -> int:
    """Length of the longest rising subsequence, by trying all."""
    sizes = range(len(stamps), 0, -1)
    return next(k for k in sizes for some in combinations(stamps, k) if all(np.diff(some) > 0))


def test_the_fewest_rows_are_dropped_and_the_others_rise():
    rng = np.random.default_rng(5)
    for _ in range(100):
        stamps = rng.integers(0, 6, 8).astype(float)
        kept = np.delete(stamps, out_of_order(stamps))
        assert (np.diff(kept) > 0).all() and len(kept) == longest(tuple(stamps))


def test_of_rows_with_one_stamp_and_of_two_equal_choices_the_first_stays():
    assert out_of_order(np.array([0.0, 1.0, 1.0, 1.0, 2.0])).tolist() == [2, 3]
    assert out_of_order(np.array([0.0, 1.0, 2.0, 1.0, 2.0, 3.0])).tolist() == [3, 4]


@pytest.mark.parametrize("row", [0, 1, 200, N - 2, N - 1])
@pytest.mark.parametrize("off_s", [500.0, -500.0, 1.7e9])
def test_a_lone_wrong_stamp_goes_alone(row: int, off_s: float):
    stamps = T + 1000.0
    stamps[row] += off_s
    accepted = clock("a", stamps, repair=True)
    assert accepted.kept is not None and accepted.kept.tolist() == [k for k in range(N) if k != row]
    assert accepted.repair is not None and accepted.repair.first == [row + 1]


@pytest.mark.parametrize("row", [1, 200, N - 2])
def test_without_repair_the_refusal_counts_one_row(row: int):
    stamps = T + 1000.0
    stamps[row] += 500.0
    with pytest.raises(BadInput, match=rf"must rise, .*; 1 row is out of order \({row + 1}\); --repair-time drops it"):
        clock("a", stamps)


def test_rows_before_the_clock_was_set_go():
    stamps = T + np.where(np.arange(N) < 30, 5.0, 1.7e9)
    accepted = clock("a", stamps, repair=True)
    assert accepted.repair is not None and accepted.repair.dropped == 30 and accepted.time_s[0] == stamps[30]
    assert len(clock("a", stamps).time_s) == N  # told as a gap, and left


def test_a_pause_between_two_flights_is_no_wrong_stamp():
    stamps = T + np.where(np.arange(N) < 30, 0.0, 3600.0)
    assert clock("a", stamps, repair=True).repair is None


def test_a_clock_that_was_set_back_is_refused_and_not_dropped():
    stamps = T - np.where(np.arange(N) < 250, 0.0, 3600.0)
    with pytest.raises(BadInput, match=r"rows 251 to 400 have other times, .*a clock that was set, not wrong stamps"):
        clock("a", stamps, repair=True)


def test_the_fault_after_a_wrong_stamp_is_still_there(tmp_path: Path):
    stamps = T.copy()
    stamps[100] = 77.0
    x = {f"x.{c}": np.zeros(N) for c in (1, 2, 3)}
    x["x.3"][300:] = 9.0
    pl.DataFrame({"time_s": stamps, **x}).write_csv(tmp_path / "in.csv")
    config = VoteConfig(default={"threshold": 1.0, "persistence": 8})
    recorded = read(tmp_path / "in.csv", config, repair=True)
    (failure,) = vote(recorded, config.signals(["x"], ""), [])["x"].failures
    assert (failure.channel, failure.frame, failure.time_s) == (3, 308, pytest.approx(3.07))


def test_half_a_million_rows_take_seconds():
    stamps = np.arange(500_000) / 100 + np.random.default_rng(1).normal(0.0, 0.02, 500_000)
    began = process_time()
    out_of_order(stamps)
    assert process_time() - began < 8.0
