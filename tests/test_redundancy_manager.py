import numpy as np
import pytest
from conftest import constant, vote_samples

from rig.core.frame import DecidedBy, Ilm, Pattern, State

GOOD, BAD = int(Ilm.GOOD), int(Ilm.BAD)


@pytest.mark.requirement("redundancy", "one agreeing frame resets the count")
def test_one_agreeing_frame_resets_the_count():
    samples = constant(0, 0, 0, 5, frames=15)
    samples[7] = 0
    assert vote_samples(samples).failed_at() == [None] * 4


@pytest.mark.requirement(
    "redundancy", "a channel that disagrees with all others for `persistence` frames is isolated, latched"
)
def test_a_failed_channel_stays_out_when_it_comes_back():
    samples = constant(0, 0, 0, 5)
    samples[10:] = 0
    out = vote_samples(samples)
    assert (out.state[7:, 3] == State.FAILED).all()
    assert (out.level[7:] == 3).all()


@pytest.mark.requirement("redundancy", "one agreeing partner is enough: chains are normal")
def test_a_chain_of_neighbours_is_normal():
    out = vote_samples(constant(0, 0.9, 1.8, 2.7))
    assert (out.pattern == Pattern.NORMAL).all()
    assert np.allclose(out.voted, 1.35)


@pytest.mark.requirement("redundancy", "never a suspect in the vote")
@pytest.mark.parametrize(
    ("samples", "vote"),
    [((0, 0.5, 5, 9), 0.5), ((9, 8.5, 5, 0), 8.5), ((0, 4.5, 5, 9), 4.75), ((0, 0.2, 0.6, 5), 0.4)],
    ids=["1:1:2 from above", "2:1:1", "1:2:1", "3:1"],
)
def test_a_suspect_is_never_in_the_vote(samples, vote):
    assert vote_samples(constant(*samples, frames=1)).voted[0] == pytest.approx(vote)


@pytest.mark.requirement("redundancy", "levels 4-3-2-1-lost")
def test_levels_vote_middle_then_mean_then_the_last_one():
    samples = constant(0.0, 0.2, 0.6, 0.9, frames=40)
    samples[0:, 3] = np.nan
    samples[10:, 2] = np.nan
    samples[20:, 1] = np.nan
    out = vote_samples(samples)
    assert out.voted[9] == 0.2
    assert out.voted[19] == pytest.approx(0.1)
    assert out.voted[30] == 0.0
    assert list(out.level[[9, 19, 30]]) == [3, 2, 1]


@pytest.mark.requirement("redundancy", "levels 4-3-2-1-lost")
def test_when_no_channel_is_left_the_last_vote_is_held_and_lost_is_raised():
    samples = constant(3.0, 3.0, 3.0, 3.0, frames=20)
    samples[5:] = np.nan
    out = vote_samples(samples)
    assert (out.voted == 3.0).all()
    assert out.level[12] == 0 and (out.pattern[12:] == Pattern.LOST).all()


@pytest.mark.requirement(
    "redundancy", "a sample that is no number, out of range or flagged miscompares, and is never voted"
)
def test_a_sample_outside_the_range_or_flagged_counts_as_a_miscompare():
    outside = vote_samples(constant(0, 0, 0, 5), limits=(-1, 1), threshold=10.0)
    flags = np.ones((30, 4), int)
    flags[:, 1] = 0
    flagged = vote_samples(constant(0, 0, 0, 0), valid=flags)
    assert outside.failed_at() == [None, None, None, 8]
    assert flagged.failed_at() == [None, 8, None, None]


@pytest.mark.requirement("redundancy", "2:2 by trend, by reference, by in-line monitors")
def test_three_good_monitors_that_follow_the_pairing_settle_a_split():
    ilm = np.tile([BAD, BAD, GOOD, GOOD], (30, 1))
    out = vote_samples(constant(0, 0.1, 5, 5.1), ilm=ilm)
    assert out.failed_at() == [10, 10, None, None]
    assert np.allclose(out.voted[:10], 5.05)


