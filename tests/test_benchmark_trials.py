"""The same faults for all: what one entrant sees does not depend on the others; outcomes of made results."""

import numpy as np
import polars as pl
import pytest
from benchmark_flights import plan

from rig.bench.one_signal_trials import RESULT
from rig.core.errors import BadInput
from rig.studies.benchmark.benchmark_trials import Runner, Told, became, of_signals, shared_out
from rig.studies.benchmark.calibration import Calibrated
from rig.studies.benchmark.entrants import Entrant
from rig.studies.reliability.drawn import cell

CUSUM, MEDIAN = Entrant("cusum", "cusum"), Entrant("median", "median")


def rows(*entrants: Entrant, unit: int = 0) -> pl.DataFrame:
    told = Told(list(entrants), {(e.name, "pitch_rate"): Calibrated(e.name, "pitch_rate") for e in entrants})
    return Runner(plan(), told)(shared_out(plan(), 6, 5)[unit])


def test_what_an_entrant_sees_does_not_depend_on_who_else_takes_part_or_in_which_order():
    alone, first, last = rows(CUSUM), rows(CUSUM, MEDIAN), rows(MEDIAN, CUSUM)
    for others in (first, last):
        assert others.filter(pl.col("manager") == "cusum").equals(alone)
    assert first.filter(pl.col("manager") == "median").equals(last.filter(pl.col("manager") == "median"))
    baseline = rows(MEDIAN, MEDIAN._replace(name="again"))
    halves = [baseline.filter(pl.col("manager") == name).drop("manager") for name in ("median", "again")]
    assert halves[0].equals(halves[1])


def test_a_manager_that_fails_no_channel_misses_all_and_an_offset_moves_its_median_by_less_than_its_size():
    found = rows(MEDIAN)
    assert (found["kind"] == "offset").all() and (found["outcome"] == "missed").all()
    assert found["size"].is_between(0.1, 3.0).all() and found["size"].n_unique() == 6
    assert (found["peak"] < 0.5).all()


def made(*failed_at: list[int]) -> np.ndarray:
    found = np.zeros(len(failed_at), RESULT)
    found["failed_at"] = failed_at
    return found


def test_outcomes_by_who_was_failed_when():
    of = cell(plan(), 0, named=False)  # channel 2 alone
    results = made([-1, 1510, -1, -1], [-1, 1400, -1, -1], [1600, 1510, -1, -1], [-1, -1, 1499, -1], [-1] * 4)
    found = became(of, np.full(5, 1500), results)
    prior = "prior"
    assert found["outcome"].tolist() == ["isolated", prior, "wrong channel", prior, "missed"]
    assert found["delay_s"][0] == pytest.approx(0.1) and np.isnan(found["delay_s"][1:]).all()


def test_an_earlier_fault_that_was_isolated_is_no_isolation_before_the_onset():
    after = next(n for n in range(len(plan())) if plan().choices[n]["design"] == "after another")
    of = cell(plan(), after, named=False)  # channel 2 after channel 4
    found = became(of, np.array([1500]), made([-1, 1510, -1, 1480]))
    assert found["outcome"].tolist() == ["isolated"]


def test_a_campaign_without_a_fault_to_detect_is_refused():
    from rig.studies.campaign.campaign_file import read
    from rig.studies.campaign.plan import Plan

    healthy = Plan(read("docs/examples/benchmark_healthy.toml"), "healthy.toml")
    with pytest.raises(BadInput, match=r"healthy.toml: run \d+: has no fault to detect"):
        of_signals(healthy)
