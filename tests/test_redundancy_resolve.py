"""Examples by hand of the monitor's later rules: the freeze, who is asked first, the vote that is held.

Frames are counted from 1 as in the requirement. Defaults: threshold 1, persistence 8, split persistence 10.
"""

from typing import Any

import numpy as np
import pytest
from conftest import Voted, constant, rows, vote_samples
from numpy.typing import NDArray

from rig.core.frame import DecidedBy, Ilm, Pattern, State

NAN = np.nan
GOOD, BAD, ABSENT = Ilm.GOOD, Ilm.BAD, Ilm.ABSENT
SPLIT, NOISY = (0, 0.5, 5, 5.1), (0, 1.2, 5, 5.1)  # 2:2, and the 1:1:2 that noise makes of it
APART = (-9, -3, 3, 9)


# The freeze after a run of splits.


@pytest.mark.requirement("redundancy", "counts stand still after a run of splits, as long as it was")
@pytest.mark.parametrize(("run", "still"), [(3, 3), (9, 9), (30, 10)])
def test_after_a_run_of_splits_the_counts_stand_still_for_as_long_up_to_the_split_persistence(run: int, still: int):
    out = vote_samples(rows((run, SPLIT), (30, NOISY)), tie_break=[])
    assert out.failed_at() == [run + still + 8] * 2 + [None] * 2
    assert (out.state[run:, :2] != State.OK).all()


@pytest.mark.requirement("redundancy", "counts stand still after a run of splits, as long as it was")
def test_noise_that_splits_a_pair_of_a_two_to_two_again_and_again_fails_no_channel():
    out = vote_samples(rows(*[(3, SPLIT), (3, NOISY)] * 10))
    assert out.failed_at() == [None] * 4


def test_a_freeze_is_the_larger_of_what_is_left_of_it_and_the_new_run():
    """Eight frames, of which two pass, then a run of one: six are left, neither one nor seven."""
    out = vote_samples(rows((8, SPLIT), (2, NOISY), (1, SPLIT), (30, NOISY)))
    assert out.failed_at()[:2] == [8 + 2 + 1 + 6 + 8] * 2


def test_a_run_of_any_mix_of_splits_counts_as_one():
    out = vote_samples(rows((3, APART), (4, SPLIT), (30, NOISY)), tie_break=[])
    assert out.failed_at()[:2] == [7 + 7 + 8] * 2


def test_in_a_freeze_an_agreeing_frame_does_not_reset_a_count():
    one_off, all_agree = (0, 0, 0.1, 9), (0, 0, 0.1, 0.2)
    out = vote_samples(rows((5, one_off), (2, (0, 0.1, 9, 9.1)), (2, all_agree), (20, one_off)))
    assert out.failed_at() == [None, None, None, 5 + 2 + 2 + 3]
    assert (out.state[7:9, 3] == State.SUSPECT).all()


def test_in_a_freeze_a_sample_that_is_not_comparable_counts():
    out = vote_samples(rows((6, SPLIT), (20, (0, 0.5, 0.2, NAN))))
    assert out.failed_at() == [None, None, None, 14]


def test_the_count_of_a_last_channel_is_exempt_from_the_freeze():
    out = vote_samples(rows((6, SPLIT), (20, (NAN, NAN, NAN, 5.1))), ilm=flags(ABSENT, ABSENT, ABSENT, BAD, frames=26))
    assert out.failed_at() == [14] * 4


# Who is asked, and in which order.

RISE = 0.1 * np.arange(30)
RISING = np.stack([RISE, RISE + 0.1, RISE + 5, RISE + 5.1], axis=1)  # the trend says: the larger pair
LOW_GOOD, HIGH_GOOD = (GOOD, GOOD, BAD, BAD), (BAD, BAD, GOOD, GOOD)


def flags(*four: Ilm, frames: int = 30) -> NDArray[np.int64]:
    return np.tile(np.array(four, int), (frames, 1))


def failed_and_by(out: Voted) -> tuple[list[int], DecidedBy]:
    """The channels failed at the tenth frame, and who decided it."""
    return [c for c, k in enumerate(out.failed_at(), 1) if k == 10], DecidedBy(int(out.decided_by[9]))


def test_by_default_the_reference_is_asked_before_the_trend():
    assert failed_and_by(vote_samples(RISING, reference=RISE)) == ([3, 4], DecidedBy.REFERENCE)
    assert failed_and_by(vote_samples(RISING)) == ([1, 2], DecidedBy.TREND)


