"""Designs of slow faults: the bias bound, the sums of small deviations, stale samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rig.log.recordings.vote_config import RecordedSignal
from rig.studies.thresholds.design import DataBlock, Design, Grid, designs, with_sums
from rig.studies.thresholds.holdout import count
from rig.studies.thresholds.pieces import isolations
from rig.studies.thresholds.slow_fault_limits import alarms, begun, equalise_bound, residuals, stale_frames, unbiased
from rig.studies.thresholds.tradeoff import inject, pieces

RATE = 100.0
GIVEN = RecordedSignal(threshold=1.0, equalise_s=2.0)
GRID = Grid(20.0, (8,), (4, 3), (0.0,), slow_faults=("bias", "stale"))


def flight(seed: int, biases: float = 0.0, seconds: float = 30.0) -> DataBlock:
    """A common motion with white noise of 1, and a bias of each channel."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE)
    motion = 30.0 * np.sin(2 * np.pi * np.arange(n) / RATE / 5.0)
    return DataBlock(f"{seed}", motion + rng.normal(size=(4, n)) + rng.uniform(-biases, biases, (4, 1)), RATE)


def test_residuals_are_taken_from_the_middle_of_those_that_there_are():
    still = np.zeros((4, 100)) + np.array([[-3.0], [-1.0], [1.0], [5.0]])
    assert residuals([still, np.zeros((4, 9))], wraps=False) == (pytest.approx([5.0, 0.0]), 0.0)
    still[0, :50] = np.nan  # then the middle is 1, else 0
    found = residuals([still], wraps=False)
    assert found.means == pytest.approx([4.5]) and not found.noisy
    turned = np.array([[3.1], [3.1], [-3.1], [-3.1]]) + np.zeros((4, 10))
    assert residuals([turned], wraps=True).means == pytest.approx([np.pi - 3.1])
    assert residuals([flight(1).samples], wraps=False).noisy


def test_the_bound_of_few_flights_is_the_largest_and_of_many_beyond_it():
    means = np.abs(np.random.default_rng(0).normal(size=200))
    rng = np.random.default_rng(1)
    assert equalise_bound(means[:8], [0.01] * 8, 1e-3, rng) == means[:8].max()
    assert equalise_bound(means, [0.01] * 200, 1e-3, rng) > means.max()


def test_constant_biases_are_gone_once_they_are_learned():
    clean = np.tile(np.sin(np.arange(500) / 50.0), (4, 1))
    biased = clean + np.array([[0.5], [0.2], [-0.2], [-0.7]])
    settings = RecordedSignal(threshold=1.0, equalise_bound=1.0, equalise_s=2.0)
    assert unbiased(biased, biased, settings, RATE) == pytest.approx(clean[:, 200:], abs=1e-12)
    bounded = settings.model_copy(update={"equalise_bound": 0.6})
    assert unbiased(biased, biased, bounded, RATE)[3] == pytest.approx(clean[3, 200:] - 0.1, abs=1e-12)
    assert unbiased(biased[:, :199], biased[:, :199], settings, RATE).shape == (4, 0)
    (state,) = begun([biased[:, :50]], settings, 4, RATE)
    assert state["bias"] == pytest.approx([0.5, 0.2, -0.2, -0.7]) and list(state["learned"]) == [50] * 4


def test_sums_alarm_with_the_largest_allowance_that_lets_them():
    samples = np.zeros((4, 400))
    samples[1, 100:] = 0.5
    settings = RecordedSignal(threshold=9.0, slow_allowance=0.1, slow_limit=1.0)
    found = alarms(samples, settings, RATE, np.array([0.1, 0.3, 0.6]))
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


@pytest.fixture(scope="module")
def biased() -> list[Design]:
    return designs([flight(k, 10.0) for k in range(40)], GIVEN, GRID)


def test_behind_learned_biases_outliers_are_smaller_and_the_budget_holds(biased: list[Design]):
    plain, learned = biased
    keys = learned.keys()
    assert plain.slow_faults == {"equalise_bound": 0.0, "stale_frames": 10} and not plain.keys().get("equalise_bound")
    assert keys["outlier_threshold"] < 0.3 * keys["threshold"] and keys["stale_frames"] == 10
    assert keys["equalise_bound"] <= min(keys["threshold"], keys["threshold_triplex"]) and keys["equalise_s"] == 2.0
    RecordedSignal.model_validate(keys)
    others = [flight(100 + k, 10.0, 120.0) for k in range(15)]
    found = count(others, GIVEN, learned, 20.0)[4]
    assert found.expected == pytest.approx(10.0) and not found.over
    lower = replace(learned, outliers={4: replace(learned.outliers[4], upper=0.1 * learned.outliers[4].upper)})
    assert count(others, GIVEN, lower, 20.0)[4].over


