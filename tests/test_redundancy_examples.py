"""The table of examples that every implementation of the monitor must satisfy (eps 1, persistence 8, split 10)."""

import numpy as np
import pytest
from conftest import constant, vote_samples

from rig.core.frame import DecidedBy, Pattern, State

K = np.arange(30.0)
RISING = np.stack([0.1 * K, 0.1 * K + 0.1, 0.1 * K + 5, 0.1 * K + 5.1], axis=1)


@pytest.mark.requirement(
    "redundancy", "a channel that disagrees with all others for `persistence` frames is isolated, latched"
)
def test_one_channel_off_is_failed_at_its_eighth_frame():
    out = vote_samples(constant(0, 0.2, -0.1, 5))
    assert out.failed_at() == [None, None, None, 8]
    assert ((out.voted >= 0) & (out.voted <= 0.2)).all()
    assert (out.level[:7] == 4).all() and (out.level[7:] == 3).all()
    assert (out.state[:7, 3] == State.SUSPECT).all()


@pytest.mark.requirement("redundancy", "never a suspect in the vote")
def test_two_channels_off_apart_are_never_in_the_vote():
    out = vote_samples(constant(0, 0, 5, 9))
    assert out.failed_at() == [None, None, 8, 8]
    assert (out.voted == 0).all()


@pytest.mark.requirement("redundancy", "2:2 by trend, by reference, by in-line monitors")
def test_constant_pairs_go_to_the_smaller_pair():
    out = vote_samples(constant(0, 0.1, 5, 5.1))
    assert out.failed_at() == [None, None, 10, 10]
    assert (out.pattern[:10] == Pattern.P2_2).all()
    assert (out.decided_by[8:10] == DecidedBy.TREND).all()  # eight changes seen
    assert (out.decided_by[:8] == DecidedBy.UNRESOLVED).all()


def test_rising_pairs_go_to_the_larger_pair():
    out = vote_samples(RISING)
    assert out.failed_at() == [10, 10, None, None]
    assert (out.trend_high[8:10] == 0b1111_1111).all()


@pytest.mark.requirement("redundancy", "2:2 by trend, by reference, by in-line monitors")
def test_a_reference_asked_first_saves_the_pair_that_the_trend_would_fail():
    out = vote_samples(RISING, reference=0.1 * K, tie_break=["reference", "trend"])
    assert out.failed_at() == [None, None, 10, 10]
    assert (out.decided_by[:10] == DecidedBy.REFERENCE).all()
    assert np.allclose(out.voted[:10], 0.1 * K[:10] + 0.1)


@pytest.mark.requirement("redundancy", "1:1:1:1: the extremes fail; 1:1:1: the middle stays")
def test_four_ways_apart_fail_the_extremes_and_leave_a_duplex():
    out = vote_samples(constant(-9, -3, 3, 9, frames=19))
    assert out.failed_at() == [10, None, None, 10]
    assert (out.pattern[10:] == Pattern.P1_1).all()
    assert (out.level[10:] == 2).all()


@pytest.mark.requirement(
    "redundancy", "a sample that is no number, out of range or flagged miscompares, and is never voted"
)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_channel_without_a_number_is_failed_and_never_voted(bad: float):
    out = vote_samples(constant(0, bad, 0.1, 0.2))
    assert out.failed_at() == [None, 8, None, None]
    assert np.isfinite(out.voted).all()
    assert (out.voted == 0.1).all()
