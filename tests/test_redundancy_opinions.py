"""The trend's windows and frozen sides, and the health of the computers: by hand.

Frames are counted from 1 as in the requirement. Defaults: threshold 1, persistence 8, split persistence 10.
"""

from typing import Any

import numpy as np
import pytest
from conftest import constant, vote_samples
from numpy.typing import NDArray

from rig.computer.redundancy import opinions
from rig.core.frame import DecidedBy, Ilm, Pattern

NAN = np.nan
SPLIT = (0, 0.1, 5, 5.1)
ALONE: dict[str, Any] = {"tie_break": ["trend"]}


def moving(*slopes: float, frames: int = 30, start: tuple[float, ...] = SPLIT) -> NDArray[np.float64]:
    """Four samples that start at ``start`` and move by ``slopes`` a frame."""
    moved = np.arange(frames, dtype=np.float64)[:, None] * np.array(slopes, dtype=np.float64)
    return np.array(start, dtype=np.float64) + moved


def asked_at(out: Any) -> list[int]:
    """The frames, from 1, in which the trend answers."""
    return (np.flatnonzero(out.decided_by == DecidedBy.TREND) + 1).tolist()


# A frozen side.


@pytest.mark.requirement("redundancy", "a frozen side is no trend")
@pytest.mark.parametrize("slopes", [(-0.1, -0.1, 0, 0), (0, 0, -0.1, -0.1), (0.1, 0.1, 0, 0), (0, 0, 0.1, 0.1)])
def test_a_side_that_does_not_move_beside_one_that_does_is_no_trend(slopes: tuple[float, ...]):
    """Falling, both bytes are zero as for two that are still: the paper's byte would call the smaller side right."""
    out = vote_samples(moving(*slopes), **ALONE)
    assert (out.decided_by == DecidedBy.UNRESOLVED).all() and out.failed_at() == [None] * 4


@pytest.mark.parametrize(
    ("slopes", "failed"),
    [((-0.1, -0.1, -0.1, -0.1), [3, 4]), ((0, 0, 0, 0), [3, 4]), ((0.1, 0.1, 0.1, 0.1), [1, 2])],
)
def test_two_sides_that_move_or_rest_alike_are_one(slopes: tuple[float, ...], failed: list[int]):
    out = vote_samples(moving(*slopes), **ALONE)
    assert [c for c, at in enumerate(out.failed_at(), 1) if at == 10] == failed


@pytest.mark.parametrize(("frames", "first"), [(3, 4), (8, 9)])
def test_a_side_is_frozen_after_as_many_frames_as_the_byte_has(frames: int, first: int):
    """The upper side falls but in one frame: it is not still for as long as the byte is, and the smaller is right."""
    samples = moving(-0.125, -0.125, -0.125, -0.125, start=(0, 0.125, 5, 5.125))
    samples[2:, 2:] += 0.125  # the third row repeats the second
    out = vote_samples(samples, **ALONE, trend_frames=frames)
    assert asked_at(out)[0] == first
    samples[3:, 2:] = samples[2, 2:]  # and from there on it is
    out = vote_samples(samples, **ALONE, trend_frames=frames)
    assert asked_at(out) == list(range(first, frames + 2))


# How many frames are asked.


@pytest.mark.requirement("redundancy", "a trend of one frame where changes are small")
@pytest.mark.parametrize(("slope", "first"), [(0.05, 2), (-0.05, 2), (0.0, 2), (0.0625, 9), (-0.0625, 9)])
def test_where_changes_are_small_one_frame_is_enough(slope: float, first: int):
    samples = np.round(moving(slope, slope, slope, slope) * 256) / 256  # so that changes are what they are
    limit = np.round(0.05 * 256) / 256 if abs(slope) == 0.05 else 0.05
    out = vote_samples(samples, **ALONE, trend_small=limit + 1 / 256)
    assert asked_at(out)[0] == first
    assert asked_at(vote_samples(samples, **ALONE))[0] == 9


def test_only_where_those_of_both_ranks_are():
    out = vote_samples(moving(0.0625, 0.0625, 0.03125, 0.03125), **ALONE, trend_small=0.03125)
    assert asked_at(out)[0] == 9
    out = vote_samples(moving(0.0625, 0.0625, 0.03125, 0.03125), **ALONE, trend_small=0.0625)
    assert asked_at(out)[0] == 2


def test_one_frame_in_which_one_side_is_still_is_no_trend():
    assert asked_at(vote_samples(moving(-0.0625, -0.0625, 0, 0), **ALONE, trend_small=0.0625)) == []


def test_the_newest_frame_may_contradict_those_before():
    samples = moving(0.125, 0.125, 0.125, 0.125)
    samples[12:] = samples[11] - 0.015625 * np.arange(1, 19)[:, None]
    out = vote_samples(samples, tie_break=["trend"], trend_small=0.03125, split_persistence=30)
    assert out.voted[11] == pytest.approx(samples[11, 2:].mean())  # eight frames rising
    assert out.voted[12] == pytest.approx(samples[12, :2].mean())  # one falling


@pytest.mark.requirement("redundancy", "tumbling windows of the trend")
def test_a_tumbling_window_is_begun_again_and_its_verdict_stands_until_the_next():
    """Windows of four changes end in rows 5, 9, 13; in the third a side falls once, in row 11."""
    samples = moving(0.125, 0.125, 0.125, 0.125)
    samples[10:, 2:] -= 0.25
    more: dict[str, Any] = {"trend_frames": 4, "split_persistence": 30}
    out = vote_samples(samples, **ALONE, **more, trend_window="tumbling")
    assert asked_at(out) == [*range(5, 13), *range(17, 31)]
    assert out.trend_high[:14].tolist() == [0, 1, 3, 7, 15, 1, 3, 7, 15, 1, 2, 5, 11, 1]
    assert out.trend_low[:14].tolist() == [0, 1, 3, 7, 15, 1, 3, 7, 15, 1, 3, 7, 15, 1]
    sliding = vote_samples(samples, **ALONE, **more)
    assert asked_at(sliding) == [*range(5, 11), *range(15, 31)]


