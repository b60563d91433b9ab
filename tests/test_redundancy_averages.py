"""Averages and windows as baselines, each against its formula in plain numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import constant, vote_samples
from numpy.typing import NDArray

from rig.core.frame import State

Floats = NDArray[np.float64]
TURN = 2.0 * np.pi


def noise(n: int, channels: int = 4, seed: int = 2) -> Floats:
    out = np.full((n, 4), np.nan)
    out[:, :channels] = np.random.default_rng(seed).normal(0.0, 0.1, (n, channels))
    return out


def of_repeats(samples: Floats, share: float) -> Floats:
    """The trimmed mean as that of each sample 1,000 times, of which whole ones are cut off."""
    many = np.sort(np.repeat(samples, 1000, axis=1), axis=1)
    cut = round(share * many.shape[1])
    return many[:, cut : many.shape[1] - cut].mean(axis=1)


@pytest.mark.parametrize("channels", [4, 3, 2])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.25, 0.3])
def test_a_trimmed_mean_is_that_of_samples_that_can_be_cut(channels: int, share: float):
    samples = noise(40, channels)
    out = vote_samples(samples, manager="trimmed_mean", told={"share": share}, channels=channels)
    assert out.voted == pytest.approx(of_repeats(samples[:, :channels], share), abs=1e-12)
    assert out.failed_at() == [None] * 4


@pytest.mark.parametrize("channels", [4, 3, 2, 1])
def test_all_trimmed_is_the_median(channels: int):
    samples = noise(40, channels)
    out = vote_samples(samples, manager="trimmed_mean", told={"share": 0.5}, channels=channels)
    assert out.voted == pytest.approx(np.nanmedian(samples, axis=1), abs=1e-12)


def test_the_mid_value_is_that_of_the_first_three_in_service():
    samples = noise(60)
    samples[20:40, 0] = np.nan
    out = vote_samples(samples, manager="mid_value", persistence=1000)
    expected = np.median(samples[:, :3], axis=1)
    expected[20:40] = np.median(samples[20:40, 1:], axis=1)
    assert out.voted == pytest.approx(expected, abs=1e-12)
    two = vote_samples(constant(1.0, 2.0, np.nan, np.nan, frames=5), manager="mid_value", channels=2)
    assert (two.voted == 1.5).all()


def test_the_fourth_channel_does_not_move_the_mid_value():
    samples = noise(50)
    other = samples.copy()
    other[10:, 3] = 8.0
    first, second = (vote_samples(each, manager="mid_value").voted for each in (samples, other))
    assert np.array_equal(first, second)


def test_weights_by_variance_are_those_of_the_last_eight_samples():
    samples = noise(60) * np.array([1.0, 2.0, 4.0, 1.0]) + np.sin(np.arange(60) / 9.0)[:, None]
    out = vote_samples(samples, manager="variance_mean")
    for k in range(1, 60):
        weights = 1.0 / (samples[max(k - 7, 0) : k + 1].var(axis=0) + (1e-3 * 0.04) ** 2)
        assert out.voted[k] == pytest.approx((weights * samples[k]).sum() / weights.sum(), abs=1e-9)
    assert out.voted[0] == pytest.approx(samples[0].mean())


def test_a_stuck_channel_wins_the_weights_by_variance_and_not_those_by_residual():
    """What the published fusion cannot see: a gyro that stands still has no variance."""
    samples = noise(400) + np.sin(np.arange(400) / 20.0)[:, None]
    samples[100:, 1] = samples[99, 1]
    by_variance, by_residual = (vote_samples(samples, manager=f"{name}_mean") for name in ("variance", "inverse"))
    assert np.abs(by_variance.voted[110:] - samples[99, 1]).max() < 1e-3
    assert np.abs(by_residual.voted[200:] - np.sin(np.arange(200, 400) / 20.0)).max() < 0.2


def test_weights_by_variance_take_an_angle_the_short_way_round():
    samples = noise(60) * 0.1 * np.array([1.0, 2.0, 4.0, 1.0]) + np.linspace(-0.3, 0.3, 60)[:, None]
    plain = vote_samples(samples, manager="variance_mean", limits=(-np.pi, np.pi))
    turned = vote_samples(samples % TURN, manager="variance_mean", wraps=True, limits=(0.0, TURN))
    assert np.allclose(np.sin(turned.voted), np.sin(plain.voted), atol=1e-9)


def test_inverse_variances_are_of_the_low_passed_residuals():
    samples = noise(300)
    samples[100:, 2] += 1.5
    out = vote_samples(samples, manager="inverse_mean", told={"window": 50, "spread": 0.1})
    energy = np.zeros(4)
    for k, x in enumerate(samples):
        energy += ((x - np.median(x)) ** 2 - energy) / 50
        weights = 1.0 / (energy + 0.1**2)
        assert out.voted[k] == pytest.approx((weights * x).sum() / weights.sum(), abs=1e-12)
    assert np.abs(out.voted[200:]).max() < 0.25


@pytest.mark.parametrize("manager", ["variance_mean", "inverse_mean", "trimmed_mean", "mid_value"])
def test_an_average_stays_within_its_samples_and_holds_without_any(manager: str):
    samples = noise(120) * 1e3
    samples[60:] = np.nan
    out = vote_samples(samples, manager=manager, limits=(-1e9, 1e9))
    assert (samples[:60].min(axis=1) <= out.voted[:60]).all() and (out.voted[:60] <= samples[:60].max(axis=1)).all()
    assert (out.voted[60:] == out.voted[59]).all() and out.failed_at() == [None] * 4


def first(above: NDArray[np.bool_]) -> int | None:
    """The frame behind the first one above, as ``failed_at`` counts."""
    return int(above.argmax()) + 1 if above.any() else None


@pytest.mark.parametrize(("window", "used"), [(25, 25), (5, 15)])
def test_a_window_median_fails_the_channel_whose_running_median_is_beyond_the_limit(window: int, used: int):
    """A window that is shorter than twice the persistence less one is lengthened to that."""
    samples = noise(200)
    samples[80:, 3] += 0.4
    out = vote_samples(samples, manager="window_median", told={"limit": 0.25, "window": window})
    residuals = np.vstack([np.zeros((used, 4)), samples - np.median(samples, axis=1)[:, None]])
    medians = np.array([np.median(residuals[k + 1 : k + 1 + used], axis=0) for k in range(200)])
    expected = [first(np.abs(medians[:, c]) > 0.25) for c in range(4)]
    assert out.failed_at() == expected and expected[:3] == [None] * 3 and expected[3] is not None


def test_a_gate_fails_the_channel_whose_integral_is_used_up():
    samples = noise(400)
    samples[50:, 1] += 1.0
    told = {"gate": 0.2, "integral_frames": 30.0, "bounded": False}
    out = vote_samples(samples, manager="gate_mean", told=told)
    smooth, integral, expected = np.zeros(4), np.zeros(4), None
    for k, x in enumerate(samples):
        smooth = 0.95 * smooth + 0.05 * (x - x.mean())
        integral = np.maximum(integral + np.abs(smooth) - 0.2, 0.0)
        if (integral > 0.2 * 30.0).any():
            expected = k + 1
            break
    assert out.failed_at() == [None, expected, None, None] and expected is not None
    assert out.voted[: expected - 1] == pytest.approx(samples[: expected - 1].mean(axis=1))
    assert out.voted[-1] == pytest.approx(samples[-1, [0, 2, 3]].mean())


LEARNERS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {  # told to each; settings of the signal
    "cusum": ({"allowance": 0.1}, {}),
    "glr": ({"rms": 0.05, "limit": 40.0}, {}),
    "parity": ({"limit": 0.03}, {}),
    "innovation": ({"allowance": 0.15}, {}),
    "window_median": ({"limit": 0.1}, {}),
    "gate_mean": ({"gate": 0.05, "integral_frames": 40.0}, {}),
    "cross-voter": ({}, {"threshold": 0.16}),
    "selection": ({}, {"selection_deviation": 0.1, "selection_integral_s": 0.1}),
}


def flight(apart: float, seed: int = 3) -> Floats:
    """Channel 1 differs for good by ``apart``, little at first, from frame 400 on by all of it."""
    samples = np.random.default_rng(seed).normal(0.0, 0.02, (1500, 4))
    samples[:, 0] += apart * np.minimum(np.arange(1500) / 1000.0, 1.0)
    return samples


@pytest.mark.parametrize("manager", LEARNERS)
def test_a_bias_that_is_learned_fails_no_channel_and_a_fault_beyond_it_does(manager: str):
    told, settings = LEARNERS[manager]
    samples = flight(0.25)
    learning = {**told, "learned_bias": 0.3, "learned_frames": 100}
    plain = vote_samples(samples, manager=manager, told=told, reference=0.0, **settings)
    learned = vote_samples(samples, manager=manager, told=learning, reference=0.0, **settings)
    assert plain.failed_at()[0] is not None and learned.failed_at() == [None] * 4
    samples[1200:, 2] += 0.8
    faulty = vote_samples(samples, manager=manager, told=learning, reference=0.0, **settings)
    at = faulty.failed_at()
    assert at[2] is not None and 1200 < at[2] < 1300 and at[:2] == [None] * 2 and at[3] is None


@pytest.mark.parametrize("manager", LEARNERS)
def test_a_bias_is_learned_up_to_its_bound(manager: str):
    told, settings = LEARNERS[manager]
    learning = {**told, "learned_bias": 0.05, "learned_frames": 100}
    out = vote_samples(flight(0.6), manager=manager, told=learning, reference=0.0, **settings)
    assert out.failed_at()[0] is not None


@pytest.mark.parametrize("manager", ["cusum", "cross-voter"])
def test_a_learned_bias_moves_no_vote(manager: str):
    samples = flight(0.25)
    told = [{"learned_bias": bound, "learned_frames": 100} for bound in (0.0, 0.3)]
    both = [vote_samples(samples, manager=manager, told=each) for each in told]
    assert np.array_equal(both[0].voted, both[1].voted) and (both[1].state == State.OK).all()


@pytest.mark.parametrize("manager", [name for name in LEARNERS if name != "selection"])
@pytest.mark.parametrize("size", [10.0, -100.0])
def test_no_burst_is_learned(manager: str, size: float):
    told, settings = LEARNERS[manager]
    samples = flight(0.0)
    samples[:, 0] += 0.2
    for begin in range(120, 1400, 300):
        samples[begin : begin + 7, begin // 300 % 4] += size
    learning = {**told, "learned_bias": 0.25, "learned_frames": 1000}
    out = vote_samples(samples, manager=manager, told=learning, reference=0.0, **settings)
    assert out.failed_at() == [None] * 4