@pytest.mark.requirement("redundancy", "monitors that contradict the pairing are ignored")
@pytest.mark.parametrize("flags", [[GOOD, BAD, BAD, GOOD], [GOOD] * 4, [BAD] * 4, [GOOD, GOOD, GOOD, BAD]])
def test_monitors_that_contradict_the_pairing_do_not_decide(flags):
    out = vote_samples(constant(0, 0.1, 5, 5.1), ilm=np.tile(flags, (30, 1)))
    assert (out.decided_by[8:10] == DecidedBy.TREND).all()


@pytest.mark.requirement("redundancy", "unresolved: hold, isolate no channel")
def test_a_split_that_no_rule_settles_holds_and_fails_no_channel():
    samples = constant(0, 0.1, 5, 5.1)
    samples[::2] += 0.01  # neither rising nor still: the trend bytes are mixed
    out = vote_samples(samples, tie_break=["trend"], trend_frames=3)
    assert out.failed_at() == [None] * 4
    assert (out.decided_by[3:] == DecidedBy.UNRESOLVED).all()
    assert np.abs(np.diff(out.voted[3:])).max() == pytest.approx(0.01)


@pytest.mark.requirement("redundancy", "1:1:1:1: the extremes fail; 1:1:1: the middle stays")
def test_a_middle_of_three_is_good_and_the_others_fail():
    samples = np.column_stack([constant(-5, 0, 5), np.full((30, 1), np.nan)])[:, :4]
    out = vote_samples(samples, channels=3)
    assert out.failed_at() == [10, None, 10, None]
    assert (out.voted == 0).all()
    assert (out.state[:, 3] == State.ABSENT).all()


@pytest.mark.requirement("redundancy", "a change of pattern starts the count again")
def test_a_change_of_pattern_starts_the_count_again():
    samples = constant(0, 0.1, 5, 5.1)
    samples[8] = [0, 0, 0, 0]
    out = vote_samples(samples)
    assert out.failed_at() == [None, None, 19, 19]


@pytest.mark.requirement("redundancy", "angles on the circle")
def test_an_angle_is_compared_and_voted_the_short_way_round():
    turn = 2 * np.pi
    samples = constant(0.01, turn - 0.01, 0.02, turn - 0.02)
    out = vote_samples(samples, wraps=True, limits=(0.0, turn), threshold=0.1)
    assert out.failed_at() == [None] * 4
    assert np.abs(np.sin(out.voted)).max() < 0.011
    assert (np.cos(out.voted) > 0.99).all()


def test_an_angle_at_the_seam_is_voted_right_from_the_first_frame():
    samples = constant(np.nan, np.pi - 0.01, -np.pi + 0.02, -np.pi + 0.01, frames=1)
    out = vote_samples(samples, wraps=True, limits=(-np.pi, np.pi), threshold=0.1)
    assert abs(abs(out.voted[0]) - np.pi) < 0.021


def test_a_first_frame_without_any_number_votes_zero():
    out = vote_samples(constant(np.nan, np.nan, np.nan, np.nan, frames=2), wraps=True, limits=(-np.pi, np.pi))
    assert (out.voted == 0).all() and (out.pattern == Pattern.LOST).all()


@pytest.mark.requirement("redundancy", "a reference is monitored, never failed as a channel")
def test_a_reference_that_leaves_a_healthy_vote_is_unusable_until_it_has_agreed_as_long():
    reference = np.zeros(60)
    reference[10:30] = 50.0
    out = vote_samples(constant(0, 0, 0, 0, frames=60), reference=reference)
    usable = out.reference_usable.astype(bool)
    assert usable[:17].all() and not usable[17:37].any() and usable[37:].all()


def test_the_fade_spreads_a_change_of_level():
    samples = constant(0, 0.8, 0.9, 5.0, frames=60)
    out = vote_samples(samples, fade_s=0.1)
    jump = vote_samples(samples)
    step = jump.voted[8] - out.voted[7]
    assert np.allclose(out.voted[8:20], jump.voted[8:20] - step * np.r_[np.arange(10, 0, -1) / 11, 0, 0])
    assert np.abs(np.diff(jump.voted)).max() > 4 * np.abs(np.diff(out.voted)).max()
    assert out.voted[-1] == jump.voted[-1]


