"""The first frames of a signal: without a sample there is no vote to begin with; angles may be around the circle."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from conftest import vote_samples

TURN = 2.0 * np.pi
FRAMES = 400


def angles(about: float, seed: int = 1, apart: Any = (0.004, 0.003, -0.004, -0.003)) -> Any:
    """Four channels about an angle, in [-pi, pi)."""
    drawn = np.random.default_rng(seed).normal(0.0, 0.0003, (FRAMES, 4))
    return (about + np.array(apart) + drawn + np.pi) % TURN - np.pi


def there(late: int, channels: Any = range(4)) -> Any:
    """Validity of samples of which those of the first frames are missing."""
    valid = np.ones((FRAMES, 4), int)
    valid[:late, list(channels)] = 0
    return valid


def voted(samples: Any, **more: Any) -> Any:
    return vote_samples(samples, wraps=True, limits=(-np.pi, np.pi), threshold=0.04, **more)


@pytest.mark.parametrize("late", [0, 1, 5])
@pytest.mark.parametrize("about", [0.0, 1.0, np.pi])
def test_the_first_sample_of_an_angle_begins_the_vote(late: int, about: float):
    """A vote of 0 in a frame without a sample would cut the circle between channels that agree."""
    out = voted(angles(about), valid=there(late), params={"unresolved_frames": 100}.items())
    assert out.failed_at() == [None] * 4
    assert np.abs((out.voted[late:] - about + np.pi) % TURN - np.pi).max() < 0.005


@pytest.mark.parametrize("wrong", range(3))
@pytest.mark.parametrize("off", [np.pi, 2.0, -2.0])
def test_of_three_around_the_circle_the_two_that_agree_are_kept(wrong: int, off: float):
    """The circle is never cut between them, whichever comes first."""
    apart = np.array([0.004, -0.004, 0.004, 0.0])
    apart[wrong], apart[(wrong + 1) % 3], apart[(wrong + 2) % 3] = 0.0, 0.004, -0.004  # it is opposite both
    samples = angles(np.pi, apart=apart)
    samples[:, wrong] = (samples[:, wrong] + off + np.pi) % TURN - np.pi
    failed = voted(samples, channels=3).failed_at()
    assert [c for c in range(3) if failed[c] is not None] == [wrong]


@pytest.mark.parametrize("late", [0, 1, 5])
def test_behind_a_filter_a_fault_is_found_as_soon_after_frames_without_a_sample(late: int):
    samples = 1e5 + np.random.default_rng(2).normal(0.0, 5.0, (FRAMES, 4))
    samples[300:, 2] += 2000.0
    out = vote_samples(samples, limits=(0.0, 2e5), threshold=300.0, filter_s=0.1, valid=there(late))
    assert 300 < (out.failed_at()[2] or 0) < 330 and out.failed_at()[:2] == [None, None]


def test_a_channel_that_was_failed_before_the_first_sample_of_others_agrees_with_no_vote_of_zero():
    """Channel 1 is missing until it is failed, the others for longer: what it shows then is compared with nothing."""
    samples = np.full((FRAMES, 4), 0.2)
    valid = there(30)
    valid[10:, 0] = 1
    out = vote_samples(samples, valid=valid, resets=[(25, 1)], persistence=8, readmit_frames=10)
    assert 0 < (out.failed_at()[0] or 0) < 10
    assert (out.state[26:30, 0] == out.state[12, 0]).all()
