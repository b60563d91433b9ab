"""Designs of the slow-fault tests: factors from healthy flights, and the delay of each size of fault."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from math import exp, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
import tomli_w
from conftest import FEWER, vote_samples

from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.core.frame import SIGNALS
from rig.core.settings import read_toml
from rig.log.recordings.recorded_signal import RecordedSignal
from rig.scenario.scenario import load
from rig.studies.thresholds.holdout import Count
from rig.studies.thresholds.pieces import parameters
from rig.studies.thresholds.slow_test_delays import (
    DRIFT,
    OFFSETS,
    Limits,
    delays,
    drift_frames,
    limits,
    offset_frames,
    smallest,
)
from rig.studies.thresholds.slow_test_factors import (
    BIN,
    BINS,
    FACTORS,
    Measured,
    bare_tests,
    keys_of,
    settled,
    slow_design,
    watched,
)

Command = Callable[..., tuple[int, str, str]]
SIGMA, THRESHOLD, RATE = 0.01, 1.0, 100.0
GIVEN = SlowTests(noise_std=SIGMA, bias_tolerance=0.1)
MOVED = 0.8 * SIGMA  # a frame
SEEDS = range(max(3, round(9 / FEWER)))


def noise(seed: int, frames: int, channels: int = 4) -> Any:
    samples = np.full((frames, 4), np.nan)
    samples[:, :channels] = np.random.default_rng(seed).normal(0.0, SIGMA, (frames, channels))
    return samples


def measured(samples: Any, reference: Any = None, channels: int = 4) -> Measured:
    (params,) = parameters(RecordedSignal(threshold=THRESHOLD), channels, RATE)
    return watched((samples, reference), params, bare_tests(GIVEN))


def of(shares: tuple[float, float, float], errors: dict[int, float] | None = None) -> Measured:
    made = np.zeros(BINS)
    for b, error in (errors or {}).items():
        made[b] = error
    return Measured(np.array(shares), made, SIGMA, 0.0)


def test_white_noise_stays_below_the_bare_limits_and_its_noise_is_measured():
    """Six standard deviations: 10,000 frames have about 2,000 independent means of 0.16 s, so some reach three."""
    found = measured(noise(1, 10_000) + np.array([0.1, -0.1, 0.05, 0.0]))
    assert (found.shares > 0.2).all() and (found.shares < 1.0).all()
    assert found.noise == pytest.approx(SIGMA, rel=0.15) and not found.errors.any()


def test_a_share_is_what_a_statistic_reaches_of_its_bare_limit():
    """A slow wave of one channel that it shares with none: its mean of squares is 1 + A^2 / 2 in units of the noise."""
    samples, size = noise(2, 6000), 1.6
    samples[2000:, 1] += size * SIGMA * np.sin(np.arange(4000) * 2 * pi / 9.0)
    found, bare = measured(samples), limits(SlowTests(squares_factor=1.0))
    assert found.shares[1] == pytest.approx(size**2 / 2 / bare.square, rel=0.4)


def test_frames_in_which_the_tests_do_not_run_add_nothing_to_the_error_of_a_reference():
    """Its last difference from the median once counted again in each of them."""
    for seed in SEEDS:
        samples, reference = noise(seed, 6000), np.random.default_rng(seed).normal(0.0, 0.05, 6000)
        whole = measured(samples, reference).errors[0]
        for at in range(2000, 6000, 400):
            samples[at : at + 200, 1] = np.nan
        assert 0.5 * whole < measured(samples, reference).errors[0] <= 1.2 * whole


def test_designed_factors_have_their_reserve_in_the_data_that_they_follow_from():
    """Three times the noise in one channel, which is healthy: what counts of its squares grows with the factor."""
    flights = [noise(seed, 6000) * [1.0, 1.0, 1.0, 3.0] for seed in SEEDS]

    def measure(factors: Mapping[str, float]) -> list[Measured]:
        (params,) = parameters(RecordedSignal(threshold=THRESHOLD), 4, RATE)
        return [watched((samples, None), params, bare_tests(GIVEN, factors)) for samples in flights]

    at_one = keys_of(measure(dict.fromkeys(FACTORS, 1.0)), THRESHOLD)
    found = settled(measure, THRESHOLD)
    assert found is not None
    keys = keys_of(found, THRESHOLD)
    assert keys["squares_factor"] > 1.5 * at_one["squares_factor"]  # with those of the first run all are isolated
    tests = SlowTests(**{**GIVEN.model_dump(exclude_none=True), **keys})
    for samples in flights:
        assert vote_samples(samples, threshold=THRESHOLD, slow_tests=tests).failed_at() == [None] * 4


def test_shares_that_grow_with_every_factor_give_no_tests():
    assert settled(lambda factors: [of((2.0 * factors["factor"], 1.0, 1.0))], THRESHOLD) is None


def test_no_channel_is_isolated_while_shares_are_measured():
    """Far beyond the threshold, and for long: the share goes on, and the flight has its channel to the end."""
    samples = noise(3, 3000)
    samples[1500:, 2] += 3.0 * THRESHOLD
    assert measured(samples).shares[0] > 5.0


def test_the_error_of_a_reference_is_that_beside_its_bias():
    reference = 0.4 + np.random.default_rng(4).normal(0.0, 0.1 * SIGMA, 8000)
    assert measured(noise(4, 8000), reference).errors[0] < 0.02
    moved = reference + 0.2 * np.sin(np.arange(8000) * 2 * pi / 400.0)
    assert measured(noise(4, 8000), moved).errors[0] == pytest.approx(0.2, rel=0.15)


def test_a_factor_is_the_reserve_times_the_largest_share_and_has_a_least():
    keys = keys_of([of((0.5, 1.2, 0.9)), of((2.0, 0.4, 0.1))], THRESHOLD)
    assert keys == {"factor": 2.6, "squares_factor": 1.56, "halves_factor": 1.17}
    assert keys_of([of((0.5, 0.2, 0.4))], THRESHOLD) == {"factor": 1.1, "squares_factor": 1.1, "halves_factor": 1.0}
    assert keys_of([of((2.0, 2.0, 2.0))], THRESHOLD, reserve=1.5)["factor"] == 3.0


def test_a_reference_has_a_level_and_a_rise_with_the_rate_of_motion():
    """At rest 0.1 and 0.4 at 20 bins: 1.2 times each, and the line through both."""
    keys = keys_of([of((1, 1, 1), {0: 0.1, 20: 0.4, 5: 0.11})], THRESHOLD)
    assert keys["reference_error"] == pytest.approx(0.12)
    assert keys["reference_frames"] == pytest.approx((0.48 - 0.12) / (20 * BIN), rel=1e-3)
    assert keys_of([of((1, 1, 1), {0: 0.001})], THRESHOLD)["reference_error"] == 0.02  # no reference is trusted to less
    assert "reference_error" not in keys_of([of((1, 1, 1), {0: 0.35})], THRESHOLD)
    assert "reference_error" not in keys_of([of((1, 1, 1))], THRESHOLD)


def test_half_of_the_flights_is_held_out_and_those_beyond_the_factors_are_told():
    flights = [of((1.0, 1.0, 1.0)) for _ in range(5)]
    made = slow_design(flights, GIVEN, (THRESHOLD, 4), RATE)
    assert (made.beyond, made.flights, made.notes) == (0, 5, []) and made.reserves["factor"] == pytest.approx(1.3)
    made = slow_design([*flights, of((1.0, 1.4, 1.0))], GIVEN, (THRESHOLD, 4), RATE)
    assert made.beyond == 1 and made.notes == [
        "slow-fault tests: 1 of 6 held-out flights exceed the factors of the others"
    ]
    assert "one flight alone" in slow_design(flights[:1], GIVEN, (THRESHOLD, 4), RATE).notes[0]
    assert "no flight lasts" in slow_design([of((0, 0, 0))] * 2, GIVEN, (THRESHOLD, 4), RATE).notes[0]


def test_amounts_are_told_in_the_unit_of_the_signal():
    made = slow_design([of((1, 1, 1), {0: 0.1, 9: 0.2})], GIVEN, (THRESHOLD, 4), RATE)
    shown = made.in_unit(0.5)
    assert shown.keys["reference_error"] == pytest.approx(2.0 * made.keys["reference_error"])
    assert shown.noise == 2.0 * SIGMA and shown.delays == made.delays
    assert {key: shown.keys[key] for key in ("factor", "reference_frames")} == {
        key: made.keys[key] for key in ("factor", "reference_frames")
    }


def moved(r: float, at: Limits, frames: int) -> int | None:
    """The definition of the three means in the page, frame by frame, without noise."""
    means, squares = {16.0: 0.0, 100.0: 0.0}, 0.0
    bounds, bursts = {16.0: at.fast, 100.0: at.slow}, {16.0: 14.0, 100.0: 20.0}
    for n in range(1, frames + 1):
        for length, bound in bounds.items():
            means[length] += (min(r, bound / (1.0 - exp(-bursts[length] / length))) - means[length]) / length
        squares += (min(r * r, at.square / (1.0 - exp(-20.0 / 128.0))) - squares) / 128.0
        if any(means[length] > bound for length, bound in bounds.items()) or squares > at.square:
            return n
    return None


@pytest.mark.parametrize("allowed", [0.0, 0.8])
@pytest.mark.parametrize("z", [0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 6.0, 30.0, 1e9])
def test_the_delay_in_closed_form_is_that_of_the_means_frame_by_frame(z: float, allowed: float):
    at = limits(SlowTests(factor=1.2, squares_factor=1.5))
    told = offset_frames(z, at, 4, allowed)
    expected = moved(max(z - min(0.25 * z, 0.423) - allowed, 0.0), at, 5000)
    assert (told is None) == (expected is None) == (z < smallest(at, 4, allowed))
    if told is not None and expected is not None:
        assert abs(told - expected) <= 1 and told >= 14


def trial(seed: int, fault: Any, channels: int, moved: float = 0.0, **sensor: float) -> int | None:
    """Frames until the faulty channel is isolated after 25 s of learning, while all move by ``moved`` a frame."""
    samples, onset = noise(seed, 2500 + len(fault), channels), 2500
    samples[onset:, 1] += fault
    samples += moved * np.arange(len(samples))[:, None]
    tests = {"noise_std": SIGMA, "bias_tolerance": 0.1, "factor": 1.1, **sensor}
    failed = vote_samples(samples, threshold=THRESHOLD, slow_tests=tests, channels=channels).failed_at()
    assert all(failed[c] is None for c in range(channels) if c != 1)
    return None if failed[1] is None else failed[1] - onset


@pytest.mark.parametrize("channels", [4, 3])
@pytest.mark.parametrize("z", [1.0, 1.5, 2.0, 4.0, 30.0])
def test_the_delay_of_an_offset_is_that_of_trials(z: float, channels: int):
    told = offset_frames(z, limits(SlowTests(factor=1.1)), channels)
    assert told is not None
    delay = np.median([trial(seed, np.full(2 * told + 20, z * SIGMA), channels) or np.inf for seed in SEEDS])
    assert 0.6 * told - 2 <= delay <= 1.4 * told + 4, (told, delay)


@pytest.mark.parametrize("z", [2.5, 4.0, 30.0])
def test_the_delay_of_an_offset_in_motion_is_that_of_trials(z: float):
    """Channels that may be sampled a frame apart: what may come of the motion is taken off."""
    allowed = MOVED / SIGMA
    told = offset_frames(z, limits(SlowTests(factor=1.1)), 4, allowed)
    assert told is not None
    fault = np.full(2 * told + 20, z * SIGMA)
    delay = np.median([trial(seed, fault, 4, MOVED, skew_frames=1.0) or np.inf for seed in SEEDS])
    assert 0.6 * told - 2 <= delay <= 1.4 * told + 4, (told, delay)
    at = limits(SlowTests(factor=1.1))
    assert smallest(at, 4, allowed) == pytest.approx(min(at.slow, sqrt(at.square)) + allowed + 0.423)


def test_the_allowance_of_a_design_is_what_the_data_move_by():
    sensor = SlowTests(noise_std=SIGMA, bias_tolerance=0.1, skew_frames=0.5)
    (params,) = parameters(RecordedSignal(threshold=THRESHOLD), 4, RATE)
    samples = noise(3, 6000) + MOVED * np.arange(6000)[:, None]
    found = watched((samples, None), params, bare_tests(sensor))
    assert found.allowance == pytest.approx(0.5 * MOVED, rel=0.25)  # of the largest mean rate of the last second
    made = slow_design([found], sensor, (THRESHOLD, 4), RATE)
    assert made.allowance == found.allowance
    assert made.delays.smallest is not None and made.in_motion.smallest is not None
    assert made.in_motion.smallest > made.delays.smallest
    still = measured(noise(3, 6000))
    assert still.allowance == 0.0  # without a skew or a scale in the data sheet


@pytest.mark.parametrize("rate", [0.5, 2.0, 10.0])
def test_the_delay_of_a_drift_is_that_of_trials(rate: float):
    """Units of noise a second."""
    told = drift_frames(rate / RATE, 17.0, limits(SlowTests(factor=1.1)), 4, 6000)
    assert told is not None
    fault = rate * SIGMA * np.arange(1, 2 * told) / RATE
    delay = np.median([trial(seed, fault, 4) or np.inf for seed in SEEDS])
    assert 0.7 * told - 2 <= delay <= 1.3 * told + 4, (told, delay)


def test_a_slow_drift_is_learned_up_to_the_bound_of_a_bias_and_found_beyond():
    at = limits(SlowTests(factor=1.1))
    rate, bound = 1e-4, 0.5  # a thousand frames of it are 0.1 of the noise, a fifth of the limit
    told = drift_frames(rate, bound, at, 4, 50_000)
    assert told is not None and bound < rate * told < bound + smallest(at, 4) + 0.1
    assert drift_frames(rate, bound, at, 4, 3000) is None


def test_delays_of_a_signal_are_in_seconds_by_thresholds_and_two_channels_have_none():
    made = delays(SlowTests(factor=1.1), GIVEN.sheet(None), 10.0 * SIGMA, SIGMA, (4, 50.0))
    at = limits(SlowTests(factor=1.1))
    assert made.offsets == tuple(
        None if (n := offset_frames(10.0 * size, at, 4)) is None else n / 50.0 for size in OFFSETS
    )
    drift = drift_frames(10.0 * DRIFT / 50.0, 17.0, at, 4, 3000)
    assert drift is not None and made.drift == drift / 50.0
    assert made.smallest == pytest.approx(1.1 * 6.0 * sqrt(0.5 / 100 + 1 / 2000) / 0.75 / 10.0)
    assert delays(SlowTests(), GIVEN.sheet(None), 1.0, SIGMA, (2, 50.0)) == ((None,) * len(OFFSETS), None, None)


# The command.

QUICK = ["--persistence", "4", "--levels", "4", "--filter", "0", "--slow-faults", "none", "--budget", "20"]


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Ten recordings of two signals with references, and a CONFIG of these tables."""
    monkeypatch.chdir(tmp_path)

    def record(**config: Any) -> list[str]:
        Path("data").mkdir()
        n = np.arange(3000)
        for k in range(10):
            rng, columns = np.random.default_rng(k), {"time_s": n / RATE}
            for name in ("gyro", "accel"):
                motion = 20.0 * np.sin(n / 80.0)
                columns |= {f"{name}.{c}": motion + rng.normal(size=len(n)) for c in range(1, 5)}
                columns[f"{name}.ref"] = motion + rng.normal(0.3, 0.1, len(n))
            pl.DataFrame(columns).write_parquet(f"data/path_{k}.parquet")
        Path("c.toml").write_text(tomli_w.dumps(config))
        return ["data", "--config", "c.toml", "--out", "o.toml", *QUICK, "--slow-tests"]

    return record


