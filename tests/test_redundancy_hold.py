"""The vote that no rule decides, through gaps, answers of one row and jumps: shares and votes by hand.

Frames are counted from 1 as in the requirement. Threshold 1; in a flight of two the first is in order, and reads 0.
"""

from typing import Any

import numpy as np
import pytest
from conftest import Voted, rows, vote_samples
from numpy.typing import NDArray

from rig.core.frame import DecidedBy, Ilm

NAN = np.nan
GOOD, BAD, ABSENT = int(Ilm.GOOD), int(Ilm.BAD), int(Ilm.ABSENT)
PAIR, PAIRS = ((0, 0.8), (0, 5)), ((0, 0, 0.8, 0.8), (0, 0, 5, 5.5))  # together, with a vote of 0.4; then split


def held(*samples: tuple[float, ...], truth: Any = 0.0, **more: Any) -> Voted:
    """Fly these rows; where no rule settles it the vote is off by no more than the plain mean of those in use."""
    n = len(samples[0])
    block = np.full((len(samples), 4), NAN)
    block[:, :n] = samples
    out = vote_samples(block, channels=n, tie_break=more.pop("tie_break", []), **more)
    silent = out.decided_by == DecidedBy.UNRESOLVED
    plain = np.nanmean(block, axis=1)
    assert (np.abs(out.voted - truth) <= np.abs(np.subtract(plain, truth)) + 1e-12)[silent].all()
    return out


def missing(samples: tuple[float, ...], c: int) -> tuple[float, ...]:
    """The same without channel ``c``, from 1."""
    return tuple(NAN if i == c else x for i, x in enumerate(samples, 1))


def said(row: int, rows_in_all: int, *four: int) -> NDArray[np.int64]:
    """Monitors that speak in one row, from 1."""
    return np.where(np.arange(1, rows_in_all + 1)[:, None] == row, four, ABSENT)


# A gap of one row.


@pytest.mark.requirement("redundancy", "an unresolved vote stays between two channels")
@pytest.mark.parametrize(
    ("flight", "c", "alone"),
    [
        (PAIR, 1, 5.0),  # the other one
        (PAIR, 2, 0.0),
        (PAIRS, 1, 5.0),  # the middle of the other three
        (PAIRS, 2, 5.0),
        (PAIRS, 3, 0.0),
        (PAIRS, 4, 0.0),
    ],
)
def test_a_missing_row_does_not_give_the_vote_to_one_side(flight: Any, c: int, alone: float):
    """Of the gap of 5 the vote of 0.4 is 0.08."""
    together, split = flight
    out = held(together, split, split, missing(split, c), split, split)
    assert out.voted == pytest.approx([0.4, 0.4, 0.4, alone, 0.4, 0.4])


@pytest.mark.parametrize(
    ("then", "vote"),
    [
        ((1, 6), 1.4),
        ((0.5, 6.25), 0.5 + 0.08 * 5.75),
        ((0, 9), 4.5),  # a distance of 4 more, and the last vote is of the first alone: half each
    ],
)
def test_after_a_gap_the_shares_go_on_unless_the_distance_has_jumped(then: tuple[float, ...], vote: float):
    out = held(*PAIR, missing(PAIR[1], 2), then, truth=then[0])
    assert out.voted[3] == pytest.approx(vote)


@pytest.mark.requirement("redundancy", "an unresolved vote stays between two channels")
@pytest.mark.parametrize(
    ("together", "c", "split", "vote", "then", "later"),
    [
        ((0, 0.8), 1, (0, 5), 2.5, (0, 6), 3.0),
        ((0, 0.8), 2, (0, 5), 2.5, (0, 7), 2.5),  # a jump of 2
        ((0, 0, 0.8, 0.8), 1, (0, 0, 5, 5.5), 2.5, (0, 0.5, 5, 5.5), 2.75),
    ],
)
def test_after_a_gap_in_the_row_before_a_split_both_ranks_have_half(
    together: Any, c: int, split: Any, vote: float, then: Any, later: float
):
    out = held(together, missing(together, c), split, split, then)
    assert out.voted[2:] == pytest.approx([vote, vote, later])


