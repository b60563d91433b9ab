"""Answers that must stand, splits that are given up, counts that go down: by hand.

Frames are counted from 1 as in the requirement. Defaults: threshold 1, persistence 8, split persistence 10.
"""

from typing import Any

import numpy as np
import pytest
from conftest import constant, rows, vote_samples
from numpy.typing import NDArray
from pydantic import ValidationError

from rig.computer.redundancy.manager_config import SignalConfig
from rig.core.frame import DecidedBy, Ilm, Pattern, State

NAN = np.nan
GOOD, BAD, ABSENT = int(Ilm.GOOD), int(Ilm.BAD), int(Ilm.ABSENT)
APART, SPLIT = (0, 5, 10, 15), (0, 0.1, 5, 5.1)
RISING = 0.1 * np.arange(30.0)[:, None] + SPLIT  # the trend says: the larger pair
FRAMES = np.arange(1, 31)


def missing_in(row: int, reference: Any = 0.0) -> NDArray[np.float64]:
    """A reference that one row, from 1, is without."""
    return np.where(row == FRAMES, NAN, reference)


def settled_at(row: int) -> int:
    """In the tenth frame; after a frame of another answer it has stood for five of ten again in the fifth."""
    return 10 if row > 10 else row + 5


@pytest.mark.requirement("redundancy", "a split is settled by an answer that has stood")
@pytest.mark.parametrize("row", [9, 10, 11])
def test_one_row_without_its_reference_lets_no_other_rule_settle_four_apart(row: int):
    out = vote_samples(constant(*APART), reference=missing_in(row))
    if row < 11:
        assert out.decided_by[row - 1] == DecidedBy.EXTREMES
    at = settled_at(row)
    assert out.failed_at() == [None, at, at, at]
    assert out.decided_by[at - 1] == DecidedBy.REFERENCE


@pytest.mark.requirement("redundancy", "a split is settled by an answer that has stood")
@pytest.mark.parametrize("row", [9, 10, 11])
def test_nor_do_monitors_that_speak_in_one_row_settle_two_against_two(row: int):
    ilm = np.where(FRAMES[:, None] == row, [BAD, BAD, GOOD, GOOD], ABSENT)
    out = vote_samples(constant(*SPLIT), reference=0.0, ilm=ilm)
    if row < 11:
        assert out.decided_by[row - 1] == DecidedBy.ILM
    at = settled_at(row)
    assert out.failed_at() == [None, None, at, at]
    assert out.decided_by[at - 1] == DecidedBy.REFERENCE


@pytest.mark.requirement("redundancy", "a split is settled by an answer that has stood")
@pytest.mark.parametrize("row", [9, 10, 11])
def test_nor_does_the_trend_in_the_one_row_in_which_it_is_asked(row: int):
    out = vote_samples(RISING, reference=missing_in(row, RISING[:, 0]), tie_break=["reference", "trend"])
    if row < 11:
        assert out.decided_by[row - 1] == DecidedBy.TREND
    at = settled_at(row)
    assert out.failed_at() == [None, None, at, at]


def test_a_trend_beside_another_answer_must_stand_as_any_other():
    """The reference goes for good in the tenth row, after nine answers of its own."""
    reference = np.where(FRAMES < 10, RISING[:, 0], NAN)
    out = vote_samples(RISING, reference=reference, tie_break=["reference", "trend"])
    assert (out.decided_by[9:14] == DecidedBy.TREND).all()
    assert out.failed_at() == [14, 14, None, None]


def test_a_trend_speaks_for_the_unanswered_frames_that_it_covers():
    """Three agree for five frames, so the byte of four is of the split alone: whole at its ninth frame, the 14th."""
    samples = np.concatenate([constant(0, 0.1, 0.2, NAN, frames=5), constant(*SPLIT)])
    out = vote_samples(samples)
    assert (out.decided_by[5:13] == DecidedBy.UNRESOLVED).all() and (out.decided_by[13:15] == DecidedBy.TREND).all()
    assert out.failed_at() == [None, None, 15, 15]


def test_and_for_none_before_a_row_that_another_rule_has_answered():
    """The reference speaks in row 7, so that the byte covers the eighth: five of ten are the eighth to the 12th."""
    out = vote_samples(RISING, reference=np.where(FRAMES == 7, RISING[:, 0], NAN), tie_break=["reference", "trend"])
    assert out.decided_by[6] == DecidedBy.REFERENCE and (out.decided_by[8:12] == DecidedBy.TREND).all()
    assert out.failed_at() == [12, 12, None, None]


