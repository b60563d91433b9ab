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