def test_out_has_the_tests_beside_the_thresholds_and_is_accepted(recorded: Any, rig_command: Command):
    figures = {"noise_std": 1.0, "bias_tolerance": 0.1, "reference_error": 9.0}
    own = {**figures, "factor": 7.0, "skew_frames": 0.5}
    wanted = recorded(default={"slow_tests": figures}, signal={"accel": {"slow_tests": own}})
    code, out, _ = rig_command("thresholds", *wanted, "--json", "--plot", "p.html")
    assert code == 0
    found, written = json.loads(out)["signals"], read_toml(Path("o.toml"))["signal"]
    for name in ("gyro", "accel"):
        keys = found[name]["slow_tests"]["keys"]
        skew = {"skew_frames": 0.5} if name == "accel" else {}
        assert written[name]["slow_tests"] == {"noise_std": 1.0, "bias_tolerance": 0.1, **skew, **keys}
        assert 1.1 <= keys["factor"] < 1.6 and 0 < keys["reference_error"] < 2.0
        assert found[name]["slow_tests"]["held_out_beyond"] == 0
    assert found["gyro"]["slow_tests"]["delay_s"]["offset"]["1"] < 1.0
    page = Path("p.html").read_text()
    assert "Slow-fault tests" in page and page.count(">in motion</td>") == 1  # of accel, which has a skew
    assert rig_command("vote", "data/path_0.parquet", "--config", "o.toml", "--out", "v.csv")[0] == 0
    code, out, _ = rig_command("thresholds", *wanted)
    assert code == 0 and "slow-fault tests: factor on each limit" in out and "smallest isolated offset" in out
    moving = out.partition("the same with the mean allowance for motion in the data\n")[2].partition("\n\n")[0]
    assert "accel" in moving and "gyro" not in moving


