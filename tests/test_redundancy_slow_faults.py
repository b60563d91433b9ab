"""Slow faults: small deviations that are summed, alone and beside the slow-fault tests, and samples that repeat."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import Voted, vote_samples
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from rig.computer.redundancy.manager_config import SignalConfig
from rig.core.frame import DecidedBy, State

RATE_HZ = 100.0  # of vote_samples
RNG = np.random.default_rng(5)
NOISE = RNG.normal(0.0, 0.01, (6000, 4))
SUMMING: dict[str, Any] = {"threshold": 0.5, "slow_allowance": 0.05, "slow_limit": 0.5}
# Tests that learn biases and find nothing below 40 times their limits.
LEARNING: dict[str, Any] = {"slow_tests": {"noise_std": 0.1, "bias_tolerance": 0.1, "factor": 40.0}}


def vote(samples: Any, **settings: Any) -> Voted:
    return vote_samples(np.asarray(samples, float), **settings)


def test_a_mean_below_the_noise_is_found_by_its_sum_in_the_time_of_page():
    samples = NOISE.copy()
    samples[1000:, 1] += 0.10
    assert vote(samples, threshold=0.5).failed_at() == [None] * 4
    out = vote(samples, **SUMMING)
    # 0.10 less 0.05 sums up to 0.5 in 10 s.
    assert out.failed_at()[1] == pytest.approx(1000 + 0.5 / 0.05 * RATE_HZ, rel=0.05)
    k = int(np.argmax(out.state[:, 1] == State.FAILED))
    assert out.decided_by[k] == DecidedBy.SLOW and [out.failed_at()[c] for c in (0, 2, 3)] == [None] * 3


@pytest.mark.requirement("redundancy", "sums beside the slow-fault tests")
def test_beside_the_tests_the_sums_leave_out_the_biases_that_those_learn():
    """Off by 0.1 from the first frame on: beyond the allowance, until it is learned in the first frame."""
    samples = NOISE[:4000] + np.array([0.1, 0.0, 0.0, 0.0])
    assert vote(samples, **SUMMING).failed_at()[0] is not None
    assert vote(samples, **SUMMING, **LEARNING).failed_at() == [None] * 4


@pytest.mark.requirement("redundancy", "sums beside the slow-fault tests")
def test_beside_the_tests_a_mean_is_summed_while_it_is_learned():
    """Learned is 0.1. Of 0.1 more a thousandth is learned in every frame: 0.1 q^k less 0.05 sums up to 2 in 42."""
    samples = np.zeros((2000, 4))
    samples[:, 1] = 0.1
    samples[1000:, 1] = 0.2
    out = vote(samples, **SUMMING | {"slow_limit": 0.02}, **LEARNING)
    assert out.failed_at() == [None, 1042, None, None] and out.decided_by[1041] == DecidedBy.SLOW


@pytest.mark.parametrize("offsets", [(0.2, 0.2, 0.0, 0.0), (0.0, 0.3, 0.3, 0.0)])
def test_two_against_two_fail_no_channel_by_sums(offsets: tuple[float, ...]):
    samples = np.zeros((6000, 4)) + offsets
    assert vote(samples, **SUMMING).failed_at() == [None] * 4


def test_a_sample_that_repeats_miscompares_and_one_that_changes_does_not():
    samples = NOISE[:200].copy()
    samples[100:, 2] = samples[100, 2]
    out = vote(samples, threshold=0.5, stale_frames=20, persistence=8)
    assert out.failed_at() == [None, None, 128, None]  # frame 101 is the first, 20 repeats, the eighth of which counts
    assert vote(samples, threshold=0.5, stale_frames=99).failed_at() == [None] * 4


def test_two_that_stick_are_failed_before_a_third_fault_and_a_manoeuvre():
    """The stuck together: used today, and the healthy one is failed."""
    manoeuvre = np.concatenate([np.zeros(1000), 0.5 * np.sin(np.arange(1000) / 50)])
    samples = NOISE[:2000] + manoeuvre[:, None]
    samples[300:, 0], samples[310:, 1] = samples[300, 0], samples[310, 1]
    samples[800:, 2] = 2.0
    settings = {"threshold": 0.1, "reference_threshold": 0.1, "reference": manoeuvre}
    assert vote(samples, **settings).failed_at()[3] is not None
    out = vote(samples, **settings, stale_frames=50)
    assert out.failed_at() == [358, 368, 810, None] and abs(out.voted[-500:] - samples[-500:, 3]).max() < 1e-12


@given(
    st.integers(0, 3),
    st.sampled_from([1, 3, 7]),
    st.sampled_from([10.0, 100.0, -10.0]),
    st.integers(10, 100),
    st.booleans(),
)
def test_what_lasts_less_than_the_persistence_fails_no_channel(c: int, frames: int, size: float, at: int, biased: bool):
    samples = NOISE[:400].copy()
    samples[at : at + frames, c] += size * 0.2
    more = LEARNING if biased else {}
    out = vote(samples, **SUMMING | {"slow_limit": 0.1}, **more, stale_frames=3, persistence=8)
    assert out.failed_at() == [None] * 4


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"slow_limit": 1.0}, "slow_allowance, slow_limit: give both or neither"),
        ({"stale_frames": -1}, "greater than or equal to 0"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings: dict[str, Any], says: str):
    with pytest.raises(ValidationError, match=says):
        SignalConfig.model_validate({"threshold": 0.2, **settings})
