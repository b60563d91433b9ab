"""Slow faults: a bias that is learned, small deviations that are summed, samples that repeat."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import Voted, vote_samples
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from rig.computer.redundancy.manager_config import SignalConfig
from rig.core.frame import DecidedBy, Pattern, State

RATE_HZ = 100.0  # of vote_samples
RNG = np.random.default_rng(5)
NOISE = RNG.normal(0.0, 0.01, (6000, 4))
LEARNING: dict[str, Any] = {"threshold": 0.2, "equalise_bound": 0.1, "equalise_s": 2.0}
SUMMING: dict[str, Any] = {"threshold": 0.5, "slow_allowance": 0.05, "slow_limit": 0.5}


def vote(samples: Any, **settings: Any) -> Voted:
    return vote_samples(np.asarray(samples, float), **settings)


def test_a_bias_is_learned_with_its_time_constant():
    samples = np.zeros((1000, 4))
    samples[400:, 0] = 0.09  # 4 s later it is learned but for exp(-2)
    left = 0.09 * (1.0 - 1.0 / 200.0) ** 400
    for size, failed in ((0.2 - left - 1e-6, None), (0.2 - left + 1e-6, 808)):
        samples[800:, 0] = 0.09 + size
        assert vote(samples, **LEARNING).failed_at()[0] == failed
        assert vote(samples, **{**LEARNING, "equalise_bound": 0.0}).failed_at()[0] == 808


def test_what_is_there_from_the_first_frame_is_learned_as_a_mean():
    biases = np.array([0.06, 0.02, -0.02, -0.07])  # the middle is zero
    samples = np.tile(biases, (100, 1))
    samples[1, 0] += 0.02  # of the first two frames the mean is 0.07
    for size, failed in ((0.2 + 0.01 - 1e-6, None), (0.2 + 0.01 + 1e-6, 10)):
        samples[2:, 0] = biases[0] + size
        assert vote(samples, **LEARNING, persistence=8).failed_at()[0] == failed


def test_outlier_thresholds_wait_until_the_biases_are_learned():
    """Channel 1 stands 0.08 apart from the first frame on: a bias, as 0.08 later on is not."""
    samples = NOISE[:1000] * 0.1 + np.array([0.09, 0.01, -0.01, 0.0])
    settings = {**LEARNING, "outlier_threshold": 0.03}
    assert vote(samples, **{**settings, "equalise_bound": 0.0}).failed_at()[0] == 8
    assert vote(samples, **settings).failed_at() == [None] * 4
    for onset, failed in ((100, None), (300, 308)):
        later = samples.copy()
        later[onset:, 1] += 0.05
        assert vote(later, **{**settings, "equalise_s": 2.0}).failed_at()[1] == failed


def test_no_vote_is_moved_by_a_learned_bias():
    samples = NOISE + np.array([0.08, 0.03, 0.0, -0.05])
    assert (vote(samples, **LEARNING).voted == vote(samples, **{**LEARNING, "equalise_bound": 0.0}).voted).all()


def test_a_drift_is_learned_no_further_than_the_bound():
    samples = np.zeros((6000, 4))
    samples[:, 2] = np.arange(6000) / RATE_HZ * 0.01  # 0.2 after 20 s, 0.3 after 30 s
    assert vote(samples, threshold=0.2).failed_at()[2] == 2009
    assert vote(samples, **LEARNING).failed_at()[2] == 3009


def test_a_readmitted_channel_begins_without_a_bias():
    samples = NOISE[:4000] + np.array([0.0, 0.0, 0.0, 0.09])
    samples[1000:1100, 3] += 1.0
    out = vote(samples, **LEARNING, resets=[(2000, 4)])
    assert out.state[1999, 3] == State.FAILED and out.state[2000, 3] == State.OK
    assert (out.state[2001:, 3] == State.OK).all()


def test_a_mean_below_the_noise_is_found_by_its_sum_in_the_time_of_page():
    samples = NOISE.copy()
    samples[1000:, 1] += 0.10
    assert vote(samples, threshold=0.5).failed_at() == [None] * 4
    out = vote(samples, **SUMMING)
    # 0.10 less 0.05 sums up to 0.5 in 10 s.
    assert out.failed_at()[1] == pytest.approx(1000 + 0.5 / 0.05 * RATE_HZ, rel=0.05)
    k = int(np.argmax(out.state[:, 1] == State.FAILED))
    assert out.decided_by[k] == DecidedBy.SLOW and [out.failed_at()[c] for c in (0, 2, 3)] == [None] * 3


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
    out = vote(samples, **{**SUMMING, "slow_limit": 0.1, **more, "stale_frames": 3, "persistence": 8})
    assert out.failed_at() == [None] * 4


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"equalise_bound": 0.3}, "at most the threshold of every level, 0.2, got 0.3"),
        ({"equalise_bound": 0.15, "threshold_duplex": 0.1}, "at most the threshold of every level, 0.1, got 0.15"),
        ({"slow_limit": 1.0}, "slow_allowance, slow_limit: give both or neither"),
        ({"equalise_s": 0.0}, "greater than 0"),
        ({"stale_frames": -1}, "greater than or equal to 0"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(settings: dict[str, Any], says: str):
    with pytest.raises(ValidationError, match=says):
        SignalConfig.model_validate({"threshold": 0.2, **settings})


@pytest.mark.parametrize(("pair", "failed"), [(0.02, [None] * 4), (-0.02, [1310, 1310, None, None])])
def test_halves_that_the_bias_alone_tells_apart_are_not_settled_by_the_reference(pair: float, failed: list[int | None]):
    """Learned are 0.1 and -0.1: with +-0.02 the halves are 0.16 or 0.24 apart, beyond 0.15, but in the first case the
    half that is smaller without its bias has the larger samples, and the reference beside it says nothing."""
    sides = np.array([1.0, 1.0, -1.0, -1.0])
    samples = np.concatenate([np.tile(size * sides, (frames, 1)) for size, frames in ((0.07, 300), (0.1, 1000))])
    samples = np.concatenate([samples, np.tile(pair * sides, (30, 1))])
    reference = np.where(np.arange(len(samples)) < 1300, 0.0, 0.03)
    learning = {"threshold": 0.15, "equalise_bound": 0.12, "equalise_s": 1.0, "tie_break": ["reference"]}
    out = vote(samples, **learning, reference=reference)
    assert out.pattern[1299] == Pattern.NORMAL and (out.pattern[1300:1310] == Pattern.P2_2).all()
    assert out.failed_at() == failed