def test_thresholds_are_the_same_with_tests_and_without(recorded: Any, rig_command: Command):
    wanted = recorded(default={"slow_tests": {"noise_std": 1.0, "bias_tolerance": 0.1}})
    with_tests, without = (
        json.loads(rig_command("thresholds", *options, "--json")[1])["signals"]["gyro"]
        for options in (wanted, wanted[:-1])
    )
    assert without["slow_tests"] is None and with_tests["chosen"] == without["chosen"]
    assert with_tests["hold_out"] == without["hold_out"]


def test_a_signal_without_noise_figures_is_told(recorded: Any, rig_command: Command):
    wanted = recorded(default={}, signal={"gyro": {"slow_tests": {"noise_std": 1.0}}})
    found = json.loads(rig_command("thresholds", *wanted, "--json")[1])
    assert found["signals"]["accel"]["slow_tests"] is None and found["signals"]["gyro"]["slow_tests"] is not None
    assert "accel: no slow-fault tests: CONFIG states no slow_tests.noise_std, the noise of a sample" in found["notes"]


def test_a_bound_of_biases_above_the_designed_threshold_is_told(recorded: Any, rig_command: Command):
    figures = {"noise_std": 1.0, "bias_tolerance": 8.0}
    wanted = recorded(default={"threshold": 20.0}, signal={"gyro": {"slow_tests": figures}})
    found = json.loads(rig_command("thresholds", *wanted, "--json")[1])
    assert found["signals"]["gyro"]["slow_tests"] is None
    (note,) = [note for note in found["notes"] if note.startswith("gyro: no slow-fault tests")]
    assert "biases are learned up to 2 bias_tolerance, 16; this must be below the threshold of every" in note


