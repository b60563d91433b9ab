"""Samples that repeat while another moves: who is stale, from which frame on, and what becomes of it; by hand.

Frames are counted from 1 as in the requirement. Three repeats are too many here; persistence 8.
"""

from typing import Any

import numpy as np
import pytest
from conftest import Voted, rows, vote_samples
from numpy.typing import NDArray

from rig.core.frame import DecidedBy, Pattern, State

NAN = np.nan
RAMP = np.arange(30.0)[:, None] / 8
WIDE: dict[str, Any] = {"stale_frames": 3, "threshold": 10.0}
OFFSETS = (0.0, 1.0, 2.0, 3.0)


def moving(*offsets: float) -> NDArray[np.float64]:
    """Four samples that rise by 1/8 a frame."""
    return RAMP + np.array(offsets or OFFSETS)


def frozen(c: int, since: int, until: int = 30, samples: Any = None) -> NDArray[np.float64]:
    """The same with channel ``c`` (from 1) repeating frame ``since`` up to frame ``until``."""
    out = moving() if samples is None else samples.copy()
    out[since:until, c - 1] = out[since - 1, c - 1]
    return out


def stale(out: Voted, c: int) -> list[int]:
    """The frames in which channel ``c`` is suspect."""
    return (np.flatnonzero(out.state[:, c - 1] == State.SUSPECT) + 1).tolist()


@pytest.mark.requirement("redundancy", "a stale sample cannot be compared")
def test_the_third_repeat_is_no_sample_any_more():
    """Frames 6, 7 and 8 repeat the fifth; with three left the vote is that of channel 2."""
    samples = frozen(3, since=5)
    out = vote_samples(samples, **WIDE)
    assert stale(out, 3) == list(range(8, 15)) and out.failed_at() == [None, None, 15, None]
    assert out.voted[7:].tolist() == samples[7:, 1].tolist()
    assert (out.voted[:7] == np.sort(samples[:7], axis=1)[:, 1:3].mean(axis=1)).all()
    assert (vote_samples(samples, threshold=10.0).state == State.OK).all()


def test_one_that_moves_again_is_a_sample_at_once():
    out = vote_samples(frozen(3, since=5, until=10), **WIDE)
    assert stale(out, 3) == [8, 9, 10] and out.failed_at() == [None] * 4


@pytest.mark.requirement("redundancy", "a stale sample cannot be compared")
def test_a_stale_sample_counts_in_a_split_of_the_others():
    samples = moving(0, 20, 40, 19)
    samples[:, 3] = 19.0  # near the second, and stale from frame 4 on
    out = vote_samples(samples, stale_frames=3, threshold=5.0, tie_break=[])
    assert (out.pattern[3:] == Pattern.P1_1_1).all() and (out.decided_by[3:] == DecidedBy.UNRESOLVED).all()
    assert out.failed_at() == [None, None, None, 11]


# Where nothing moves, repeating tells nothing.


@pytest.mark.requirement("redundancy", "if all channels repeat, none is stale")
def test_where_all_repeat_no_channel_is_stale():
    out = vote_samples(np.tile(OFFSETS, (30, 1)), **WIDE)
    assert (out.state == State.OK).all()