@pytest.mark.parametrize(("frames", "asked", "at"), [(1, 11, 15), (4, 14, 15), (8, 18, 18)])
def test_a_short_byte_covers_few_frames(frames: int, asked: int, at: int):
    """The upper pair moves up in the ninth row and back in the tenth; from then on both ranks are still."""
    samples = constant(*SPLIT)
    samples[8, 2:] += 0.05
    out = vote_samples(samples, trend_frames=frames)
    assert (out.decided_by[8 : asked - 1] == DecidedBy.UNRESOLVED).all() and out.decided_by[
        asked - 1
    ] == DecidedBy.TREND
    assert out.failed_at() == [None, None, at, at]


def test_an_answer_that_blames_others_begins_again():
    """The reference is near the first for eight frames, then near the second."""
    reference = np.where(FRAMES <= 8, 0.0, 5.0)
    out = vote_samples(constant(*APART), reference=reference, tie_break=["reference"])
    assert out.failed_at() == [13, None, 13, 13]


@pytest.mark.parametrize(("wait", "at"), [(1, 1), (2, 2), (7, 7)])
def test_an_answer_from_the_first_frame_on_settles_when_the_pattern_has_lasted(wait: int, at: int):
    out = vote_samples(constant(*APART), reference=0.0, split_persistence=wait)
    assert out.failed_at() == [None, at, at, at]


@pytest.mark.parametrize(("wait", "stood"), [(1, 1), (2, 1), (3, 2), (10, 5), (11, 6)])
def test_an_answer_must_stand_for_half_of_the_split_persistence(wait: int, stood: int):
    reference = np.where(FRAMES > 15, 0.0, NAN)
    out = vote_samples(constant(*APART), reference=reference, tie_break=["reference"], split_persistence=wait)
    assert out.failed_at() == [None, *[15 + stood] * 3]


# Given up.


def given_up(samples: Any, **more: Any) -> Any:
    return vote_samples(samples, params={"unresolved_frames": 20}, tie_break=more.pop("tie_break", []), **more)


@pytest.mark.requirement("redundancy", "a split that no rule answers is given up")
def test_a_split_that_no_rule_settles_is_given_up_after_its_frames():
    out = given_up(constant(*SPLIT), reference=50.0)
    assert out.failed_at() == [20] * 4 and out.level.tolist() == [4] * 19 + [0] * 11
    assert (out.decided_by[:19] == DecidedBy.UNRESOLVED).all() and out.decided_by[19] == DecidedBy.GIVEN_UP
    assert (out.pattern[:20] == Pattern.P2_2).all() and (out.pattern[20:] == Pattern.LOST).all()
    assert (out.reference_usable == 1).all() and (out.voted == out.voted[19]).all()


def test_a_reference_that_was_set_aside_stays_so_when_the_signal_is_given_up():
    samples = np.concatenate([constant(0, 0, 0, 0, frames=8), constant(*SPLIT)])
    out = given_up(samples, reference=50.0, tie_break=["reference"])
    assert out.failed_at() == [28] * 4 and (out.reference_usable[7:] == 0).all()


def test_the_wait_goes_on_from_one_pattern_without_a_majority_to_another():
    assert given_up(rows((10, APART), (20, SPLIT))).failed_at() == [20] * 4


@pytest.mark.parametrize(
    ("frames", "between", "ilm", "at"),
    [
        (1, SPLIT, (GOOD, GOOD, BAD, BAD), 21),  # an answer that does not last
        (4, SPLIT, (GOOD, GOOD, BAD, BAD), 24),
        (1, (*SPLIT[:3], np.nan), (ABSENT,) * 4, 21),  # a sample is missing
        (1, (0, 0, 0, 0), (ABSENT,) * 4, 31),  # a majority
        (1, (0, 0, 0, 9), (ABSENT,) * 4, 31),
    ],
)
def test_a_majority_of_all_begins_it_again_and_nothing_that_does_not_last(
    frames: int, between: tuple[float, ...], ilm: tuple[int, ...], at: int
):
    flags = rows((10, (ABSENT,) * 4), (frames, ilm), (30 - frames, (ABSENT,) * 4)).astype(int)
    samples = rows((10, SPLIT), (frames, between), (30 - frames, SPLIT))
    assert given_up(samples, tie_break=["ilm"], ilm=flags).failed_at() == [at] * 4


@pytest.mark.requirement("redundancy", "a split that no rule answers is given up")
@pytest.mark.parametrize(("without", "frames", "at"), [(4, 1, 21), (4, 5, 25), (1, 5, 25)])
def test_a_gap_that_leaves_a_majority_neither_counts_nor_begins_it_again(without: int, frames: int, at: int):
    gap = np.where(np.arange(1, 5) == without, NAN, SPLIT)
    assert given_up(rows((10, SPLIT), (frames, gap), (29, SPLIT))).failed_at() == [at] * 4