@pytest.mark.parametrize("asked", [True, False])
def test_tests_that_do_not_fit_the_thresholds_are_off_in_out_which_is_accepted(
    recorded: Any, rig_command: Command, asked: bool
):
    """CONFIG has them on; with a narrower threshold ``rig vote`` refuses them."""
    figures = {"noise_std": 1.0, "bias_tolerance": 8.0}
    wanted = recorded(default={"threshold": 20.0, "slow_tests": figures})
    code, out, _ = rig_command("thresholds", *(wanted if asked else wanted[:-1]), "--json")
    assert code == 0 and any("no slow-fault tests: biases are learned" in note for note in json.loads(out)["notes"])
    assert {table["slow_tests"] for table in read_toml(Path("o.toml"))["signal"].values()} == {False}
    assert rig_command("vote", "data/path_0.parquet", "--config", "o.toml", "--out", "v.csv")[0] == 0


@pytest.mark.parametrize("beside", [0, 9, 20])
def test_tests_with_which_held_out_flights_exceed_the_budget_are_left_out_if_there_are_fewer_without(
    recorded: Any, rig_command: Command, monkeypatch: pytest.MonkeyPatch, beside: int
):
    """beside : false isolations of the same design without them."""
    counted = lambda blocks, given, grid, made: {4: Count(beside if given.slow_tests is None else 9, 0.1, 1.0)}  # noqa: E731
    monkeypatch.setattr("rig.studies.thresholds.design_signals.holdout", counted)
    wanted = recorded(default={"threshold": 60.0, "slow_tests": {"noise_std": 1.0, "bias_tolerance": 0.1}})
    found = json.loads(rig_command("thresholds", *wanted, "--json")[1])
    written = read_toml(Path("o.toml"))["signal"]["gyro"]["slow_tests"]
    if beside < 9:
        assert "gyro, accel: no slow-fault tests: with them held-out flights have 9 false isolations" in found["notes"]
        assert found["signals"]["gyro"]["slow_tests"] is None and written is False
    else:
        assert written == {"noise_std": 1.0, "bias_tolerance": 0.1, **found["signals"]["gyro"]["slow_tests"]["keys"]}