def test_by_default_the_monitors_are_asked_before_the_reference():
    out = vote_samples(RISING, reference=RISE, ilm=flags(*HIGH_GOOD))
    assert failed_and_by(out) == ([1, 2], DecidedBy.ILM)


def test_the_trend_byte_is_eight_frames_long_and_unusable_before():
    out = vote_samples(RISING)
    assert (out.decided_by[:8] == DecidedBy.UNRESOLVED).all() and (out.decided_by[8:10] == DecidedBy.TREND).all()
    assert (out.trend_high[8:10] == 0xFF).all() and out.trend_low[7] == 0x7F


@pytest.mark.parametrize(("four", "vote"), [(LOW_GOOD, 0.25), (HIGH_GOOD, 5.05)])
def test_the_vote_is_the_mean_of_the_pair_that_is_kept(four: tuple[Ilm, ...], vote: float):
    assert vote_samples(constant(*SPLIT), ilm=flags(*four)).voted == pytest.approx(np.full(30, vote))


@pytest.mark.parametrize(("samples", "four"), [(APART, (GOOD, BAD, BAD, BAD)), (SPLIT, HIGH_GOOD)])
def test_monitors_that_are_not_configured_are_not_asked(samples: tuple[float, ...], four: tuple[Ilm, ...]):
    out = vote_samples(constant(*samples), ilm=flags(*four), tie_break=["reference"])
    assert (out.decided_by == DecidedBy.UNRESOLVED).all() and out.failed_at() == [None] * 4


@pytest.mark.parametrize(("samples", "tie_break"), [(APART, ["middle", "trend"]), (SPLIT, ["extremes", "middle"])])
def test_nor_is_a_reference(samples: tuple[float, ...], tie_break: list[str]):
    out = vote_samples(constant(*samples, frames=8), reference=np.full(8, samples[0]), tie_break=tie_break)
    assert (out.decided_by == DecidedBy.UNRESOLVED).all()


# 1:1:1:1 and 1:1:1.


@pytest.mark.requirement("redundancy", "1:1:1:1 and 1:1:1 by in-line monitors and reference first")
@pytest.mark.parametrize("good", [1, 2, 3, 4])
def test_the_one_channel_whose_monitor_says_good_is_kept_of_four_apart(good: int):
    one = [GOOD if c == good else BAD for c in range(1, 5)]
    out = vote_samples(constant(*APART), ilm=flags(*one))
    assert failed_and_by(out) == ([c for c in range(1, 5) if c != good], DecidedBy.ILM)
    assert (out.voted == APART[good - 1]).all()
    assert (out.pattern[:10] == Pattern.P1_1_1_1).all() and (out.pattern[10:] == Pattern.NORMAL).all()
    assert (out.level[10:] == 1).all()


@pytest.mark.parametrize(
    "four", [(GOOD, BAD, BAD, ABSENT), (ABSENT, BAD, BAD, BAD), (GOOD, GOOD, BAD, BAD), (BAD,) * 4, (GOOD,) * 4]
)
def test_monitors_that_do_not_single_out_one_channel_give_no_answer(four: tuple[Ilm, ...]):
    out = vote_samples(constant(*APART, frames=12), ilm=flags(*four, frames=12))
    assert failed_and_by(out) == ([1, 4], DecidedBy.EXTREMES)
    assert (out.voted[:10] == 0).all()


@pytest.mark.requirement("redundancy", "1:1:1:1 and 1:1:1 by in-line monitors and reference first")
@pytest.mark.parametrize(("reference", "good"), [(9.9, 4), (-9.5, 1), (2.5, 3), (10.0, 4)])
def test_the_only_sample_within_the_reference_threshold_is_kept_of_four_apart(reference: float, good: int):
    out = vote_samples(constant(*APART), reference=np.full(30, reference))
    assert failed_and_by(out) == ([c for c in range(1, 5) if c != good], DecidedBy.REFERENCE)
    assert (out.voted[:10] == APART[good - 1]).all()


@pytest.mark.parametrize(("reference", "threshold"), [(0.0, 1.0), (10.0005, 1.0), (0.0, 3.0), (6.0, 3.0)])
def test_a_reference_near_none_or_two_of_them_gives_no_answer(reference: float, threshold: float):
    samples, references = constant(*APART, frames=12), np.full(12, reference)
    out = vote_samples(samples, reference=references, reference_threshold=threshold)
    assert failed_and_by(out) == ([1, 4], DecidedBy.EXTREMES)


