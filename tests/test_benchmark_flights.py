"""Flights of a benchmark: the draws of its trials, in the closed loop, each as if it were flown alone."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from benchmark_flights import plan
from numpy.random import SFC64, Generator

import rig
from rig.core.frame import INDEX, State
from rig.studies.benchmark import benchmark_trials as trials
from rig.studies.benchmark.benchmark_trials import Runner, Told, streams_of
from rig.studies.benchmark.calibration import Calibrated
from rig.studies.benchmark.entrants import OURS, Entrant
from rig.studies.benchmark.flights import Flier, flight_scenario, shared_out
from rig.studies.reliability.drawn import cell, drawn_values

CUSUM, MEDIAN, OWN = Entrant("cusum", "cusum"), Entrant("median", "median"), Entrant(OURS, OURS)
VALUES = {"cusum": {"allowance": 0.3}, "median": {}, OURS: {}}
KEYS = {OURS: {"threshold": 0.02, "threshold_triplex": 0.03, "persistence": 20}}


@pytest.fixture(scope="module")
def told() -> Told:
    both = [CUSUM, MEDIAN, OWN]
    names = {e.name: Calibrated(e.name, "pitch_rate", VALUES[e.name], keys=KEYS.get(e.name, {})) for e in both}
    return Told(both, {(name, "pitch_rate"): each for name, each in names.items()})


def test_a_flight_is_that_of_its_scenario_with_what_was_calibrated(told: Told, tmp_path: Path):
    unit = shared_out(trials.shared_out(plan(), 4, 0), 1)[2]
    rows = Flier(plan(), told)(unit)
    assert rows["manager"].to_list() == ["cusum", "median", OURS] and rows["trial"].to_list() == [0, 0, 0]
    made = cell(plan(), unit.number, named=False)
    values = drawn_values(made, 1, Generator(SFC64(streams_of(unit)[0])))
    scenario = flight_scenario(plan(), unit, 0, values)
    assert scenario.faults[0].start_s == values[0, "start_s"][0]
    threshold = scenario.redundancy.signals.pitch_rate.threshold
    size, drawn = scenario.faults[0].size, values[0, "rate_thresholds_per_s"][0]
    assert size is not None and not size.thresholds and size.value == pytest.approx(drawn * threshold)
    sets = {
        "cusum": {"redundancy.manager": "cusum", "redundancy.baselines.cusum.signals.pitch_rate.allowance": 0.3},
        OURS: {
            f"redundancy.signals.pitch_rate.{key}": value for key, value in {**KEYS[OURS], "slow_tests": False}.items()
        },
    }
    for name, overrides in sets.items():
        flight = rig.fly(scenario.resolved(), overrides=overrides, out=tmp_path)
        row, onset = rows.row(by_predicate=pl.col("manager") == name, named=True), scenario.faults[0].start_s
        assert row["lost"] is not flight.survived and (row["outcome"] == "isolated") == (flight.failed != {})
        failed = flight.recorded.rows["state"][:, INDEX["pitch_rate"], 1] == State.FAILED
        assert onset is not None and row["delay_s"] == pytest.approx(failed.argmax() / 100 - np.ceil(onset * 100) / 100)


def test_a_flight_has_the_fault_of_its_open_loop_trial(told: Told):
    unit = shared_out(trials.shared_out(plan(), 2, 3), 1)[0]
    made = cell(plan(), unit.number, named=False)
    values = drawn_values(made, 1, Generator(SFC64(streams_of(unit)[0])))
    trial = Runner(plan(), told)(unit).row(0, named=True)
    assert trial["size"] == pytest.approx(abs(values[0, "offset_thresholds"][0]))


def test_flights_are_shared_out_evenly_over_all_combinations():
    units = trials.shared_out(plan(), 600, 0)
    assert shared_out(units, 0) == [] and len(units) == 24
    assert [unit.trials for unit in shared_out(units, 13)] == [2] * 12
    assert {unit.chunk for unit in shared_out(units, 13)} == {0}
