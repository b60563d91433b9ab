"""Rows a second by stamps of few decimals: those of the recorder, not of one rounded interval."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.bench.vote_rows import params_of
from rig.log.recordings.read import read
from rig.log.recordings.stamps import rows_a_second
from rig.log.recordings.vote_config import RecordedSignal, VoteConfig


@given(
    rate_hz=st.sampled_from([7, 30, 60, 70, 120, 144, 300, 400]),
    decimals=st.integers(3, 9),
    start_s=st.sampled_from([0.0, 0.123456, 1_700_000_000.25]),
    lost=st.sets(st.integers(1, 1500), max_size=200),
)
def test_the_rate_is_that_whose_instants_were_rounded(rate_hz: int, decimals: int, start_s: float, lost: set[int]):
    rows = np.delete(np.arange(1600), sorted(lost))
    assert rows_a_second(np.round(start_s + rows / rate_hz, decimals)) == rate_hz


def test_at_400_hz_of_milliseconds_gaps_of_four_rows_are_counted_as_four():
    """The median interval is 3 ms, of which ten are 3.3."""
    rows = np.delete(np.arange(1600), np.concatenate([np.arange(k, k + 3) for k in range(5, 1590, 8)]))
    assert rows_a_second(np.round(rows / 400, 3)) == 400.0


@pytest.mark.parametrize("rate_hz", [59.94, 62.5, 99.7, 0.5])
def test_a_rate_that_is_no_whole_number_is_that_of_the_median_interval(rate_hz: float):
    time_s = np.arange(5000) / rate_hz
    assert rows_a_second(time_s) == pytest.approx(rate_hz, rel=1e-9)


def test_a_clock_that_drifts_or_jitters_has_its_median_interval():
    rng = np.random.default_rng(0)
    drifts, jitters = np.arange(2000) * 0.01 * (1 + 1e-4), np.cumsum(rng.uniform(0.008, 0.012, 2000)).astype(np.float64)
    for time_s in (drifts.astype(np.float64), jitters):
        assert rows_a_second(time_s) == 1.0 / np.median(np.diff(time_s))


@pytest.mark.parametrize("time_s", [[0.0, 0.017], [0.0, 0.01, 0.02], [0.0, 0.003, 0.006]])
def test_where_the_decimals_leave_several_rates_open_it_is_that_of_the_median_interval(time_s: list[float]):
    assert rows_a_second(np.array(time_s)) == pytest.approx(1.0 / np.median(np.diff(time_s)), rel=1e-9)
    assert rows_a_second(np.array(time_s[:1])) == 1.0


@pytest.mark.parametrize("decimals", [3, 4, 6, 9])
def test_a_persistence_in_seconds_has_the_same_rows_whatever_the_decimals_of_the_stamps(tmp_path: Path, decimals: int):
    """0.1 s are 30 rows of 300 a second; of milliseconds the median interval says 333 a second, and 34."""
    rows = np.arange(900)
    columns = {f"gyro.{channel}": np.zeros(900) for channel in (1, 2, 3, 4)}
    path = tmp_path / "in.csv"
    settings = RecordedSignal(threshold=1.0, persistence_s=0.1, split_persistence_s=0.1)
    pl.DataFrame({"time_s": np.round(rows / 300.0, decimals), **columns}).write_csv(path)
    recording = read(path, VoteConfig())
    (params,) = params_of(recording, {"gyro": settings})
    assert (params["persistence"], params["split_persistence"]) == (30, 30)