@pytest.mark.parametrize(("first", "failed"), [("ilm", [2, 3, 4]), ("reference", [1, 2, 3])])
def test_four_apart_are_settled_in_the_configured_order_extremes_last(first: str, failed: list[int]):
    order = ["extremes", first, *({"ilm", "reference"} - {first})]
    given: dict[str, Any] = {"ilm": flags(GOOD, BAD, BAD, BAD), "reference": np.full(30, 9.0)}
    out = vote_samples(constant(*APART), tie_break=order, **given)
    assert failed_and_by(out) == (failed, DecidedBy[first.upper()])


@pytest.mark.parametrize(
    ("given", "failed", "by"),
    [
        ({"ilm": flags(GOOD, BAD, BAD, GOOD)}, [2, 3], DecidedBy.ILM),
        ({"reference": np.full(30, 8.5)}, [1, 2], DecidedBy.REFERENCE),
        ({}, [1, 3], DecidedBy.MIDDLE),
        ({"reference": np.full(30, 8.5), "tie_break": ["middle", "trend", "ilm"]}, [1, 3], DecidedBy.MIDDLE),
    ],
)
def test_three_apart_are_settled_by_monitors_and_reference_before_the_middle(
    given: dict[str, Any], failed: list[int], by: DecidedBy
):
    out = vote_samples(constant(-9, 3, 9, NAN), channels=3, **given)
    assert failed_and_by(out) == (failed, by)
    (kept,) = {1, 2, 3} - set(failed)
    assert (out.voted[:10] == (-9, 3, 9)[kept - 1]).all()


@pytest.mark.requirement("redundancy", "extremes and middle may be left out")
@pytest.mark.parametrize("samples", [APART, (-9, 3, 9, NAN)])
def test_without_extremes_and_middle_no_channel_is_failed(samples: tuple[float, ...]):
    channels = int(np.isfinite(samples).sum())
    together = tuple(np.where(np.isfinite(samples), 0.5, NAN))
    frames = rows((2, together), (28, samples))
    for left in (["ilm", "reference", "trend"], ["trend", "middle" if channels == 4 else "extremes"]):
        out = vote_samples(frames, channels=channels, tie_break=left)
        assert (out.state[:, :channels] != State.FAILED).all()
        assert (out.decided_by[2:] == DecidedBy.UNRESOLVED).all()
        assert (out.voted == 0.5).all()


def test_an_answer_after_the_count_is_reached_decides_when_it_has_stood_for_half_of_it():
    references = rows((14, NAN), (16, 9.0))
    out = vote_samples(constant(*APART), reference=references, tie_break=["reference"])
    assert out.failed_at() == [19, 19, 19, None]


# The vote of an unresolved pattern.


@pytest.mark.requirement("redundancy", "an unresolved vote does not take half of the jump")
def test_the_unresolved_vote_does_not_take_half_of_the_faults_jump_with_it():
    out = vote_samples(rows((5, (0, 0, 0, 0)), (25, (0, 0, 5, 5))), tie_break=[])
    assert (out.decided_by[5:] == DecidedBy.UNRESOLVED).all()
    assert (out.voted == 0).all()


@pytest.mark.requirement("redundancy", "an unresolved vote stays between two channels")
def test_the_unresolved_vote_goes_on_with_the_channels_that_it_was_of():
    """The jumped pair may run away: it has no share."""
    low, high = 0.2 * np.arange(20), 5 + 0.4 * np.arange(20)
    split = np.stack([low, low, high, high], axis=1)
    out = vote_samples(np.concatenate([constant(0, 0, 0, 0, frames=5), split]), tie_break=[])
    assert np.allclose(out.voted[5:], low)


