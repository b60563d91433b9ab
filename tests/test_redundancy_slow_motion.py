"""Motion, as the slow-fault tests know it: what moves the median and is none of the aircraft hides no later fault."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_redundancy_slow_noise import isolated, two_left
from test_redundancy_slow_tests import SEEDS, SIGMA, noise, truth, vote

ONSET = 2500


@pytest.mark.parametrize("frames", [1, 3])
@pytest.mark.parametrize("sizes", [(5.0, 5.0), (5.0, 8.0), (5.0, -5.0), (3.0, 6.0)])
def test_a_burst_of_two_channels_delays_the_isolation_of_a_third_by_less_than_a_second(
    frames: int, sizes: tuple[float, float]
):
    """Off alike it is a split, off by different amounts to one side a median off the majority; the way back counts."""
    for seed in SEEDS:
        samples = noise(seed, 4000)
        samples[1650:, 0] += 0.15
        quiet = vote(samples, truth(seed, 4000), tests={"skew_frames": 0.5}).failed_at()
        samples[1500 : 1500 + frames, [1, 3]] += sizes
        burst = vote(samples, truth(seed, 4000), tests={"skew_frames": 0.5}).failed_at()
        assert quiet[1:] == burst[1:] == [None] * 3
        assert abs((burst[0] or 0) - (quiet[0] or 0)) < 100, (seed, quiet, burst)


def test_two_unequal_faults_that_are_isolated_hide_no_third():
    """Before they are, the median is between a good channel and a bad one."""
    for seed in SEEDS:
        samples = noise(seed, 4000)
        samples[1500:, [1, 3]] += (5.0, 8.0)
        samples[1650:, 0] += 0.15
        failed = vote(samples, truth(seed, 4000), tests={"skew_frames": 0.5}).failed_at()
        assert 1650 < (failed[0] or 0) < 1850 and failed[2] is None, (seed, failed)


def noisy_after(seed: int, size: float = 3.0) -> Any:
    samples = noise(seed, 5000)
    samples[ONSET:, 0] += np.random.default_rng(seed + 500).normal(0.0, size * SIGMA, 2500)
    return samples


@pytest.mark.parametrize("sizes", [(5.0, 5.0), (5.0, 8.0)])
def test_a_burst_of_one_frame_hides_no_noise_of_one_of_two_left(sizes: tuple[float, float]):
    """It was the roughest motion ever seen, for minutes."""
    for seed in SEEDS:
        samples = noisy_after(seed)
        quiet = isolated(two_left(samples))
        samples[300, [0, 1]] += sizes
        burst = isolated(two_left(samples))
        assert quiet[1] is burst[1] is None and ONSET < (quiet[0] or 0) < ONSET + 300
        assert abs((burst[0] or 0) - (quiet[0] or 0)) <= 10, (seed, quiet, burst)


@pytest.mark.parametrize("motion", [0.05, 0.2])
@pytest.mark.parametrize("gap", [1, 7])
def test_missing_samples_in_a_manoeuvre_hide_no_noise_of_one_of_two_left(motion: float, gap: int):
    """After a gap the median has moved by several frames, and this is no second difference."""
    k = np.arange(5000)
    for seed in SEEDS:
        samples = noisy_after(seed) + (motion * 60.0 * np.sin(k / 60.0))[:, None]
        quiet = isolated(two_left(samples))
        samples[1500 : 1500 + gap, 0] = np.nan
        missing = isolated(two_left(samples))
        assert quiet[1] is missing[1] is None and ONSET < (quiet[0] or 0) < ONSET + 300
        assert abs((missing[0] or 0) - (quiet[0] or 0)) <= 10, (seed, quiet, missing)


def test_gaps_once_a_second_do_not_switch_the_noise_of_one_of_two_off():
    """Its means keep what they have counted: the age of the means is not that of the last gap."""
    for seed in SEEDS:
        samples = noisy_after(seed)
        samples[::100, 2] = np.nan
        failed = isolated(two_left(samples))
        assert ONSET < (failed[0] or 0) < ONSET + 400 and failed[1] is None, (seed, failed)


SKEW = np.array([0.0, 0.1, 0.4, 0.5])  # frames by which the channels are sampled earlier


def sampled(seed: int, value: Any) -> Any:
    """What four channels that are not synchronised show of a value a frame."""
    k = np.arange(len(value))
    return noise(seed, len(value)) + np.stack([np.interp(k - skew, k, value) for skew in SKEW], axis=1)


def rolled_into(rate: float, start: int, frames: int, total: int) -> Any:
    """A value that changes by ``rate`` a frame for some time; in and out of it within a second."""
    k = np.arange(total)
    return np.cumsum(rate * np.clip(np.minimum(k - start, start + frames - k) / 100.0, 0.0, 1.0))


@pytest.mark.parametrize("seconds", [8, 40, 120])
@pytest.mark.parametrize("sizes", [2.0, 4.0])
def test_after_a_steady_turn_no_channel_is_isolated_for_what_was_learned_in_it(seconds: int, sizes: float):
    """The skew in a turn of a minute is learned as a bias in part, and at the end of it nothing moves any more."""
    for seed in SEEDS:
        samples = sampled(seed, rolled_into(sizes * SIGMA, 1000, 100 * seconds, 1000 + 100 * seconds + 1500))
        assert vote(samples, tests={"skew_frames": 0.5}).failed_at() == [None] * 4, seed


def test_an_offset_is_isolated_as_soon_once_the_bias_of_a_turn_is_forgotten():
    for seed in SEEDS:
        turned, straight = (sampled(seed, rolled_into(rate * SIGMA, 1000, 4000, 12_000)) for rate in (4.0, 0.0))
        turned[9500:, 1] += 0.1
        straight[9500:, 1] += 0.1
        first, second = (vote(samples, tests={"skew_frames": 0.5}).failed_at() for samples in (turned, straight))
        assert first[0] is first[2] is first[3] is None and second[1] is not None
        assert 9500 < (first[1] or 0) < second[1] + 60, (seed, first, second)


@pytest.mark.parametrize("every", [2, 3, 4])
def test_a_channel_that_is_there_in_every_other_frame_lets_motion_be_seen(every: int):
    """Each frame with all channels follows one without, and its change is that of several frames."""
    for seed in SEEDS:
        swing = 60.0 * SIGMA * np.sin(np.arange(6000) / 60.0)
        samples, valid = sampled(seed, np.where(np.arange(6000) < 3000, 0.0, swing * 4.0)), np.ones((6000, 4), int)
        valid[np.arange(6000) % every != 0, 3] = 0
        assert vote(samples, tests={"skew_frames": 0.5}, valid=valid).failed_at() == [None] * 4, seed


@pytest.mark.parametrize(
    "shares", [(1.0, 0.7, 0.7, 0.7), (1.0, 0.6, 0.6, 0.6), (1.0, 0.8, 0.7, 0.6), (0.8, 0.5, 0.5, 0.5)]
)
@pytest.mark.parametrize("left", [4, 2])
def test_a_channel_with_the_noise_of_its_data_sheet_is_healthy_beside_quieter_ones(
    shares: tuple[float, ...], left: int
):
    for seed in SEEDS:
        samples = noise(seed, 6000) * shares
        out = vote(samples) if left == 4 else two_left(samples)
        assert [out.failed_at()[c] for c in (0, 2)] == [None, None], seed


def test_noise_beyond_the_data_sheet_is_isolated_beside_quieter_ones():
    for seed in SEEDS:
        samples = noise(seed, 6000) * (0.7, 0.7, 0.7, 0.7)
        samples[3000:, 0] *= 2.5  # 1.75 times the data sheet
        failed = vote(samples).failed_at()
        assert 3000 < (failed[0] or 0) < 3600 and failed[1:] == [None] * 3, (seed, failed)