@pytest.mark.parametrize(("frames", "weak"), [("4", False), ("150", True)])
def test_a_design_that_isolates_less_than_half_of_the_injected_faults_is_told(
    recorded: Any, rig_command: Command, frames: str, weak: bool
):
    """A miscompare of 1.5 s isolates no channel in the second that an offset may take."""
    wanted = recorded(default={})[:-1]
    wanted[wanted.index("--persistence") + 1] = frames
    found = json.loads(rig_command("thresholds", *wanted, "--json")[1])
    assert any("the design isolates only" in note for note in found["notes"]) is weak


BAD: dict[str, tuple[dict[str, Any], str]] = {
    "no signal states its noise": ({"default": {}}, "--slow-tests: no signal states slow_tests.noise_std, the noise"),
    "a factor below 1": (
        {"default": {"slow_tests": {"noise_std": 1.0, "factor": 0.5}}},
        "slow_tests.factor",
    ),
    "no noise": ({"default": {"slow_tests": {"noise_std": 0.0}}}, "slow_tests.noise_std"),
    "a bias above the threshold": (
        {"default": {"threshold": 2.0, "slow_tests": {"noise_std": 1.0, "bias_tolerance": 3.0}}},
        "biases are learned up to 2 bias_tolerance, 6; this must be below the threshold of every level, 2",
    ),
    "figures without noise": ({"default": {"slow_tests": {"bias_tolerance": 0.1}}}, "slow_tests: needs noise_std"),
}


