"""Designs of slow faults: residuals without and with slow-fault tests, sums of small deviations, stale samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.data import Data
from rig.studies.thresholds.design import DataBlock, Grid, designs, with_sums
from rig.studies.thresholds.design_signals import Signal, of_signal
from rig.studies.thresholds.holdout import count
from rig.studies.thresholds.pieces import isolations
from rig.studies.thresholds.residual_series import learned, residuals, series
from rig.studies.thresholds.slow_fault_limits import alarms, stale_frames
from rig.studies.thresholds.tradeoff import inject, pieces

RATE = 100.0
GIVEN = RecordedSignal(threshold=1.0)
TESTS = SlowTests(noise_std=1.0, bias_tolerance=1.0, factor=2.0)
TESTED = RecordedSignal(threshold=9.0, slow_tests=TESTS)
GRID = Grid(20.0, (8,), (4, 3), (0.0,), slow_faults=("slow", "stale"))


def flight(seed: int, biases: float = 0.0, seconds: float = 30.0) -> DataBlock:
    """A common motion with white noise of 1, and a bias of each channel."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE)
    motion = 30.0 * np.sin(2 * np.pi * np.arange(n) / RATE / 5.0)
    return DataBlock(f"{seed}", motion + rng.normal(size=(4, n)) + rng.uniform(-biases, biases, (4, 1)), RATE)


def test_residuals_are_taken_from_the_middle_of_those_that_there_are():
    still = np.zeros((4, 100)) + np.array([[-3.0], [-1.0], [1.0], [5.0]])
    assert residuals([(still, None), (np.zeros((4, 9)), None)], GIVEN, RATE) == (pytest.approx([5.0, 0.0]), 0.0)
    still[0, :50] = np.nan  # then the middle is 1, else 0
    found = residuals([(still, None)], GIVEN, RATE)
    assert found.means == pytest.approx([4.5]) and not found.noisy
    turned, angle = (
        np.array([[3.1], [3.1], [-3.1], [-3.1]]) + np.zeros((4, 10)),
        RecordedSignal(threshold=1, wraps=True),
    )
    assert residuals([(turned, None)], angle, RATE).means == pytest.approx([np.pi - 3.1])
    assert residuals([(flight(1).samples, None)], GIVEN, RATE).noisy


def test_with_tests_residuals_are_without_the_biases_once_they_are_learned():
    one = flight(1)
    moved = one.samples + np.array([[1.0], [-0.7], [0.3], [0.0]])
    plain, tested = (series((moved, None), settings, RATE)[2000:] for settings in (GIVEN, TESTED))
    assert np.abs(plain.mean(axis=0)).max() > 0.7
    assert np.abs(tested.mean(axis=0)).max() < 0.15  # the means of 1,000 samples that differ from one another
    assert (
        residuals([(moved, None)], TESTED, RATE).means.max() < residuals([(moved, None)], GIVEN, RATE).means.max() / 3
    )
    with pytest.raises(AssertionError):
        np.testing.assert_array_equal(plain, tested)
    wide = TESTED.model_copy(update={"threshold": 1e-3, "slow_limit": 1e-6, "slow_allowance": 1e-6})
    np.testing.assert_array_equal(series((moved, None), wide, RATE)[2000:], tested)  # no channel leaves


def test_the_state_before_a_piece_has_the_biases_of_its_flight():
    biases = np.array([1.0, -0.7, 0.3, 0.0])
    samples = flight(2).samples + biases[:, None]
    (state,) = learned([samples], TESTED, 4, RATE)
    apart = state["tests"]["bias"] - biases
    assert state["tests"]["learned"] == pytest.approx(3000, abs=200)
    assert apart - apart.mean() == pytest.approx(np.zeros(4), abs=0.15)
    assert learned([samples], GIVEN, 4, RATE)[0]["tests"]["learned"] == 0


def test_sums_alarm_with_the_largest_allowance_that_lets_them():
    samples = np.zeros((4, 400))
    samples[1, 100:] = 0.5
    settings = RecordedSignal(threshold=9.0, slow_allowance=0.1, slow_limit=1.0)
    found = alarms(series((samples, None), settings, RATE), settings, RATE, np.array([0.1, 0.3, 0.6]))
    # 0.5 less 0.1 sums up to 100 (1 times 100 frames) in 250 frames, less 0.3 in 500, which there are not.
    (k,) = np.flatnonzero(found)
    assert k in (349, 350) and found[k] == 0.1


def test_stale_frames_are_three_times_the_longest_run_of_repeats():
    changing = np.random.default_rng(0).normal(size=(4, 1000))
    assert stale_frames([changing], RATE) == 10
    changing[2, 500:507] = 1.0  # repeated six times
    assert stale_frames([flight(1).samples, changing], RATE) == 18
    changing[2, 500:601] = 1.0
    assert stale_frames([changing], RATE) == 0


