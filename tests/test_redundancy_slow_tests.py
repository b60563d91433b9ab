"""Slow-fault tests: what their limits follow from, whom they isolate, and what they leave alone."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from conftest import FEWER, Voted, vote_samples
from pydantic import ValidationError

from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.computer.redundancy.state import new_state
from rig.core.errors import BadInput
from rig.core.frame import DecidedBy, Ilm, State
from rig.log.recordings.vote_config import RecordedSignal
from rig.scenario.scenario import load
from rig.verdict.monitored_places import monitor

SIGMA, THRESHOLD = 0.01, 1.0
SEEDS = range(max(2, round(12 / FEWER)))
TESTS: dict[str, Any] = {"noise_std": SIGMA, "bias_tolerance": 0.1, "reference_error": 0.03}


def noise(seed: int, frames: int, std: float = SIGMA) -> Any:
    return np.random.default_rng(seed).normal(0.0, std, (frames, 4))


def vote(samples: Any, reference: Any = None, **more: Any) -> Voted:
    settings = {"threshold": THRESHOLD, "slow_tests": {**TESTS, **more.pop("tests", {})}, **more}
    return vote_samples(np.asarray(samples, float), reference=reference, **settings)


def truth(seed: int, frames: int, error: float = 0.0) -> Any:
    """A reference that is right but for noise and a constant error."""
    return np.random.default_rng(1000 + seed).normal(error, 0.3 * SIGMA, frames)


@pytest.mark.parametrize("seed", SEEDS)
def test_white_noise_with_biases_isolates_no_channel(seed: int):
    samples = noise(seed, 6000) + np.array([0.1, -0.1, 0.05, 0.0])
    assert vote(samples, truth(seed, 6000, 0.4)).failed_at() == [None] * 4


def test_the_limits_leave_six_standard_deviations_of_a_mean():
    """The slow mean of white noise has the variance 1 / 200, the bias of 1000 frames 1 / 1000.  An offset of twice the
    limit is past it for all noise, one of half of it is not."""
    limit = 6.0 * sqrt(1 / 200 + 1 / 1000) * SIGMA
    for seed in SEEDS:
        samples = noise(seed, 3000)
        samples[1500:, 1] += 2.0 * limit
        failed = vote(samples).failed_at()
        # It needs ln 2 of its 100 frames to be half way, and the fast mean is about as soon.
        assert [failed[c] for c in (0, 2, 3)] == [None] * 3 and 1500 < (failed[1] or 0) < 1500 + 150
        samples = noise(seed, 3000)
        samples[1500:1900, 1] += 0.5 * limit
        assert vote(samples).failed_at() == [None] * 4


def test_an_offset_of_two_noises_is_found_with_its_rule():
    samples = noise(1, 2000)
    samples[1200:, 2] += 2.0 * SIGMA
    out = vote(samples)
    k = (out.failed_at()[2] or 0) - 1
    assert 1200 < k < 1300 and out.decided_by[k] == DecidedBy.SLOW_MEANS and (out.state[:k] < State.FAILED).all()
    assert vote_samples(samples, threshold=THRESHOLD).failed_at() == [None] * 4


def test_small_steps_of_two_channels_are_found_one_after_the_other_and_two_left_are_kept():
    """Of the three that are left the means begin again and are full within a second; two have no majority."""
    samples = noise(17, 3000)
    samples[1200:, 2] += 4.0 * SIGMA
    samples[1800:, 0] -= 4.0 * SIGMA
    out = vote(samples)
    failed = out.failed_at()
    assert 1200 < (failed[2] or 0) < 1300 and 1800 < (failed[0] or 0) < 1900
    assert failed[1] is None and failed[3] is None and out.level[-1] == 2
    samples[2400:, 1] += 20.0 * SIGMA
    assert vote(samples).failed_at() == failed


def test_two_small_steps_at_once_in_opposite_directions_isolate_neither_healthy_channel():
    samples = noise(18, 3000)
    samples[1500:, 0] += 4.0 * SIGMA
    samples[1500:, 3] -= 4.0 * SIGMA
    assert [vote(samples).failed_at()[c] for c in (1, 2)] == [None, None]


def test_two_that_stand_still_alike_isolate_no_channel_whose_noise_is_that_of_the_data_sheet():
    """The lowest noise is then none; two that are noisier than the data sheet are isolated."""
    for sigma, found in ((1.0, False), (3.0, True)):
        samples = noise(23, 5000)
        if found:
            samples[2000:, [0, 3]] *= sigma
        else:
            samples[2000:, [1, 2]] = np.arange(3000)[:, None] * 1e-7  # no sample repeats bit for bit
        failed = [c for c, at in enumerate(vote(samples).failed_at()) if at is not None]
        assert failed == ([0, 3] if found else []), sigma


@pytest.mark.parametrize("repeats", [True, False])
def test_two_that_repeat_their_samples_isolate_no_channel_beside_them(repeats: bool):
    """Both stand 1.1 standard deviations up: the median is then the mean of the lower and the larger other sample."""
    samples = noise(24, 4000)
    samples[2000:, 1], samples[2000:, 3] = 1.06 * SIGMA, 1.19 * SIGMA
    if not repeats:  # the same, but for the last bits
        samples[2000:, [1, 3]] += np.arange(2000)[:, None] * 1e-9
    failed = [c for c, at in enumerate(vote(samples).failed_at()) if at is not None]
    assert (failed == []) == repeats


def test_one_of_two_that_repeat_is_isolated_where_it_is_off():
    samples = noise(25, 4000)
    samples[2000:, 1], samples[2000:, 3] = 0.0, 6.0 * SIGMA
    assert [vote(samples).failed_at()[c] is None for c in range(4)] == [True, True, True, False]


def test_no_vote_is_moved_while_no_channel_is_isolated():
    samples = noise(19, 1500) + np.array([0.08, 0.03, 0.0, -0.05])
    assert (vote(samples).voted == vote_samples(samples, threshold=THRESHOLD).voted).all()


def test_a_factor_multiplies_what_is_found():
    samples = noise(2, 4000)
    samples[1500:, 2] += 5.0 * SIGMA
    first, later = (vote(samples, tests={"factor": factor}).failed_at()[2] for factor in (1.0, 3.0))
    assert 1500 < (first or 0) < (later or 0)
    assert vote(samples, tests={"factor": 40.0}).failed_at() == [None] * 4


@pytest.mark.parametrize("kind", ["noise", "oscillation", "stuck"])
def test_what_has_no_mean_is_found_by_its_square(kind: str):
    samples, k = noise(3, 4000), np.arange(2000)
    if kind == "noise":
        samples[2000:, 0] += noise(4, 2000, 2.0 * SIGMA)[:, 0]
    elif kind == "oscillation":
        samples[2000:, 0] += 3.0 * SIGMA * np.sin(k * 2 * pi / 12.5)  # 8 Hz
    else:
        samples += 0.5 * np.sin(np.arange(4000) / 60.0)[:, None]
        samples[2000:, 0] = samples[2000, 0]
    out = vote(samples)
    failed = out.failed_at()
    assert 2000 < (failed[0] or 0) < 2100 and failed[1:] == [None] * 3
    by = DecidedBy.SLOW_MEANS if kind == "stuck" else DecidedBy.SLOW_SQUARES  # the residual of a stuck one swings
    assert out.decided_by[(failed[0] or 0) - 1] == by


@pytest.mark.parametrize("filter_s", [0.0, 0.1])
@pytest.mark.parametrize("frames", [1, 3, 7])
@pytest.mark.parametrize("size", [10.0, 100.0, -10.0])
def test_a_burst_isolates_no_channel_however_large(frames: int, size: float, filter_s: float):
    for at in (20, 260, 700, 1500):
        samples = noise(at, at + 600)
        samples[at : at + frames, 1] += size * THRESHOLD
        assert vote(samples, truth(at, len(samples)), filter_s=filter_s).failed_at() == [None] * 4


@pytest.mark.parametrize("size", [10.0, -10.0, 200.0])
def test_nor_do_twelve_bursts_two_seconds_apart(size: float):
    """A burst of 7 frames is 0.37 of the limit of the slow mean, those before it 0.06: noise must not do the rest."""
    for seed in range(40):
        samples = noise(1000 + seed, 2900)
        for at in range(400, 2800, 200):
            samples[at : at + 7, 1] += size * THRESHOLD
        assert vote(samples, truth(1000 + seed, len(samples))).failed_at() == [None] * 4, seed


@pytest.mark.parametrize("out", [[3], [0, 3]])
@pytest.mark.parametrize("size", [10.0, -100.0])
def test_nor_does_a_burst_among_three_or_of_two_left(out: list[int], size: float):
    for frames, at in ((1, 520), (1, 1000), (3, 1000), (7, 520), (7, 1000)):
        samples = noise(at, at + 600)
        samples[500:, out] += 9.0
        samples[at : at + frames, 1] += size * THRESHOLD
        failed = vote(samples, truth(at, len(samples))).failed_at()
        assert [c for c in range(4) if failed[c] is not None] == out, (frames, at)


def test_vibration_that_all_channels_have_isolates_none():
    samples = noise(5, 6000)
    samples[3000:] += noise(6, 3000, 5.0 * SIGMA)  # each its own, of one size
    assert vote(samples).failed_at() == [None] * 4
    samples[4000:, 3] += 4.0 * noise(7, 2000, 5.0 * SIGMA)[:, 0]  # one has more of it
    assert vote(samples).failed_at()[:3] == [None] * 3 and vote(samples).failed_at()[3] is not None


def test_a_bias_is_learned_no_further_than_its_bound():
    """2 tolerances are 0.2: a difference of 0.15 is learned in ten seconds, one of 0.3 is found."""
    for size, found in ((0.15, False), (0.3, True)):
        samples = noise(8, 3000)
        samples[:, 0] += size
        assert (vote(samples).failed_at()[0] is not None) == found, size


def test_a_drift_of_the_noise_in_a_second_is_found_before_it_is_learned():
    samples = noise(9, 4000)
    samples[1500:, 3] += np.arange(2500) * SIGMA / 100.0
    failed = vote(samples).failed_at()
    assert failed[:3] == [None] * 3 and 1500 < (failed[3] or 0) < 2100


def test_no_channel_is_isolated_before_biases_and_noise_are_known():
    samples = noise(10, 150)
    samples[:, 0] += 0.16
    samples[80:, 1] += 0.5
    assert vote(samples).failed_at() == [None] * 4


def test_scales_that_differ_are_no_fault_in_a_manoeuvre():
    scales, move = 1.0 + np.array([0.01, -0.01, 0.005, 0.0]), 40.0 * np.sin(np.arange(6000) / 300.0)
    samples = noise(11, 6000) + move[:, None] * scales
    tests = {"scale_tolerance": 0.01}
    assert vote(samples, tests=tests).failed_at() == [None] * 4
    assert vote(samples).failed_at() != [None] * 4  # without the allowance


SKEW: dict[str, Any] = {"skew_frames": 1.0}


def rolling(seed: int, rate: float, rolls: int, level: int) -> Any:
    """A ramp that ends, of which channels 0 and 1 are sampled half a frame earlier and later than the others."""
    times = np.arange(rolls + level)[:, None] + np.array([0.5, -0.5, 0.0, 0.0])
    return noise(seed, rolls + level) + rate * np.clip(times, 0.0, rolls)


def test_a_skew_of_sampling_times_is_not_learned_as_a_bias():
    """Five noises to one side for four seconds, and none later; learned in full, they would be an offset of five."""
    for seed in SEEDS:
        samples = rolling(seed, 10.0 * SIGMA, 400, 2100)
        assert vote(samples, tests=SKEW).failed_at() == [None] * 4
        samples[2000:, 1] += 2.0 * SIGMA
        failed = vote(samples, tests=SKEW).failed_at()
        assert 2000 < (failed[1] or 0) < 2130 and [failed[c] for c in (0, 2, 3)] == [None] * 3


@pytest.mark.parametrize(("ratio", "weight"), [(0.0, 1.0), (0.5, 0.8), (1.0, 0.5), (3.0, 0.1)])
def test_a_frame_weighs_by_noise_and_skew(ratio: float, weight: float):
    """The least noise is half of that of a sample: at a skew that moves a residual by ``ratio`` of it."""
    params = np.zeros(1, PARAMS)
    settings = SignalConfig(threshold=THRESHOLD, slow_tests=SlowTests.model_validate({**TESTS, **SKEW}))
    fill(params[0], settings, (-1000.0, 1000.0), 4, False, 100.0)
    state, valid, ilm = new_state(params), np.ones(4, np.uint8), np.full(4, Ilm.ABSENT, np.uint8)
    known = []
    for k in range(500):
        samples = np.full(4, ratio * 0.5 * SIGMA * k)
        manage_signal(samples, valid, ilm, np.nan, np.nan, params[0], state[0])
        known.append(float(state[0]["tests"]["known"]))
    assert known[0] == 1.0 and np.diff(known[400:]) == pytest.approx(weight, abs=1e-6)


PAIR = [[1, 2], [0, 3]]


@pytest.mark.parametrize("pair", PAIR)
@pytest.mark.parametrize("error", [0.0, 0.5, -0.5])
def test_two_alike_are_isolated_by_the_slope_whatever_the_constant_error_of_the_reference(
    pair: list[int], error: float
):
    for seed in SEEDS:
        samples = noise(seed, 3000)
        samples[1500:, pair] += 0.12
        out = vote(samples, truth(seed, 3000, error))
        failed = out.failed_at()
        assert all(1500 < (failed[c] or 0) < 1800 for c in pair), (seed, failed)
        assert out.decided_by[(failed[pair[0]] or 0) - 1] == DecidedBy.SLOW_HALVES
        assert [failed[c] for c in range(4) if c not in pair] == [None, None], (seed, failed)


@pytest.mark.parametrize("pair", PAIR)
def test_two_alike_are_left_without_a_reference_and_below_its_error(pair: list[int]):
    samples = noise(12, 3000)
    samples[1500:, pair] += 0.12
    assert vote(samples).failed_at() == [None] * 4
    assert vote(samples, truth(12, 3000), tests={"reference_error": 0.3}).failed_at() == [None] * 4
    assert vote(samples, truth(12, 3000), tests={"reference_error": 0.0}).failed_at() == [None] * 4


@pytest.mark.parametrize("wrong", [0, 2])
@pytest.mark.parametrize("kind", ["offset", "oscillation", "drift"])
def test_one_of_two_left_is_isolated_by_the_slope(wrong: int, kind: str):
    samples, k = noise(13, 5000), np.arange(2500)
    samples[500:, [1, 3]] += 9.0  # two that the comparison isolates
    size = {"offset": 0.15, "oscillation": 0.25 * np.sin(k / 8.0), "drift": 0.0003 * k}[kind]
    samples[2500:, wrong] += size
    failed = vote(samples, truth(13, 5000, 0.2)).failed_at()
    assert 2500 < (failed[wrong] or 0) < 3600 and failed[2 - wrong] is None
    assert vote(samples).failed_at()[wrong] is None and vote(samples).failed_at()[2 - wrong] is None


@pytest.mark.parametrize("follows", [0.06, -0.06])
def test_a_reference_that_follows_the_vote_after_two_isolations_blames_no_healthy_channel(follows: float):
    """It remembers the vote, which the bias of one channel moves when two leave; the other one drifts then."""
    for seed in SEEDS:
        samples, k = noise(seed, 3000), np.arange(2500)
        samples[:, 0] += 2.0 * follows
        samples[500:, [1, 3]] += 9.0
        reference = truth(seed, 3000)
        reference[500:] += follows * (1.0 - np.exp(-k / 150.0))
        samples[1000:, 2] += np.arange(2000) * 2e-4 * np.sign(follows)
        assert vote(samples, reference).failed_at()[0] is None, seed


def test_a_reference_that_jumps_while_two_are_left_isolates_none():
    samples = noise(14, 4000)
    samples[500:, [1, 3]] += 9.0
    for jump in (0.05, 0.2, 0.6):
        reference = truth(14, 4000)
        reference[2500:] += jump
        assert [vote(samples, reference).failed_at()[c] for c in (0, 2)] == [None, None]


def test_a_split_that_two_faults_make_is_no_motion_of_the_aircraft():
    """Two hardovers at once move the middle by thresholds: with a skew this once hid other faults for seconds."""
    for at_once in (True, False):
        samples = noise(18, 4000)
        samples[1500:, 1] += 5.0
        samples[1500 if at_once else 1600 :, 3] += 5.0
        samples[1650:, 0] += 0.15
        failed = vote(samples, truth(18, 4000), tests={"skew_frames": 0.5}).failed_at()
        assert 1650 < (failed[0] or 0) < 1850 and failed[2] is None, (at_once, failed)


def at_a_stop(seed: int, rests: bool) -> Any:
    """A lever moved from stop to stop: samples end at the ends of the range, -1 and 1."""
    moved = np.concatenate([np.zeros(1000), np.ones(200), -np.ones(200), np.zeros(2600)])
    samples = noise(seed, 4000) + np.array([0.06, -0.05, 0.04, -0.06]) + moved[:, None]
    return np.clip(samples, -1.0, 1.0) if rests else samples


def test_samples_that_are_cut_off_at_a_stop_isolate_no_channel_after_it():
    """What is cut off at one end, and not at the other, was once learned as a bias."""
    for seed in SEEDS:
        samples = at_a_stop(seed, rests=True)
        assert vote(samples, limits=(-1.0, 1.0)).failed_at() == [None] * 4, seed
        assert vote(samples, limits=(-1.0, 1.0), slow_allowance=0.02, slow_limit=0.05).failed_at() == [None] * 4, seed
        samples[2000:, 1] += 0.08
        failed = vote(samples, limits=(-1.0, 1.0)).failed_at()
        assert 2000 < (failed[1] or 0) < 2130 and [failed[c] for c in (0, 2, 3)] == [None] * 3, seed


def test_a_fault_that_lasts_at_a_stop_is_found_when_the_lever_leaves_it():
    samples = at_a_stop(3, rests=False)
    samples[1250:, 2] += 0.15
    stopped = np.clip(samples, -1.0, 1.0)
    assert 1400 <= (vote(stopped, limits=(-1.0, 1.0)).failed_at()[2] or 0) < 1500
    assert 1250 <= (vote(samples).failed_at()[2] or 0) < 1350  # where the range does not end


def test_a_channel_that_is_readmitted_is_learned_again():
    samples = noise(15, 4000) + np.array([0.0, 0.0, 0.1, 0.0])
    samples[1000:1100, 2] += 5.0
    out = vote(samples, resets=[(1500, 3)])
    assert out.state[1499, 2] == State.FAILED and (out.state[1500:, 2] < State.FAILED).all()


def test_a_missing_sample_stops_the_tests_for_its_frame_alone():
    samples = noise(16, 2000)
    samples[1200:, 2] += 3.0 * SIGMA
    samples[::7, 1] = np.nan
    assert 1200 < (vote(samples).failed_at()[2] or 0) < 1320


def test_values_near_the_largest_number_stop_nothing_else():
    samples = np.tile([1e308, -1e308, 1e308, -1e308], (300, 1))
    out = vote(samples, limits=(-1.7e308, 1.7e308))
    assert np.isfinite(out.voted).all()


@pytest.mark.parametrize(
    ("tests", "says"),
    [
        ({"factor": 0.9}, "slow_tests.factor.*greater than or equal to 1"),
        ({"squares_factor": 0.5}, "slow_tests.squares_factor.*greater than or equal to 1"),
        ({"noise_std": 0.0}, "slow_tests.noise_std.*greater than 0"),
        ({"noise": 1.0}, "slow_tests.noise.*unknown key|slow_tests.noise"),
    ],
)
def test_settings_out_of_range_are_refused(tests: dict[str, Any], says: str):
    with pytest.raises(ValidationError) as refused:
        SignalConfig.model_validate({"threshold": 1.0, "slow_tests": tests})
    assert any(".".join(map(str, error["loc"])).startswith("slow_tests.") for error in refused.value.errors()), says


@pytest.mark.parametrize(
    ("tests", "says"),
    [
        ({}, "slow_tests: needs noise_std, the noise of a sample, above 0; no sensor states it"),
        ({"noise_std": 1.0, "bias_tolerance": 1.0}, "biases are learned up to 2 bias_tolerance, 2; this must be"),
    ],
)
def test_a_recorded_signal_states_its_own_noise_and_a_bias_below_its_threshold(tests: dict[str, Any], says: str):
    with pytest.raises(ValidationError, match=says):
        RecordedSignal.model_validate({"threshold": 1.5, "slow_tests": tests})


def test_amounts_are_scaled_with_the_unit_of_the_recording():
    tests = {"noise_std": 1.0, "bias_tolerance": 2.0, "scale_tolerance": 0.01, "factor": 1.5, "reference_error": 3.0}
    scaled = RecordedSignal.model_validate({"threshold": 9.0, "slow_tests": tests}).scaled(0.5).slow_tests
    assert scaled is not None
    assert (scaled.noise_std, scaled.bias_tolerance, scaled.reference_error) == (0.5, 1.0, 1.5)
    assert (scaled.scale_tolerance, scaled.factor) == (0.01, 1.5)


def test_a_scenario_takes_the_figures_of_its_sensors_and_refuses_a_sensor_without_noise():
    table: dict[str, Any] = {"redundancy": {"signals": {"pitch_rate": {"slow_tests": {"factor": 1.3}}}}}
    tested = load({**table, "duration_s": 1.0}).redundancy.signals.pitch_rate.slow_tests
    assert tested is not None and tested.factor == 1.3 and tested.noise_std is None
    table["redundancy"]["signals"]["pitch_rate"]["slow_tests"] = {"bias_tolerance": 9.0}
    with pytest.raises(BadInput, match=r"pitch_rate\.slow_tests: biases are learned up to 2 bias_tolerance, 18"):
        load({**table, "duration_s": 1.0})
    table["redundancy"]["signals"]["pitch_rate"]["slow_tests"] = {"factor": 0.9}
    with pytest.raises(BadInput, match=r"redundancy\.signals\.pitch_rate\.slow_tests\.factor") as refused:
        load({**table, "duration_s": 1.0})
    assert "\n" not in str(refused.value)
    table["redundancy"]["signals"]["pitch_rate"]["slow_tests"] = {"factor": 1.3}
    silent = {"sensors": {"pitch_rate": {"noise_std": 0.0}}}
    with pytest.raises(BadInput, match=r"redundancy\.signals\.pitch_rate\.slow_tests: needs noise_std"):
        load({**table, **silent, "duration_s": 1.0})


def test_free_running_clocks_allow_a_frame_of_skew_more():
    """Each computer reads its channels at its own time, up to a frame apart."""
    sets = ["computers.count=4", "computers.exchange_rounds=1"]
    together, free = (monitor(load(None, [*sets, f"computers.synchronised={on}"])) for on in ("true", "false"))
    assert (together["slow_means"] > 0.0).all()
    assert (free["slow_skew"] - together["slow_skew"]).tolist() == [1.0] * len(together)


@pytest.mark.parametrize(("threshold", "tested"), [(0.049, False), (0.05, True), (0.06, True)])
def test_a_narrower_threshold_flies_without_the_tests_of_the_aircraft(threshold: float, tested: bool):
    signals = load(None, [f"redundancy.signals.pitch_rate.threshold={threshold}"]).redundancy.signals
    assert (signals.pitch_rate.slow_tests is not None) is tested
    assert signals.yaw_rate.slow_tests is not None


@pytest.mark.parametrize(("rate_hz", "times"), [(50, 0.0), (100, 1.0), (200, 2.0), (400, 4.0)])
def test_the_error_of_a_reference_in_motion_is_that_of_a_time_not_of_frames(rate_hz: int, times: float):
    """A reference that lags by 0.08 s is off by as much at any rate; the motion of a frame is less at a higher one."""
    designed, flown = (monitor(load(None, sets)) for sets in ([], [f"rate_hz={rate_hz}"]))
    assert designed["slow_reference_frames"].any()
    assert flown["slow_reference_frames"] == pytest.approx(times * designed["slow_reference_frames"])
    assert (flown["slow_reference"] == (designed["slow_reference"] if times else 0.0)).all()


def test_a_rate_that_is_given_twice_scales_it_once():
    twice = load({"rate_hz": 200.0, "duration_s": 1.0}, ["rate_hz=400"])
    assert monitor(twice)["slow_reference_frames"] == pytest.approx(4.0 * monitor(load(None))["slow_reference_frames"])