def test_a_verdict_does_not_outlive_a_change_of_the_number_of_samples():
    samples = moving(0.125, 0.125, 0.125, 0.125)
    samples[6, 0] = NAN
    out = vote_samples(samples, **ALONE, trend_frames=4, split_persistence=30, trend_window="tumbling")
    assert asked_at(out) == [5, 6, *range(12, 31)]  # four changes from the eighth row on


def test_a_side_frozen_for_a_whole_window_is_no_trend():
    samples = moving(-0.125, -0.125, 0, 0)
    assert asked_at(vote_samples(samples, **ALONE, trend_frames=4, trend_window="tumbling")) == []


# Beside a reference.


@pytest.mark.requirement("redundancy", "the trend is asked where no reference is configured")
@pytest.mark.parametrize(
    ("referred", "beside", "answers"), [(0, False, True), (1, False, False), (1, True, True), (0, True, True)]
)
def test_the_trend_of_a_signal_with_a_reference_is_asked_only_by_choice(referred: int, beside: bool, answers: bool):
    given: dict[str, Any] = {"params": {"referred": referred}, "trend_beside_reference": beside, **ALONE}
    pair = np.where(np.arange(4) < 2, constant(0, 5, 0, 0), NAN)
    for out in (vote_samples(constant(*SPLIT), **given), vote_samples(pair, channels=2, **given)):
        assert bool(asked_at(out)) is answers and out.trend_high[9] == 0
        assert (out.failed_at()[-1] or out.failed_at()[1]) == (10 if answers else None)


# The health of the computers.

ORDER = np.array([2, 0, 3, 1])  # channels by ascending value


@pytest.mark.parametrize(
    ("failed", "n", "sides"),
    [
        ([], 4, opinions.NO_ANSWER),
        ([0], 4, opinions.LOW_SIDE),
        ([2], 4, opinions.LOW_SIDE),
        ([0, 2], 4, opinions.LOW_SIDE),
        ([3], 4, opinions.HIGH_SIDE),
        ([1, 3], 4, opinions.HIGH_SIDE),
        ([0, 1], 4, opinions.NO_ANSWER),
        ([0, 1, 2, 3], 4, opinions.NO_ANSWER),
        ([2], 2, opinions.LOW_SIDE),
        ([0], 2, opinions.HIGH_SIDE),
        ([1, 3], 2, opinions.NO_ANSWER),
        ([0, 2], 2, opinions.NO_ANSWER),
    ],
)
def test_the_half_with_a_failed_computer_is_wrong_if_the_other_has_none(failed: list[int], n: int, sides: int):
    assert opinions.by_lanes(sum(1 << c for c in failed), ORDER, n) == sides


def flown(samples: Any, *failed: int, **more: Any) -> Any:
    """A flight with the computers of these channels, from 1, failed throughout."""
    lanes = np.isin(np.arange(1, 5), failed)
    return vote_samples(samples, lanes=np.tile(lanes, (len(samples), 1)), **more)


@pytest.mark.requirement("redundancy", "splits by the health of the computers")
def test_a_split_along_failed_computers_is_settled_by_them():
    out = flown(constant(*SPLIT), 2)
    assert out.failed_at() == [10, 10, None, None] and (out.decided_by[:10] == DecidedBy.LANE).all()
    assert out.voted[:10] == pytest.approx(np.full(10, 5.05))
    assert flown(constant(*SPLIT), 3, 4).failed_at() == [None, None, 10, 10]


@pytest.mark.requirement("redundancy", "splits by the health of the computers")
def test_of_two_the_one_with_a_failed_computer_is_wrong():
    pair = np.where(np.arange(4) < 2, constant(0, 5, 0, 0), NAN)
    out = flown(pair, 1, channels=2)
    assert out.failed_at() == [10, None, None, None] and (out.voted == 5).all()


def test_a_failed_computer_on_each_side_says_nothing():
    assert (flown(constant(*SPLIT), 1, 3, tie_break=["lane"]).decided_by == DecidedBy.UNRESOLVED).all()


@pytest.mark.parametrize("samples", [(-9, -3, 3, 9), (-9, 3, 9, NAN)])
def test_where_no_channels_agree_computers_decide_nothing(samples: tuple[float, ...]):
    out = flown(constant(*samples), 1, 2, channels=int(np.isfinite(samples).sum()), tie_break=["lane"])
    assert (out.decided_by == DecidedBy.UNRESOLVED).all()
    assert out.pattern[0] in (Pattern.P1_1_1_1, Pattern.P1_1_1)


def test_by_default_computers_are_asked_after_the_monitors_and_before_the_reference():
    ilm = np.tile([Ilm.GOOD, Ilm.GOOD, Ilm.BAD, Ilm.BAD], (30, 1))
    assert flown(constant(*SPLIT), 1, ilm=ilm, reference=0.0).decided_by[0] == DecidedBy.ILM
    assert flown(constant(*SPLIT), 1, reference=0.0).decided_by[0] == DecidedBy.LANE
    out = flown(constant(*SPLIT), 1, reference=0.0, tie_break=["reference", "lane"])
    assert out.decided_by[0] == DecidedBy.REFERENCE
