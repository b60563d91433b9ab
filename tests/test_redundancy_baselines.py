"""The managers to compare with."""

import numpy as np
from conftest import constant, vote_samples

from rig.frame import State


def test_the_mean_follows_a_hardover_and_fails_nobody():
    out = vote_samples(constant(0, 0, 0, 8), manager="mean")
    assert (out.voted == 2.0).all()
    assert out.failed_at() == [None] * 4


def test_the_cross_voter_isolates_a_single_fault_but_blames_all_of_a_split():
    single = vote_samples(constant(0, 0, 0, 8), manager="cross-voter")
    split = vote_samples(constant(0, 0, 8, 8), manager="cross-voter")
    assert single.failed_at() == [None, None, None, 8]
    assert split.failed_at() == [8, 8, 8, 8]


def test_the_median_shrugs_off_one_channel_for_ever_and_fails_nobody():
    out = vote_samples(constant(0, 0.2, 0.4, 8), manager="median")
    assert np.allclose(out.voted, 0.3) and out.failed_at() == [None] * 4


def test_a_baseline_holds_its_vote_when_nobody_speaks():
    samples = constant(3.0, 3.0, 3.0, 3.0, frames=20)
    samples[5:] = np.nan
    for manager in ("mean", "median", "cross-voter", "selection"):
        assert (vote_samples(samples, manager=manager).voted == 3.0).all()


def test_a_selection_leaves_its_channel_when_the_integrated_deviation_is_used_up():
    """Channel 1 is off by 8: the mean by 2, its deviation is 6, of which 5 a frame count towards 100."""
    settings = {"selection_deviation": 1.0, "selection_integral_s": 1.0}  # 1 s is 100 frames
    out = vote_samples(constant(8, 0, 0, 0, frames=40), manager="selection", **settings)
    assert (out.voted[:20] == 8).all() and (out.voted[20:] == 0).all()
    assert out.failed_at() == [21, None, None, None]


def test_a_selection_stays_where_it_is_and_trusts_again_what_came_back():
    settings = {"selection_deviation": 1.0, "selection_integral_s": 1.0}
    samples = constant(8, 0.5, 0, 0, frames=300)
    samples[60:] = [0, 0.5, 0, 0]
    out = vote_samples(samples, manager="selection", **settings)
    assert (out.voted[21:] == 0.5).all()
    assert out.state[59, 0] == State.FAILED and out.state[-1, 0] == State.OK


def test_a_selection_leaves_a_silent_channel_at_once_and_blames_neither_of_two():
    samples = constant(5.0, 1.0, 1.0, 1.0, frames=10)
    samples[4:, 0] = np.nan
    out = vote_samples(samples, manager="selection")
    assert (out.voted[4:] == 1.0).all()
    pair = constant(9.0, 0.0, np.nan, np.nan, frames=500)
    assert (vote_samples(pair, manager="selection").voted == 9.0).all()