@pytest.mark.requirement("redundancy", "an unresolved vote stays between two channels")
@pytest.mark.parametrize(
    ("before", "at", "then", "held"),
    [
        ((0, 0.8), (0, 5), (0, 10), [0.4, 0.8]),  # 0.08 of the gap
        ((0, 0.8), (0, 5), (1, 11), [0.4, 1.8]),
        ((0, 0.8), (2, 5), (3, 9), [2.0, 3.0]),  # never outside of the two
        ((0, 0.8), (-5, -2), (-9, -3), [-2.0, -3.0]),
        ((0, 0, 0.8, 0.8), (0, 0, 5, 5.5), (0, 1, 9, 9), [0.4, 0.08 * 8 + 1]),  # of the second and the third
        ((1, 1, 1, 1), (0, 0.5, 5, 5.5), (2, 3, 12, 12), [1.0, 4.0]),  # 1/9
        ((3, 3, 3, 3), (0, 2, 4, 6), (0, 2, 8, 12), [3.0, 5.0]),
        ((5, 5, 5, 5), (0, 2, 4, 6), (0, 2, 5, 9), [5.0, 7.0]),  # of the third and the fourth
        ((1, 1, 1, 1), (0, 2, 4, 6), (3, 5, 7, 9), [1.0, 4.0]),  # of the first and the second
        ((3, 3, 3, NAN), (0, 2, 4, NAN), (0, 3, 9, NAN), [3.0, 6.0]),
    ],
)
def test_the_unresolved_vote_keeps_its_share_of_two_neighbours(
    before: tuple[float, ...], at: tuple[float, ...], then: tuple[float, ...], held: list[float]
):
    """No vote jumps: twenty frames lead from one to the other."""
    n = int(np.isfinite(at).sum())
    samples = np.full((24, 4), NAN)
    samples[:3, :n], samples[3:, :n] = before[:n], np.linspace(at[:n], then[:n], 21)
    out = vote_samples(samples, channels=n, tie_break=[])
    assert (out.decided_by[3:] == DecidedBy.UNRESOLVED).all() and (out.pattern[4:] == out.pattern[3]).all()
    assert out.voted[[3, -1]] == pytest.approx(held)


def test_the_shares_go_on_after_an_answer_that_did_not_last():
    ilm = rows((5, (ABSENT,) * 4), (1, (BAD, GOOD, ABSENT, ABSENT)), (24, (ABSENT,) * 4)).astype(int)
    samples = np.where(np.arange(4) < 2, constant(0, 5, 0, 0), NAN)
    samples[0, :2] = 0.0, 0.8
    out = vote_samples(samples, ilm=ilm, channels=2, tie_break=["ilm"], split_persistence=30)
    assert out.voted[1:5] == pytest.approx(np.full(4, 0.4)) and out.voted[5] == 5.0
    assert out.voted[6:] == pytest.approx(np.full(24, 0.4))


def test_of_equal_neighbours_each_has_half():
    out = vote_samples(rows((3, (0, 0, 0, 0)), (1, (0, 0, 5, 5)), (3, (0, 0.5, 5, 5))), tie_break=[])
    assert out.voted.tolist() == [0.0] * 4 + [0.25] * 3


def test_the_vote_before_the_fade_is_what_is_held():
    """The fourth goes at frame 8; the vote is 0.8 then, faded from 0.7, and a split follows around it."""
    samples = rows((8, (0, 0.6, 0.8, 5)), (1, (0, 0.8, 0.9, 5)), (4, (-5, 0.5, 5, 9)))
    out = vote_samples(samples, tie_break=[], fade_s=0.1)
    assert out.voted[:8] == pytest.approx(np.full(8, 0.7)) and out.level[8] == 3
    assert out.voted[8:] == pytest.approx(0.8 - 0.1 * np.array([10, 9, 8, 7, 6]) / 11)


def test_an_unresolved_vote_between_two_whose_gap_overflows_is_a_number_between_them():
    limit = 1.79e308
    samples = rows((2, (0, 0, NAN, NAN)), (3, (-1.7e308, 1.7e308, NAN, NAN)))
    with np.errstate(over="ignore", invalid="ignore"):
        out = vote_samples(samples, tie_break=[], channels=2, limits=(-limit, limit))
    assert np.isfinite(out.voted).all() and (np.abs(out.voted) <= 1.7e308).all()


# Trend-weighted means of the good pair and of two.

WEIGHTED: dict[str, Any] = {"mean": "trend-weighted"}


BY = {"ilm": {"ilm": flags(*LOW_GOOD)}, "lane": {"lanes": [(0, 0, 1, 1)] * 30}}