def test_a_gap_that_no_rule_settles_counts():
    assert given_up(rows((10, APART), (5, (0, 5, 10, NAN)), (29, APART))).failed_at() == [20] * 4


@pytest.mark.requirement("redundancy", "a split that no rule answers is given up")
@pytest.mark.parametrize(("answered", "at"), [(1, 21), (4, 24), (5, 15 + 20)])
def test_an_answer_without_a_faulty_channel_begins_it_again_when_it_has_stood(answered: int, at: int):
    """The reference lies between both halves, within its threshold of each."""
    reference = rows((10, NAN), (answered, 2.5), (30, NAN))
    samples = constant(*SPLIT, frames=40 + answered)
    out = given_up(samples, reference=reference, tie_break=["reference"], reference_threshold=3.0)
    assert (out.decided_by[10 : 10 + answered] == DecidedBy.REFERENCE).all() and out.failed_at() == [at] * 4


@pytest.mark.parametrize(("answered", "at"), [(1, 21), (4, 24), (5, 7 + 20)])
def test_one_that_blames_a_side_and_is_too_early_to_settle_it_does_so_too(answered: int, at: int):
    flags = rows((2, (ABSENT,) * 4), (answered, (GOOD, GOOD, BAD, BAD)), (30, (ABSENT,) * 4)).astype(int)
    samples = constant(*SPLIT, frames=32 + answered)
    assert given_up(samples, tie_break=["ilm"], ilm=flags).failed_at() == [at] * 4


def test_an_answer_in_every_other_row_does_not_keep_a_split_open():
    """Row 39 is the 20th without one."""
    flags = rows(*[(1, (ABSENT,) * 4), (1, (GOOD, GOOD, BAD, BAD))] * 25).astype(int)
    assert given_up(constant(*SPLIT, frames=50), tie_break=["ilm"], ilm=flags).failed_at() == [39] * 4


def test_with_no_frames_a_split_stays_open():
    out = vote_samples(constant(*SPLIT, frames=300), tie_break=[])
    assert out.failed_at() == [None] * 4 and (out.decided_by == DecidedBy.UNRESOLVED).all()


# The up-and-down counter.

ON_AND_OFF = np.array([1, 1, 0, 1, 0, 1, 1, 0, 1, 1, 1, 1], bool)


@pytest.mark.requirement("redundancy", "an up-and-down counter")
@pytest.mark.parametrize(
    ("down", "at"),
    [
        (0.5, 7),  # 1, 2, 1.5, 2.5, 2, 3, 4
        (1.0, 10),  # 1, 2, 1, 2, 1, 2, 3, 2, 3, 4
        (3.0, 12),  # 1, 2, 0, 1, 0, 1, 2, 0, 1, 2, 3, 4
        (None, 12),
    ],
)
def test_an_agreeing_frame_takes_so_much_off_the_count(down: float | None, at: int):
    samples = np.zeros((12, 4))
    samples[ON_AND_OFF, 3] = 5.0
    out = vote_samples(samples, persistence=4, count_down=down)
    assert out.failed_at() == [None, None, None, at]


def test_a_channel_is_suspect_until_its_count_is_down():
    out = vote_samples(rows((3, (0, 0, 0, 5)), (9, (0, 0, 0, 0))), count_down=0.5, persistence=8)
    assert (out.state[:8, 3] == State.SUSPECT).all() and (out.state[8:, 3] == State.OK).all()


def test_a_split_holds_the_count_and_what_it_would_go_down_by():
    """Three up, a split of two frames and as many after it that hold, one down, then six more up."""
    off, on = (0, 0, 0.1, 9), (0, 0, 0.1, 0.2)
    out = vote_samples(
        rows((3, off), (2, (0, 0.1, 9, 9.1)), (2, on), (1, on), (20, off)), count_down=1.0, persistence=8
    )
    assert out.failed_at() == [None, None, None, 3 + 2 + 2 + 1 + 6]


def test_the_count_in_frames_is_given_with_what_goes_down():
    with pytest.raises(ValidationError, match="count_down: needs persistence"):
        SignalConfig(threshold=1.0, count_down=0.5)


# A readmission by command.


def test_a_sample_beyond_the_range_does_not_agree_however_near_the_vote():
    """The fourth is failed at frame 8 and then 0.7 above the others, who are within the range as it is not."""
    samples = rows((10, (0.5, 0.5, 0.5, 5)), (50, (0.5, 0.5, 0.5, 1.2)))
    more: dict[str, Any] = {"limits": (-1.0, 1.0), "readmit_frames": 20, "resets": [(50, 4)]}
    assert vote_samples(samples, **more).level[50] == 3
    samples[10:, 3] = 0.9
    assert vote_samples(samples, **more).level[50] == 4