def test_of_three_after_a_gap_it_is_the_middle_one():
    out = held((3, 3, 3), (3, 3, NAN), (0, 2.5, 4), (0, 3.5, 6), truth=[3, 3, 2.5, 3.5])
    assert out.voted.tolist() == [3.0, 3.0, 2.5, 3.5]


# An answer of one row.


@pytest.mark.requirement("redundancy", "an unresolved vote stays between two channels")
@pytest.mark.parametrize(
    ("flight", "four", "by_monitors"), [(PAIR, (BAD, GOOD, ABSENT, ABSENT), 5.0), (PAIRS, (BAD, BAD, GOOD, GOOD), 5.25)]
)
def test_nor_does_a_row_in_which_monitors_or_a_reference_speak_for_the_bad_side(
    flight: Any, four: tuple[int, ...], by_monitors: float
):
    """The reference lies above: the vote is the middle of it and of the ranks 0 and 5."""
    together, split = flight
    samples = (together, split, split, split, split, split)
    out = held(*samples, tie_break=["ilm"], ilm=said(4, 6, *four))
    assert out.voted == pytest.approx([0.4, 0.4, 0.4, by_monitors, 0.4, 0.4])
    reference = rows((3, NAN), (1, 6), (2, NAN))
    out = held(*samples, tie_break=["reference"], reference=reference)
    assert out.decided_by[3] == DecidedBy.REFERENCE and out.voted == pytest.approx([0.4, 0.4, 0.4, 5.0, 0.4, 0.4])


def test_where_a_split_begins_with_an_answer_both_have_half_after_it():
    samples = (PAIR[0], *[PAIR[1]] * 3)
    out = held(*samples, tie_break=["ilm"], ilm=said(2, 4, BAD, GOOD, ABSENT, ABSENT))
    assert out.voted == pytest.approx([0.4, 5.0, 2.5, 2.5])


def test_a_row_in_which_all_agree_begins_the_shares_again():
    """The vote of that row is 2: 0.4 of the gap."""
    out = held(*PAIR, (2, 2), PAIR[1], PAIR[1])
    assert out.voted == pytest.approx([0.4, 0.4, 2.0, 2.0, 2.0])


# A held channel that jumps.


@pytest.mark.requirement("redundancy", "a held channel that jumps has no share")
@pytest.mark.parametrize(
    ("jump", "then", "later"),
    [
        ((0, 2, 40), (0, 2, 41), 2 + 39 / 38),  # 1/38 of the new gap, and its distance moves by no more than 1
        ((0, 40, 4), (1, 41, 5), 4.0),  # from now on between the first and the third, whatever the second does
        ((40, 2, 4), (80, 3, 5), 4.0),  # that one has no share
    ],
)
def test_of_three_apart_one_that_jumps_takes_nothing_along(jump: Any, then: Any, later: float):
    """The vote of 3 lies between the second and the third."""
    out = held((3, 3, 3), (0, 2, 4), jump, then, truth=3.0)
    assert out.voted == pytest.approx([3.0, 3.0, 3.0, later])


@pytest.mark.requirement("redundancy", "a held channel that jumps has no share")
@pytest.mark.parametrize(
    ("samples", "votes"),
    [
        ([(0, 10), (0, 30), (0, -30)], [0.4, 0.4, 0.0]),  # at last on the other side of the first one
        ([(0, 6), (0, 7), (0, 8)], [0.48, 0.56, 0.64]),  # a step of one threshold is no jump
        ([(0, 6.125), (0, 7.125), (0, 8.125)], [0.4, 0.4 / 6.125 * 7.125, 0.4 / 6.125 * 8.125]),
    ],
)
def test_a_jump_of_one_of_two_leaves_the_vote_where_it_was(samples: Any, votes: list[float]):
    assert held(*PAIR, *samples).voted[2:] == pytest.approx(votes)


@pytest.mark.parametrize(("threshold", "vote"), [(2.0, 0.4), (2.5, 0.08 * 7.5)])
def test_the_threshold_is_that_of_the_samples_compared(threshold: float, vote: float):
    out = held(*PAIR, (0, 7.5), threshold_duplex=threshold)
    assert out.voted[2] == pytest.approx(vote)
