"""Levels for a budget, against what is known of white noise; and what cannot be calibrated."""

from pathlib import Path

import numpy as np
import pytest
from benchmark_flights import RATE_HZ, white, white_signal
from scipy.stats import chi2

import rig
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.core.errors import BadInput
from rig.studies.benchmark.calibration import calibrate, require_time
from rig.studies.benchmark.calibration_data import measured, read
from rig.studies.benchmark.entrants import OURS, TESTS, TESTS_AND_SUMS, Entrant, entrants, isolates_no_channel, levels
from rig.studies.benchmark.healthy_flights import isolations, transients


@pytest.mark.long
def test_the_parity_limits_of_white_noise_are_those_of_chi_square_with_a_degree_less_than_samples():
    budget, sigma = 30.0, 0.1
    healthy = white(sigma, 10, 18_000)  # half an hour
    found = calibrate(Entrant("parity", "parity"), white_signal(), healthy, budget).values
    for name, samples in (("limit", 4), ("limit_triplex", 3), ("limit_duplex", 2)):
        expected = sigma**2 * chi2.isf(budget / 3600.0 / RATE_HZ, samples - 1)
        assert 0.9 * expected < found[name] < 1.35 * expected  # the upper end of 95 %, of the worst choice of channels


@pytest.mark.parametrize("name", ["cusum", "cross-voter", "selection"])
def test_a_calibrated_manager_keeps_the_budget_in_other_flights_and_three_quarters_of_its_level_do_not(name: str):
    budget, entrant, signal = 20.0, Entrant(name, name), white_signal()
    found = calibrate(entrant, signal, white(0.1, 10, 18_000), budget)
    others = white(0.1, 10, 18_000, seed=2).flights["pitch_rate"]
    smaller = {key: 0.75 * value for key, value in found.values.items()}
    assert isolations(entrant, signal, found.values, others) <= 20  # 10 are allowed in half an hour
    assert isolations(entrant, signal, smaller, others) > 25


def test_tests_leave_the_threshold_and_isolate_no_healthy_channel_nor_one_with_a_burst():
    healthy = white(0.01, 10, 6000)
    biases = np.random.default_rng(3).uniform(-0.2, 0.2, (10, 4))
    flights = [f._replace(samples=f.samples + b) for f, b in zip(healthy.flights["pitch_rate"], biases, strict=True)]
    healthy = healthy._replace(flights={"pitch_rate": flights})
    signal = white_signal(8)._replace(sensor=SlowTests(noise_std=0.01, bias_tolerance=0.125))
    plain, tested = (calibrate(Entrant(name, OURS), signal, healthy, 20.0) for name in (OURS, TESTS))
    assert tested.shown["threshold"] == plain.shown["threshold"] and 1.1 <= tested.shown["factor"] < 1.7
    assert tested.values["slow_means"] == tested.shown["factor"] and plain.values["slow_means"] == 0.0
    assert tested.keys["slow_tests"]["noise_std"] == 0.01
    assert plain.seen is not None and tested.seen is not None
    assert plain.seen + tested.seen <= 6  # 3.3 each are allowed in ten minutes
    for made in (plain, tested):
        found = transients(Entrant(made.manager, OURS), signal, made.values, flights)
        assert [(row["failed"], row["bursts"]) for row in found if row["frames"] == 7] == [(0, 110), (0, 110)]


def test_a_signal_whose_sensor_states_no_noise_has_no_tests_and_that_is_told():
    signal = white_signal(8)._replace(sensor=None)
    found = calibrate(Entrant(TESTS, OURS), signal, white(0.01, 10, 3000), 20.0)
    assert found.values["slow_means"] == 0.0 and "no slow-fault tests: CONFIG states no" in found.notes[0]


@pytest.mark.long
def test_tests_and_sums_are_what_thresholds_chooses_sums_where_noise_dominates():
    signal = white_signal(8)._replace(sensor=SlowTests(noise_std=0.1, bias_tolerance=0.01))
    found = calibrate(Entrant(TESTS_AND_SUMS, OURS), signal, white(0.1, 10, 9000), 20.0)
    assert found.values["slow_means"] >= 1.1
    if found.values["slow_limit"]:  # beside the tests the sums must find more, or they stay off
        assert 0.0 < found.values["slow_allowance"] < 0.1 and found.values["slow_limit"] > 24 * 0.05
        assert found.keys["slow_allowance"] == found.values["slow_allowance"]