@pytest.mark.parametrize("name", ["f16", "b737", "b747"])
def test_the_bundled_aircraft_have_tests_on_every_signal(name: str):
    """Sticks, pedal and dynamic pressure have no reference, or one that is too far off to decide."""
    scenario = load(None, [f"aircraft={name}"])
    signals = {signal.name: getattr(scenario.redundancy.signals, signal.name).slow_tests for signal in SIGNALS}
    assert scenario.aircraft == name and None not in signals.values()
    without = {key for key, of in signals.items() if of is not None and not of.reference_error}
    assert without == {"stick_pitch", "stick_roll", "pedal", "dynamic_pressure"}


@pytest.mark.parametrize("case", BAD)
def test_bad_settings_of_tests_are_one_line_and_nothing_is_written(case: str, recorded: Any, rig_command: Command):
    tables, says = BAD[case]
    code, out, err = rig_command("thresholds", *recorded(**tables))
    assert (code, out) == (2, "") and err.count("\n") == 1
    assert says in err and not Path("o.toml").exists()


@pytest.mark.long
def test_logs_of_ours_take_the_figures_of_their_sensors(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rig_command: Command
):
    from rig.flight.fly import fly

    monkeypatch.chdir(tmp_path)
    for seed in range(2):
        fly(None, overrides=["faults=[]", "duration_s=20.0", f"seed={seed}"], out=Path("logs"))
    options = ["logs", "--out", "o.toml", *QUICK, "--keep-thresholds", "--slow-tests", "--json"]
    code, out, err = rig_command("thresholds", *options)
    assert code == 0, err
    found, written = json.loads(out)["signals"], read_toml(Path("o.toml"))["redundancy"]["signals"]
    tested = written["pitch_rate"]["slow_tests"]
    assert tested == found["pitch_rate"]["slow_tests"]["keys"] and "noise_std" not in tested
    assert tested["reference_error"] > 0 and "reference_error" not in written.get("pedal", {}).get("slow_tests", {})
    assert load(Path("o.toml")).redundancy.signals.pitch_rate.slow_tests.factor == tested["factor"]
