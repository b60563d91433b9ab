"""Level 1 by hand: the last channel against its in-line monitor and the reference (persistence 8, threshold 1)."""

from typing import Any

import numpy as np
import pytest
from conftest import rows, vote_samples
from numpy.typing import NDArray

from rig.core.frame import DecidedBy, Ilm, Pattern, State
from rig.core.units.constants import TWO_PI

NAN = np.nan
GOOD, BAD, ABSENT = Ilm.GOOD, Ilm.BAD, Ilm.ABSENT


def alone(value: Any, frames: int = 30) -> NDArray[np.float64]:
    """Channel 4 as the only comparable sample."""
    samples = np.full((frames, 4), NAN)
    samples[:, 3] = value
    return samples


def says(flag: Ilm, since: int, until: int = 30, frames: int = 30) -> NDArray[np.int64]:
    """Channel 4's monitor: ``flag`` from frame ``since`` (from 1) to ``until``; no other channel has one."""
    flags = np.full((frames, 4), int(ABSENT))
    flags[since - 1 : until, 3] = flag
    return flags


@pytest.mark.requirement("redundancy", "the last channel is held to its monitor and its reference")
def test_the_last_channel_fails_at_the_eighth_frame_in_which_its_monitor_says_bad():
    out = vote_samples(alone(0.1 * np.arange(1, 31)), ilm=says(BAD, since=11))
    assert out.failed_at() == [8, 8, 8, 18]
    assert np.allclose(out.voted[:10], 0.1 * np.arange(1, 11))
    assert np.allclose(out.voted[10:], 1.0)  # no reference: the last vote is held
    assert (out.state[10:17, 3] == State.SUSPECT).all() and out.state[9, 3] == State.OK
    assert (out.pattern[:18] == Pattern.NORMAL).all() and (out.pattern[18:] == Pattern.LOST).all()
    assert (out.decided_by[:10] == DecidedBy.NONE).all() and out.decided_by[17] == DecidedBy.ILM
    assert out.level[16] == 1 and (out.level[17:] == 0).all()


@pytest.mark.parametrize("flag", [GOOD, ABSENT])
def test_the_last_channel_is_used_while_nothing_disputes_it(flag: Ilm):
    out = vote_samples(alone(0.1 * np.arange(30)), ilm=says(flag, since=1))
    assert out.failed_at() == [8, 8, 8, None]
    assert np.allclose(out.voted, 0.1 * np.arange(30))
    assert (out.state[:, 3] == State.OK).all()


@pytest.mark.requirement("redundancy", "the last channel is held to its monitor and its reference")
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("thresholds", "failed"), [(1.4, None), (1.5, None), (1.51, 18), (1.6, 18)])
def test_the_last_channel_fails_beyond_one_and_a_half_reference_thresholds(
    side: int, thresholds: float, failed: int | None
):
    reference = rows((10, NAN), (20, side * 2.0 * thresholds))
    out = vote_samples(alone(0.0), reference=reference, reference_threshold=2.0)
    assert out.failed_at() == [8, 8, 8, failed]
    assert (out.voted[:10] == 0).all()
    if failed:
        assert np.allclose(out.voted[10:18], side * 2 * thresholds)
        assert out.decided_by[17] == DecidedBy.REFERENCE and out.state[16, 3] == State.SUSPECT
    else:
        assert (out.voted == 0).all() and (out.decided_by == DecidedBy.NONE).all()


def test_a_bad_monitor_is_enough_when_the_reference_agrees_and_the_vote_is_the_reference():
    out = vote_samples(alone(0.0), ilm=says(BAD, since=11), reference=np.full(30, 0.25))
    assert out.failed_at()[3] == 18
    assert (out.voted[:10] == 0).all() and (out.voted[10:18] == 0.25).all()
    assert out.decided_by[17] == DecidedBy.ILM


@pytest.mark.parametrize(("until", "decided_by"), [(30, DecidedBy.ILM), (17, DecidedBy.REFERENCE)])
def test_who_spoke_in_the_last_frame_decided_the_monitor_first(until: int, decided_by: DecidedBy):
    reference = rows((10, NAN), (20, 5.0))
    out = vote_samples(alone(0.0), ilm=says(BAD, since=11, until=until), reference=reference)
    assert out.failed_at()[3] == 18
    assert out.decided_by[17] == decided_by


def test_one_frame_without_a_word_against_it_resets_the_last_channels_count():
    flags = says(BAD, since=1, until=7) | says(ABSENT, since=8)
    flags[8:15, 3] = BAD
    out = vote_samples(alone(0.0), ilm=flags)
    assert out.failed_at() == [8, 8, 8, None]


def test_a_reference_that_has_become_unusable_says_nothing_of_the_last_channel():
    """Off for eight frames of a healthy vote; at level 1 it is not monitored, so it stays unusable when it agrees."""
    samples = rows((8, (0, 0, 0, 0)), (22, (NAN, NAN, NAN, 0)))
    out = vote_samples(samples, reference=rows((8, 5.0), (10, 0.0), (12, 5.0)))
    assert (out.reference_usable[7:] == 0).all()
    assert out.failed_at() == [16, 16, 16, None]
    assert (out.voted == 0).all()


def test_a_reference_that_has_become_unusable_is_not_voted_either():
    samples = rows((8, (0, 0, 0, 0)), (22, (NAN, NAN, NAN, 9)))
    out = vote_samples(samples, reference=np.full(30, 5.0), ilm=says(BAD, since=9))
    assert (out.voted == 0).all() and out.failed_at() == [16] * 4


def test_at_level_one_a_reference_far_off_stays_usable():
    out = vote_samples(alone(0.0), reference=np.full(30, 1.4))  # beyond its threshold, within 1.5
    assert (out.reference_usable == 1).all() and out.failed_at()[3] is None


def test_a_sample_left_alone_by_a_dropout_is_not_failed_when_the_others_come_back_in_time():
    samples = rows((3, (0, 0, 0, 0)), (7, (NAN, NAN, NAN, 9)), (10, (0, 0, 0, 0)))
    out = vote_samples(samples, ilm=says(BAD, since=4, until=10, frames=20))
    assert out.failed_at() == [None] * 4
    assert (out.voted == 0).all() and (out.level == 4).all()


@pytest.mark.parametrize(("reference", "failed"), [(0.05, None), (0.2, 8)])
def test_the_last_channel_of_an_angle_is_compared_the_short_way_round(reference: float, failed: int | None):
    samples = alone(TWO_PI - 0.08)
    settings: dict[str, Any] = {"wraps": True, "limits": (0.0, TWO_PI), "threshold": 0.1, "reference_threshold": 0.1}
    out = vote_samples(samples, reference=np.full(30, reference), **settings)
    assert out.failed_at()[3] == failed


def test_the_trend_of_the_last_channel_is_kept():
    out = vote_samples(alone(0.1 * np.arange(30)))
    assert out.trend_high[[1, 3, 8, 29]].tolist() == out.trend_low[[1, 3, 8, 29]].tolist() == [1, 7, 255, 255]