def test_a_budget_that_no_level_reaches_is_told_with_what_was_counted():
    healthy = white(0.1, 4, 6000)
    for flight in healthy.flights["pitch_rate"]:
        flight.samples[1000:1500, 2] = 1e6
    with pytest.raises(
        BadInput, match=r"--budget 1: cross-voter: pitch_rate: no threshold reaches this rate; 64 still gives 4 "
    ):
        calibrate(Entrant("cross-voter", "cross-voter"), white_signal(), healthy, 1.0)


def test_too_little_healthy_time_says_how_much_is_needed():
    require_time(0.01, 1.0)
    with pytest.raises(
        BadInput, match=r"--healthy: 0.5 h is too short for 0.01 false isolations an hour; record at least 1 h"
    ):
        require_time(0.01, 0.5)


def test_flights_in_which_nothing_happens_are_too_few_events():
    healthy = white(0.0, 2, 6000)
    with pytest.raises(BadInput, match=r"--healthy: cusum: pitch_rate: 0 events in 0.0333 h, at least 10 needed"):
        calibrate(Entrant("cusum", "cusum"), white_signal(), healthy, 10.0)


def test_a_manager_that_fails_no_channel_at_its_least_limit_is_given_that_one_and_it_is_told():
    found = calibrate(Entrant("bayes", "bayes"), white_signal(), white(0.05, 2, 1500), 10.0)
    assert found.values["limit"] == 4.59 and found.seen == 0
    said = "bayes: pitch_rate: limit: no false isolation in 0.00833 h even at the lowest level allowed, 4.59"
    assert found.notes == [said]


def test_only_managers_that_fail_somebody_have_levels():
    signal = white_signal()
    asked = entrants("median,weighted,mean,parity,cusum")
    assert {e.name for e in asked if isolates_no_channel(e, signal)} == {"median", "weighted", "mean"}
    assert [(level.name, level.channels) for level in levels(asked[-2], signal)] == [
        ("limit", 4), ("limit_triplex", 3), ("limit_duplex", 2),
    ]  # fmt: skip


def test_a_baseline_is_told_the_spread_and_the_largest_mean_of_healthy_residuals():
    signal, healthy = white_signal(), white(0.1, 8, 3000)
    healthy.flights["pitch_rate"][3].samples[:, 2] += 1.0
    found = measured(Entrant("bayes", "bayes"), signal, healthy)
    assert set(found) == {"spread", "bias"} and found["bias"] == pytest.approx(1.0, abs=0.06)
    # The median of four normal samples has 0.298 of the variance of one, and a covariance of 1/4 with each.
    assert found["spread"] == pytest.approx(0.1 * np.sqrt(1.0 + 0.298 - 0.5), rel=0.05)
    rms = measured(Entrant("glr", "glr"), signal, white(0.1, 4, 3000))["rms"]
    assert rms == pytest.approx(0.1 * np.sqrt(1.0 + 0.298 - 0.5), rel=0.03)
    assert measured(Entrant("cross-voter", "cross-voter"), signal, healthy) == {}


def test_variants_are_told_and_calibrated_like_their_baseline():
    (long, guess) = entrants("cusum 120,parity guess middle")[4:]
    healthy = white(0.1, 8, 9000)
    found = calibrate(long, white_signal(), healthy, 20.0)
    short = calibrate(Entrant("cusum", "cusum"), white_signal(), healthy, 20.0)
    assert found.values["limit"] == 120.0 and found.values["allowance"] < short.values["allowance"]
    told = measured(guess, white_signal(), healthy)
    assert told["ties"] == "guess" and told["vote"] == "middle"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("cussum", "--managers: unknown manager"),
        ("cusum,cusum", "--managers: cusum: given more than once"),
        ("cusum 61", "--managers: cusum 61: unknown variant"),
        ("glr 60", "--managers: glr 60: glr has no variant '60'"),
        ("median guess", "--managers: median guess: median has no variant 'guess'"),
        ("cross-channel", "--managers: name one or more besides cross-channel"),
    ],
)
def test_managers_that_cannot_take_part_are_refused(given: str, said: str):
    with pytest.raises(BadInput, match=said):
        entrants(given)


def test_healthy_flights_of_a_rounded_rate_are_of_that_rate_and_of_another_rate_refused(tmp_path: Path):
    sets = ["faults=[]", "rate_hz=33.3333", "simulation_rate_hz=100", "duration_s=3"]
    rig.fly(overrides=sets, out=tmp_path)
    signal = white_signal()._replace(rate_hz=100.0 / 3.0)
    assert read(tmp_path, "f16", [signal]).hours == pytest.approx(3.0 / 3600.0)
    with pytest.raises(BadInput, match=r"flown at 33\.3333 frames a second, the campaign at 50"):
        read(tmp_path, "f16", [signal._replace(rate_hz=50.0)])
