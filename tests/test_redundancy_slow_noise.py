"""The noisy one of two channels that are left, without a reference; and what does not make a channel look noisy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import FEWER, Voted, vote_samples
from test_redundancy_slow_tests import SEEDS, SIGMA, TESTS, noise

from rig.computer.redundancy.manager import manage_signal
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.slow_tests_config import SlowTests
from rig.computer.redundancy.state import new_state
from rig.core.frame import DecidedBy, Ilm

LEFT = [0, 2]  # channels; the comparison isolates the others
ONSET = 2500


def two_left(samples: Any, **more: Any) -> Voted:
    samples = np.array(samples)
    samples[400:, 1] += 9.0
    samples[500:, 3] += 9.0
    return vote_samples(samples, slow_tests=TESTS, **more)


def isolated(out: Voted) -> list[int | None]:
    """The first frame in which each of the two is failed."""
    return [out.failed_at()[c] for c in LEFT]


@pytest.mark.parametrize("wrong", [0, 1])
@pytest.mark.parametrize("kind", ["noise", "oscillation", "spikes"])
def test_the_noisy_one_of_two_is_isolated_without_a_reference(wrong: int, kind: str):
    for seed in SEEDS:
        samples, k, c = noise(seed, 5000), np.arange(2500), LEFT[wrong]
        size = {
            "noise": 2.0 * noise(seed + 500, 2500)[:, 0],
            "oscillation": 20.0 * SIGMA * np.sin(k * 2.0 * np.pi * 0.08),
            "spikes": np.where(k % 7 == 0, 15.0 * SIGMA, 0.0),
        }[kind]
        samples[ONSET:, c] += size
        out = two_left(samples)
        failed = isolated(out)
        at = failed[wrong] or 0
        assert ONSET + 14 <= at < ONSET + 350 and failed[1 - wrong] is None, (seed, failed)
        assert out.decided_by[at - 1] == DecidedBy.SLOW_SQUARES


def test_the_mean_product_is_half_of_what_one_is_rougher_by():
    """White noise has second differences of six times its variance: 3 (v1 - v2) in the mean, of two that are left."""
    ratio, frames = 1.2, round(60000 / FEWER)
    params = np.zeros(1, PARAMS)
    fill(
        params[0], SignalConfig(threshold=1.0, slow_tests=SlowTests.model_validate(TESTS)), (-1e3, 1e3), 4, False, 100.0
    )
    state, valid, ilm = new_state(params), np.ones(4, np.uint8), np.full(4, Ilm.ABSENT, np.uint8)
    samples = noise(1, frames) * np.array([np.sqrt(ratio), 1.0, 1.0, 1.0])
    samples[400:, 1] += 9.0
    samples[500:, 3] += 9.0
    products, shared = [], []
    for k in range(frames):
        manage_signal(samples[k], valid, ilm, np.nan, np.nan, params[0], state[0])
        if k > 1000:
            products.append(float(state[0]["tests"]["rougher"]))
            shared.append(float(state[0]["tests"]["shared"]))
    assert state[0]["failed"].tolist() == [0, 1, 0, 1]
    assert np.mean(products) / (3.0 * (ratio - 1.0) * SIGMA**2) == pytest.approx(1.0, abs=0.15)
    assert np.mean(shared) / SIGMA**2 == pytest.approx(0.0, abs=0.15)


@pytest.mark.parametrize("alike", [1.0, 2.0, 5.0])
def test_two_that_are_noisy_alike_are_kept(alike: float):
    for seed in SEEDS:
        samples = noise(seed, 20000)
        samples[ONSET:] *= alike
        assert isolated(two_left(samples)) == [None, None], seed


@pytest.mark.parametrize("size", [1.0, 10.0, 100.0])
def test_vibration_of_both_blames_none(size: float):
    for seed in SEEDS:
        samples = noise(seed, 8000)
        samples[ONSET:] += noise(seed + 500, 5500, size * SIGMA)[:, :1]
        assert isolated(two_left(samples)) == [None, None], seed


def test_a_channel_that_loses_its_gain_and_its_noise_makes_the_other_look_noisy_to_none():
    for factor in (0.0, 0.5, 0.8):
        for seed in SEEDS:
            samples = noise(seed, 8000)
            samples[ONSET:, 0] = samples[ONSET:, 0] * factor + 1e-6 * noise(seed + 500, 5500)[:, 0]
            assert isolated(two_left(samples)) == [None, None], (seed, factor)


@pytest.mark.parametrize("factor", [0.0, 0.5, -1.0])
def test_motion_that_one_of_two_misses_is_no_noise_of_the_other_once_it_was_seen(factor: float):
    """Rough motion with four channels; then one of two follows it no more, behind a converter with its noise."""
    for seed in SEEDS:
        motion = np.random.default_rng(seed + 700).normal(0.0, 3.0 * SIGMA, 6000)
        samples = noise(seed, 6000) + motion[:, None]
        samples[ONSET:, 0] -= (1.0 - factor) * motion[ONSET:]
        assert isolated(two_left(samples))[1] is None, seed


def test_smooth_motion_does_not_hide_the_noisy_one():
    samples = noise(4, 5000) + 5.0 * np.sin(np.arange(5000) / 40.0)[:, None]
    samples[ONSET:, 2] += 3.0 * noise(504, 2500)[:, 0]
    failed = isolated(two_left(samples))
    assert failed[0] is None and ONSET < (failed[1] or 0) < ONSET + 300


@pytest.mark.parametrize("frames", [1, 7, 13])
@pytest.mark.parametrize("size", [0.1, 1.0, 100.0])
def test_a_burst_of_one_of_two_isolates_none(frames: int, size: float):
    for seed in SEEDS:
        samples = noise(seed, 4000)
        samples[ONSET : ONSET + frames, 0] += size * np.where(np.arange(frames) % 2, 1.0, -1.0)
        assert isolated(two_left(samples, split_persistence=20)) == [None, None], seed


def test_no_channel_is_noisy_before_its_noise_is_known():
    samples = noise(5, 480)
    samples[100:, 0] += 10.0 * noise(505, 380)[:, 0]
    samples[20:, 1] += 9.0
    samples[60:, 3] += 9.0
    assert vote_samples(samples, slow_tests=TESTS).failed_at()[0] is None