@pytest.mark.requirement("redundancy", "if all channels repeat, none is stale")
def test_repeats_are_counted_in_frames_in_which_most_others_move():
    """The first two move in frames 5, 9 and 13 alone; the others are stale in the third of them and from there on."""
    samples = np.tile(OFFSETS, (30, 1))
    samples[:, :2] += np.clip(np.arange(30) // 4, 0, 3)[:, None]
    out = vote_samples(samples, **WIDE)
    for c in (3, 4):
        assert stale(out, c) == list(range(13, 20)) and out.failed_at()[c - 1] == 20
    assert out.failed_at()[:2] == [None, None]


@pytest.mark.requirement("redundancy", "if all channels repeat, none is stale")
def test_a_coarse_sensor_that_flickers_makes_no_other_stale():
    samples = np.zeros((60, 4))
    samples[::2, 0] = 1.0
    out = vote_samples(samples, **WIDE)
    assert out.failed_at() == [None] * 4 and (out.state == State.OK).all()


@pytest.mark.requirement("redundancy", "if all channels repeat, none is stale")
@pytest.mark.parametrize("at", [0.0, 100.0])
def test_all_that_repeat_are_stale_where_a_usable_reference_contradicts_them(at: float):
    """At rest and at the stop: three frames at which it is off by more than 1.5 of its thresholds, then eight more."""
    reference = np.repeat((at, at - 16.0), (10, 20))
    more: dict[str, Any] = {"reference": reference, "reference_threshold": 10.0, "limits": (-100.0, 100.0)}
    out = vote_samples(np.full((30, 4), at), **WIDE, **more)
    assert stale(out, 1) == list(range(13, 20)) and out.failed_at() == [20] * 4
    near = vote_samples(np.full((30, 4), at), **WIDE, **{**more, "reference": reference + 2.0 * (reference < at)})
    beyond = vote_samples(np.full((30, 4), 100.0), **WIDE, **{**more, "reference": 150.0})
    assert near.failed_at() == beyond.failed_at() == [None] * 4


@pytest.mark.requirement("redundancy", "if all channels repeat, none is stale")
@pytest.mark.parametrize("c", [1, 2, 3, 4])
def test_one_of_four_that_flickers_at_rest_tells_nothing_of_the_others(c: int):
    samples = np.tile(OFFSETS, (30, 1))
    samples[:, c - 1] += np.arange(30) % 2 / 8
    assert (vote_samples(samples, **WIDE).state == State.OK).all()


@pytest.mark.requirement("redundancy", "a stale sample cannot be compared")
def test_two_of_four_that_freeze_are_both_stale_while_the_others_move():
    """Of the three beside each of them two have moved."""
    out = vote_samples(frozen(4, since=5, samples=frozen(3, since=5)), **WIDE)
    assert stale(out, 3) == stale(out, 4) == list(range(8, 15)) and out.failed_at() == [None, None, 15, 15]


@pytest.mark.parametrize(("three", "at"), [(NAN, [None, 11, 11, 8]), (3.0, [None] * 4)])
def test_one_of_two_others_is_half_of_them_and_one_of_three_is_not(three: float, at: list[int | None]):
    samples = np.tile((0.0, 1.0, 2.0, three), (30, 1))
    samples[:, 0] += RAMP[:, 0]
    assert vote_samples(samples, **WIDE).failed_at() == at


@pytest.mark.parametrize(("move", "level"), [(1, 4), (2, 3)])
def test_a_failed_channel_repeats_beside_half_of_all_in_use(move: int, level: int):
    """One of three moves in each frame, or two; none of them repeats for more than two, and the fourth for ever."""
    samples = rows((10, (0, 0, 0, 50)), (50, (0, 0, 0, 0)))
    turn = np.arange(60)[:, None] % 3 == np.arange(3)
    samples[:, :3] = np.cumsum(turn if move == 1 else ~turn, axis=0) % 2 / 8
    more: dict[str, Any] = {"threshold": 10.0, "readmit_frames": 20, "resets": [(50, 4)]}
    assert vote_samples(samples, **more, stale_frames=3).level[50] == level


def test_a_failed_channel_that_moves_is_no_witness():
    samples = np.tile(OFFSETS, (30, 1))
    samples[:, 3] = 50.0 + np.arange(30)
    out = vote_samples(samples, **WIDE, persistence=2)
    assert out.failed_at() == [None, None, None, 2] and (out.state[2:, :3] == State.OK).all()


# Frames without a sample.


@pytest.mark.requirement("redundancy", "a frame without a sample counts no repeat and ends none")
def test_a_gap_neither_counts_nor_begins_again():
    samples = frozen(3, since=5)
    samples[[6, 7], 2] = NAN  # repeats in frames 6, 9 and 10
    out = vote_samples(samples, **WIDE)
    assert stale(out, 3) == [7, 8, *range(10, 17)]
    assert out.failed_at() == [None, None, 17, None]


def test_a_gap_after_which_the_sample_is_another_ends_it():
    samples = frozen(3, since=5, until=9)
    samples[8, 2] = NAN
    out = vote_samples(samples, **WIDE)
    assert stale(out, 3) == [8, 9] and out.failed_at() == [None] * 4


def test_a_sample_beyond_the_range_is_a_gap():
    samples = frozen(3, since=5)
    samples[6, 2] = 900.0
    out = vote_samples(samples, **WIDE, limits=(-100.0, 100.0))
    assert stale(out, 3)[:3] == [7, 9, 10]


# At the end of the range.


@pytest.mark.requirement("redundancy", "a sample at the end of the range may repeat")
@pytest.mark.parametrize("side", [1, -1])
def test_a_channel_at_its_stop_is_not_stale(side: int):
    samples = side * (5.0 - moving())
    samples[:, 3] = side * 5.0
    assert (vote_samples(samples, **WIDE, limits=(-5.0, 5.0)).state == State.OK).all()
    assert vote_samples(samples, **WIDE, limits=(-5.5, 5.5)).failed_at() == [None, None, None, 11]


def test_repeats_up_to_the_stop_are_forgotten_there():
    samples = frozen(4, since=5, until=7)
    samples[7:9, 3], samples[9:, 3] = 5.0, samples[4, 3]
    out = vote_samples(samples, **WIDE, limits=(-5.0, 5.0))
    assert stale(out, 4) == list(range(13, 20))


def test_an_angle_has_no_stop():
    samples = np.tile([0.0, 0.1, 0.1, 0.1], (30, 1)) + [0, 1, 1, 1] * (RAMP / 100)
    out = vote_samples(samples, stale_frames=3, threshold=1.0, wraps=True, limits=(0.0, 2 * np.pi))
    assert out.failed_at() == [11, None, None, None]


# The only one left.


def alone(reference: Any, **more: Any) -> Voted:
    samples = np.full((30, 4), NAN)
    samples[:, 3] = 1.0
    return vote_samples(samples, stale_frames=3, reference=reference, reference_threshold=50.0, **more)


@pytest.mark.requirement("redundancy", "the last channel is stale beside a reference that moves")
def test_the_only_channel_left_is_stale_while_its_reference_moves():
    out = alone(RAMP[:, 0])
    assert stale(out, 4) == list(range(4, 11)) and out.failed_at() == [8, 8, 8, 11]
    assert (out.pattern[3:] == Pattern.LOST).all() and (out.voted == 1.0).all()


@pytest.mark.parametrize("reference", [0.0, NAN, None])
def test_and_not_while_it_does_not(reference: float | None):
    assert alone(reference).failed_at() == [8, 8, 8, None]


def test_a_reference_that_comes_has_moved_and_one_that_goes_has_not():
    reference = np.where(np.arange(30) % 2 == 0, 0.0, NAN)  # comes in frames 3, 5 and 7
    assert stale(alone(reference), 4) == list(range(7, 14))


@pytest.mark.parametrize("reference", [np.inf, -np.inf])
def test_one_that_is_infinite_has_not_moved(reference: float):
    assert alone(np.where(np.arange(30) % 2 == 0, NAN, reference)).failed_at() == [8, 8, 8, None]


def test_a_reference_beyond_the_range_moves_as_it_is_given():
    assert alone(100.0 + RAMP[:, 0], limits=(-2.0, 2.0)).failed_at()[3] == 11


def test_beside_two_channels_the_reference_is_no_witness():
    samples = np.tile([0.0, 1.0, NAN, NAN], (30, 1))
    out = vote_samples(samples, **WIDE, channels=2, reference=RAMP[:, 0])
    assert (out.state[:, :2] == State.OK).all()


# What else reads samples.


def test_a_failed_channel_that_is_stale_does_not_agree():
    samples = rows((10, (0, 0, 0, 50)), (50, (0, 0, 0, 0)))
    samples[:, :3] += np.arange(60)[:, None] % 2 / 8
    more: dict[str, Any] = {"threshold": 10.0, "readmit_frames": 20, "resets": [(50, 4)]}
    assert vote_samples(samples, **more).level[50] == 4
    assert vote_samples(samples, **more, stale_frames=3).level[50] == 3


def test_a_filter_begins_again_after_a_stale_sample():
    """Where the vote of the others is, which have followed a ramp; with its own past it would lag behind them."""
    samples = np.zeros((60, 4)) + np.arange(60)[:, None] / 8
    samples[15:45, 0] = samples[14, 0]
    more: dict[str, Any] = {"filter_s": 0.05, "persistence": 40, "threshold": 5.5}
    out = vote_samples(samples, stale_frames=3, **more)
    assert out.pattern[44] == Pattern.NORMAL and out.state[44, 0] == State.SUSPECT  # three are compared
    assert (out.state[45:, 0] == State.OK).all()