def with_transients(one: DataBlock, frames: int, size: float) -> np.ndarray:
    """Return the samples of a flight with so many frames of ``size`` on a channel every 5 s, on each in turn."""
    samples = one.samples.copy()
    for i, k in enumerate(range(1000, samples.shape[1] - 200, 500)):
        samples[i % 4, k : k + frames] += size
    return samples


def test_a_transient_of_a_frame_less_than_the_persistence_fails_no_channel_with_a_noisy_frame_beside_it(
    biased: list[Design],
):
    learned = biased[1]
    hit = [with_transients(flight(200 + k, 10.0, 120.0), 7, 1000.0) for k in range(10)]
    within = replace(learned, outliers={4: replace(learned.outliers[4], upper=0.25 * learned.outliers[4].upper)})
    failed, with_less = (
        sum(len(isolations(each.T, design.settings(GIVEN), RATE, 50)) for each in hit) for design in (learned, within)
    )
    assert failed == 0 and with_less > 20  # of 220


def test_thresholds_above_the_noise_of_single_frames_stand_any_transient_and_those_of_the_budget_alone_do_not():
    flights, grid = [flight(k, 0.0) for k in range(20)], Grid(20.0, (8,), (4, 3), (0.0,))
    (alone,), (above,) = (designs(flights, GIVEN, replace(grid, transients=asked)) for asked in (False, True))
    assert above.threshold.upper > 1.5 * alone.threshold.upper and above.threshold.point == alone.threshold.point
    hit = [with_transients(flight(200 + k, 0.0, 120.0), 7, 1000.0) for k in range(10)]
    failed, failed_alone = (
        sum(len(isolations(each.T, design.settings(GIVEN), RATE, 50)) for each in hit) for design in (above, alone)
    )
    assert failed == 0 and failed_alone > 20  # of 220


def test_an_outlier_threshold_is_exceeded_in_few_frames_by_any_channel(biased: list[Design]):
    at, exceeding, frames = biased[1].outliers[4].upper, 0, 0
    for k in range(15):
        noise = flight(300 + k).samples  # without biases, as if they were learned without an error
        apart = np.abs(noise[:, None] - noise[None]) + np.where(np.eye(4, dtype=bool), np.inf, 0.0)[:, :, None]
        exceeding, frames = exceeding + int((apart.min(axis=1).max(axis=0) > at).sum()), frames + noise.shape[1]
    assert exceeding / frames < 5e-4


def test_pieces_begin_with_what_was_learned_before(biased: list[Design]):
    cut = pieces([flight(k, 10.0) for k in range(40)])
    assert cut is not None
    size = 5.0 * biased[1].outliers[4].upper
    plain, learned = (inject(cut, design.settings(GIVEN), "offset", size) for design in biased)
    assert learned.correct >= 40 > plain.correct and learned.wrong == 0


def test_flights_too_short_to_learn_in_design_no_bias():
    given = GIVEN.model_copy(update={"equalise_s": 60.0})
    assert [design.outliers for design in designs([flight(k, 10.0) for k in range(20)], given, GRID)] == [{}]


def test_sums_find_what_the_noise_hides_and_the_budget_holds():
    flights = [flight(k) for k in range(40)]
    (plain,) = designs(flights, GIVEN, replace(GRID, slow_faults=("slow",)))
    summed = with_sums(flights, GIVEN, plain, 24.0, GRID)
    assert summed is not None and summed.slow_faults["slow_limit"] == pytest.approx(0.24, rel=0.2)
    RecordedSignal.model_validate(summed.keys())
    assert not count([flight(100 + k, 0.0, 120.0) for k in range(15)], GIVEN, summed, 20.0)[4].over
    cut = pieces(flights)
    assert cut is not None
    size = 0.6 * plain.threshold.upper
    before, after = (inject(cut, design.settings(GIVEN), "small", size) for design in (plain, summed))
    assert after.correct >= 45 and before.correct == 0