@pytest.mark.requirement("redundancy", "trend-weighted means of a good pair and of two")
@pytest.mark.parametrize("rule", BY)
def test_of_the_good_pair_the_one_that_moved_as_the_vote_weighs_more(rule: str):
    """Frame 2: changes of 0.1 and 0.3 beside a vote that stood still, so that the upper weighs 1/4: 0.1 + 0.7/4, which
    is 0.025 more.  Frame 3: changes of 0.1 and 0.2, off that by 0.075 and 0.175, so that it weighs 0.3."""
    samples = constant(0, 0.5, 5, 5.1)
    samples[1, :2], samples[2, :2] = (0.1, 0.8), (0.2, 1.0)
    out = vote_samples(samples, tie_break=[rule], **WEIGHTED, **BY[rule])
    assert out.voted[:3] == pytest.approx([0.25, 0.275, 0.2 + 0.3 * 0.8])
    plain = vote_samples(samples, tie_break=[rule], **BY[rule])
    assert plain.voted[:3] == pytest.approx([0.25, 0.45, 0.6])


def test_where_the_pair_moves_apart_both_weigh_the_same():
    samples = constant(0, 0.5, 5, 5.1)
    samples[1:, 0] -= 0.25
    out = vote_samples(samples, tie_break=["ilm"], ilm=flags(*LOW_GOOD), **WEIGHTED)
    assert out.voted[1] == pytest.approx(0.125)


def test_a_sample_without_one_before_it_weighs_half():
    samples = constant(0, 0.5, 5, 5.1)
    samples[1, 1], samples[2, :2] = NAN, (0.25, 0.625)
    out = vote_samples(samples, tie_break=["ilm"], ilm=flags(*LOW_GOOD), **WEIGHTED)
    assert out.voted[2] == pytest.approx((0.25 + 0.625) / 2)


def test_a_channel_readmitted_as_the_split_begins_weighs_by_its_own_change():
    """Its last sample counts, though it was failed then: changes of 0.1 and 0.3 as above, and the upper weighs 1/4."""
    samples = constant(0, 0.5, 0.25, 0.25, frames=161)
    samples[:20, 1] = 50.0
    samples[160] = 0.1, 0.8, 5, 5.1
    out = vote_samples(samples, tie_break=["ilm"], ilm=flags(*LOW_GOOD, frames=161), resets=[(160, 2)], **WEIGHTED)
    assert out.level[159] == 3 and out.pattern[160] == Pattern.P2_2
    assert out.voted[160] == pytest.approx(0.1 + 0.7 / 4)


@pytest.mark.requirement("redundancy", "trend-weighted means of a good pair and of two")
def test_of_two_that_the_trend_settles_the_vote_is_near_the_one_whose_change_fits():
    """Two changes of 0.2 and 0.6 make a trend of one frame each; no rule settles the first, whose vote is 2."""
    samples = np.full((3, 4), NAN)
    samples[:, 0], samples[:, 1] = 0.25 * np.arange(3), 4 + 0.5 * np.arange(3)
    more: dict[str, Any] = {"channels": 2, "tie_break": ["trend"], "trend_frames": 1}
    out = vote_samples(samples, **more, **WEIGHTED)
    # Of a vote that stood still the upper is off by 0.5, the lower by 0.25: 1/3 of it.
    first = 0.25 + (4.5 - 0.25) / 3
    rise = first - 2.0
    share = abs(0.25 - rise) / (abs(0.25 - rise) + abs(0.5 - rise))
    assert out.voted == pytest.approx([2.0, first, 0.5 + share * 4.5])
    assert vote_samples(samples, **more).voted == pytest.approx([2.0, 4.5, 5.0])


def test_the_ranks_whose_changes_weigh_are_those_of_the_samples_behind_a_filter_too():
    """What is compared lags, so that the second of two stays the larger of what is compared when it falls below."""
    samples = np.full((12, 4), NAN)
    samples[:, 0], samples[:, 1] = 0.0 - 0.125 * np.arange(12), 3.0 - 0.125 * np.arange(12)
    samples[11, :2] = -1.5, -2.25
    more: dict[str, Any] = {"channels": 2, "tie_break": ["trend"], "trend_frames": 1, "split_persistence": 30}
    out = vote_samples(samples, filter_s=0.01, **more, **WEIGHTED)
    assert (out.decided_by[3:] == DecidedBy.TREND).all()
    high, low = samples[11, 0] - samples[10, 1], samples[11, 1] - samples[10, 0]
    rise = out.voted[10] - out.voted[9]
    share = abs(low - rise) / (abs(low - rise) + abs(high - rise))
    assert out.voted[11] == pytest.approx(-2.25 + share * 0.75)