@pytest.mark.requirement("redundancy", "readmission by command only")
@pytest.mark.parametrize("manager", ["cross-channel", "cross-voter"])
def test_a_reset_readmits_only_a_channel_that_has_agreed_long_enough(manager):
    samples = constant(0, 0, 0, 5, frames=80)
    samples[20:] = 0
    early = vote_samples(samples, manager=manager, readmit_frames=30, resets=[(40, 4)])
    late = vote_samples(samples, manager=manager, readmit_frames=30, resets=[(60, 4)])
    other = vote_samples(samples, manager=manager, readmit_frames=30, resets=[(60, 3)])
    assert (early.level[8:] == 3).all() and (other.level[8:] == 3).all()
    assert (late.level[8:60] == 3).all() and (late.level[60:] == 4).all()


def test_a_readmitted_channel_must_miscompare_anew_to_fail_again():
    samples = constant(0, 0, 0, 5, frames=80)
    samples[20:65] = 0
    out = vote_samples(samples, readmit_frames=30, resets=[(60, 4)])
    assert out.level[[7, 59, 60, 71, 72]].tolist() == [3, 3, 4, 4, 3]


@pytest.mark.parametrize(("frames", "level"), [(29, 4), (30, 4), (31, 3)])
def test_a_reset_asks_for_exactly_its_frames_of_agreement(frames, level):
    """The channel agrees from frame 20 on; a reset in frame 50 sees the 30 frames before it."""
    samples = constant(0, 0, 0, 5, frames=80)
    samples[20:] = 0
    out = vote_samples(samples, readmit_frames=frames, resets=[(50, 4)])
    assert out.level[50] == level


def test_the_threshold_itself_is_agreement_for_a_failed_channel_too():
    samples = constant(0, 0, 0, 5, frames=80)
    samples[20:, 3] = 1.0
    assert vote_samples(samples, readmit_frames=30, resets=[(60, 4)]).level[60] == 4


def test_a_silent_channel_does_not_count_as_agreeing():
    samples = constant(0, 0, 0, 5, frames=80)
    samples[20:] = 0
    valid = np.ones((80, 4), int)
    valid[20:, 3] = 0
    assert vote_samples(samples, valid=valid, readmit_frames=30, resets=[(60, 4)]).level[60] == 3


def test_from_four_ways_to_two_the_count_starts_anew():
    samples = constant(-9, -3, 3, 9, frames=20)
    samples[6:] = [0, 0.1, 5, 5.1]
    assert vote_samples(samples).failed_at() == [None, None, 16, 16]


@pytest.mark.parametrize("frames", [7, 8])
def test_a_fade_lasts_its_frames(frames):
    out = vote_samples(constant(0, 0.8, 0.9, 5.0, frames=40), fade_s=frames / 100)
    assert (np.diff(out.voted[8 : 8 + frames + 1]) != 0).all() and np.diff(out.voted[8 + frames :]).max() == 0


def test_a_reference_earns_its_trust_anew_after_every_loss():
    reference = np.zeros(80)
    reference[10:20] = reference[40:47] = 50.0
    usable = vote_samples(constant(0, 0, 0, 0, frames=80), reference=reference).reference_usable.astype(bool)
    assert not usable[17:27].any() and usable[27:].all()


def test_a_reference_that_agrees_as_soon_as_it_is_unusable_is_usable_after_as_many_frames():
    reference = np.zeros(40)
    reference[10:18] = 50.0
    usable = vote_samples(constant(0, 0, 0, 0, frames=40), reference=reference).reference_usable.astype(bool)
    assert np.flatnonzero(~usable).tolist() == list(range(17, 25))


@pytest.mark.parametrize("channels", [2, 3, 4])
def test_a_channel_that_is_not_fitted_is_absent(channels):
    out = vote_samples(constant(0, 0, 0, 0), channels=channels)
    assert (out.state == np.where(np.arange(4) < channels, State.OK, State.ABSENT)).all()


def test_a_reference_of_an_angle_is_taken_on_the_side_where_it_is():
    turn = 2 * np.pi
    samples = constant(turn - 0.05, turn - 0.04, 0.3, 0.31)
    angle = {"wraps": True, "limits": (0.0, turn), "threshold": 0.1, "tie_break": ["reference"]}
    assert vote_samples(samples, reference=0.31, **angle).failed_at() == [10, 10, None, None]
    assert vote_samples(samples, reference=turn - 0.05, **angle).failed_at() == [None, None, 10, 10]