def with_transients(one: DataBlock, frames: int, size: float) -> np.ndarray:
    """Return the samples of a flight with so many frames of ``size`` on a channel every 5 s, on each in turn."""
    samples = one.samples.copy()
    for i, k in enumerate(range(1000, samples.shape[1] - 200, 500)):
        samples[i % 4, k : k + frames] += size
    return samples


def test_thresholds_above_the_noise_of_single_frames_stand_any_transient_and_those_of_the_budget_alone_do_not():
    flights, grid = [flight(k, 0.0) for k in range(20)], Grid(20.0, (8,), (4, 3), (0.0,))
    (alone,), (above,) = (designs(flights, GIVEN, replace(grid, transients=asked)) for asked in (False, True))
    assert above.threshold.upper > 1.5 * alone.threshold.upper and above.threshold.point == alone.threshold.point
    hit = [with_transients(flight(200 + k, 0.0, 120.0), 7, 1000.0) for k in range(10)]
    failed, failed_alone = (
        sum(len(isolations(each.T, design.settings(GIVEN), RATE, 50)) for each in hit) for design in (above, alone)
    )
    assert failed == 0 and failed_alone > 20  # of 220


def test_sums_find_what_the_noise_hides_and_the_budget_holds():
    flights = [flight(k) for k in range(40)]
    (plain,) = designs(flights, GIVEN, replace(GRID, slow_faults=("slow",)))
    found = residuals([(each.samples, None) for each in flights], GIVEN, RATE)
    (summed,) = with_sums(flights, GIVEN, plain, found, (24.0,), GRID)
    assert summed.slow_faults["slow_limit"] == pytest.approx(0.24, rel=0.2)
    RecordedSignal.model_validate(summed.keys())
    assert not count([flight(100 + k, 0.0, 120.0) for k in range(15)], GIVEN, summed, 20.0)[4].over
    cut = pieces(flights)
    assert cut is not None
    size = 0.6 * plain.threshold.upper
    before, after = (inject(cut, design.settings(GIVEN), "small", size) for design in (plain, summed))
    assert after.correct >= 45 and before.correct == 0


FOUR = replace(GRID, levels=(4,))


def designed(slow_tests: SlowTests | None, grid: Grid = FOUR, given: RecordedSignal = GIVEN) -> Signal:
    """The design of flights whose channels differ by up to 4 noises, with tests of these figures or without."""
    flights = [flight(k, 4.0) for k in range(20)]
    figures = {} if slow_tests is None else {"x": slow_tests}
    data = Data([one.name for one in flights], RATE, 1.0, {"x": flights}, {"x": given}, slow_tests=figures)
    return of_signal("x", data, grid, True, slow_tests is not None)


def test_beside_tests_the_sums_are_of_what_their_biases_leave():
    """Channels that differ by more than the noise get no sums without tests; with tests they do."""
    figures = SlowTests(noise_std=1.0, bias_tolerance=2.5)
    without, tested = designed(None), designed(figures)
    assert [design.spreads for design in without.designs] == [0.0]
    assert {0.0, 24.0} <= {design.spreads for design in tested.designs}
    (summed,) = (design for design in tested.designs if design.spreads == 24.0)
    allowance = summed.slow_faults["slow_allowance"]
    assert allowance is not None and 0.0 < allowance < 1.0
    keys = tested.slow_tests and tested.slow_tests.keys
    assert keys is not None
    tests = figures.model_copy(update={**keys, "factor": 99.0, "squares_factor": 99.0})  # so that sums alone isolate
    far = {"threshold": 99.0, "threshold_triplex": 99.0, "threshold_duplex": 99.0}
    settings = summed.settings(GIVEN.model_copy(update={"slow_tests": tests})).model_copy(update=far)
    others = [flight(100 + k, 4.0, 120.0) for k in range(10)]
    failed = sum(len(isolations(each.samples.T, settings, RATE, 50)) for each in others)
    assert failed <= 12  # of 6.7 that the rate allows
    less = settings.model_copy(update={"slow_allowance": allowance / 8})
    assert sum(len(isolations(each.samples.T, less, RATE, 50)) for each in others) > 30


def test_thresholds_that_are_kept_stay_and_the_rest_is_designed_beside_them():
    given = RecordedSignal(threshold=12.0, threshold_triplex=14.0, persistence=12, split_persistence=7, filter_s=0.05)
    made = designed(SlowTests(noise_std=1.0, bias_tolerance=2.5), replace(GRID, kept=True), given)
    design = made.design
    assert design is not None and made.slow_tests is not None and design.kept
    assert {level: at.upper for level, at in design.thresholds.items()} == {4: 12.0, 3: 14.0}
    assert (
        set(design.keys()) <= {"slow_allowance", "slow_limit", "stale_frames"} and design.keys()["stale_frames"] == 10
    )
    chosen = design.settings(given)
    assert (chosen.threshold, chosen.persistence, chosen.split_persistence, chosen.filter_s) == (12.0, 12, 7, 0.05)
