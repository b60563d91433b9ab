"""Bursts behind a filter: what of them counts, and what does not; by hand.

Frames are counted from 1 as in the requirement. Threshold 1, persistence 8, split persistence 10, so that a step of
the filter is at most 2/15.
"""

from typing import Any

import numpy as np
import pytest
from conftest import rows, vote_samples

from rig.core.frame import DecidedBy, Pattern, State

NAN = np.nan
ALIKE = (0, 0, 0, 0)
SLOW: dict[str, Any] = {"filter_s": 1.0}  # whose share is 0.00995


@pytest.mark.requirement("redundancy", "a burst behind a filter fails no channel")
@pytest.mark.parametrize("frames", range(1, 15))
@pytest.mark.parametrize("size", [50.0, 900.0])
@pytest.mark.parametrize("filter_s", [0.02, 0.1, 0.5, 1.0])
def test_a_channel_is_failed_by_samples_and_not_by_what_is_left_of_them(frames: int, size: float, filter_s: float):
    """Steps of 2/15: seen off from the eighth frame on, so that eight of them count in the 15th."""
    samples = rows((20, ALIKE), (frames, (0, 0, 0, size)), (60, ALIKE))
    assert vote_samples(samples, filter_s=filter_s).failed_at() == [None] * 4


def test_one_that_lasts_is_failed_when_its_eighth_sample_is_seen_off():
    samples = rows((20, ALIKE), (15, (0, 0, 0, 900.0)), (60, ALIKE))
    assert vote_samples(samples, **SLOW).failed_at() == [None, None, None, 35]


@pytest.mark.requirement("redundancy", "a burst behind a filter fails no channel")
def test_the_rest_of_a_burst_takes_one_off_the_count():
    """Twelve frames at 900: the last five count; then what is left, 1.6 and less, takes off one each: suspect until
    the count is zero and nothing is left, which takes ln(1.6) s."""
    samples = rows((20, ALIKE), (12, (0, 0, 0, 900.0)), (80, ALIKE))
    out = vote_samples(samples, **SLOW)
    assert (out.state[27:78, 3] == State.SUSPECT).all() and (out.state[80:, 3] == State.OK).all()
    again = rows((20, ALIKE), (12, (0, 0, 0, 900.0)), (3, ALIKE), (6, (0, 0, 0, 900.0)), (80, ALIKE))
    assert vote_samples(again, **SLOW).failed_at() == [None, None, None, 41]  # 5 - 3 + 6
    later = rows((20, ALIKE), (12, (0, 0, 0, 900.0)), (5, ALIKE), (7, (0, 0, 0, 900.0)), (80, ALIKE))
    assert vote_samples(later, **SLOW).failed_at() == [None] * 4


@pytest.mark.parametrize(("rest", "at"), [(0.9, None), (1.1, 35)])
def test_off_is_what_is_off_the_vote_by_more_than_the_threshold(rest: float, at: int | None):
    samples = rows((20, ALIKE), (12, (0, 0, 0, 900.0)), (30, (0, 0, 0, rest)))
    assert vote_samples(samples, **SLOW).failed_at()[3] == at


@pytest.mark.requirement("redundancy", "a burst behind a filter fails no channel")
@pytest.mark.parametrize("size", [200.0, -200.0, 900.0])
@pytest.mark.parametrize("others", [(0,), (0, 0), (0, 0, 0)])
@pytest.mark.parametrize(("before", "gap"), [(20, 1), (20, 3), (1, 1), (0, 2), (0, 0)])
def test_a_burst_after_a_gap_or_in_the_first_rows_fails_no_channel(
    before: int, gap: int, others: tuple[float, ...], size: float
):
    """What is compared begins beside the others' and takes two steps of 2/15; from the first row on, where two begin
    in the middle between them, they are 8/15 apart at most."""
    rest = (NAN,) * (3 - len(others))
    samples = rows(
        *((before, (*others, 0, *rest)), (gap, (*others, NAN, *rest))),
        *((2, (*others, size, *rest)), (100, (*others, 0, *rest))),
    )
    n = len(others) + 1
    out = vote_samples(samples, channels=n, filter_s=0.1, persistence=8)
    assert (out.pattern == Pattern.NORMAL).all() and (out.state[before + gap :, :n] == State.OK).all()


# Splits.

SPLIT, APART, PAIR = (0, 0.1, 900, 900.1), (0, 300, 600, 900), (0, 900, NAN, NAN)


def settled(samples: Any, **more: Any) -> Any:
    channels = 2 if np.isnan(samples[0, 2]) else 3 if np.isnan(samples[0, 3]) else 4
    return vote_samples(samples, **SLOW, reference=0.0, tie_break=["reference"], channels=channels, **more)


def burst(frames: int, split: tuple[float, ...], rest: int = 90) -> Any:
    together = tuple(np.where(np.isnan(split), NAN, 0.0))
    return rows((20, together), (frames, split), (rest, together))


@pytest.mark.requirement("redundancy", "a burst behind a filter settles no split")
@pytest.mark.parametrize(
    ("split", "failed"),
    [(SPLIT, [None, None, 37, 37]), (PAIR, [None, 37, None, None]), ((0, 900, -900, NAN), [None, 37, 37, None])],
)
def test_a_split_that_has_closed_goes_on_behind_the_filter_and_settles_nothing(
    split: tuple[float, ...], failed: list[int | None]
):
    """Seen from the eighth frame on: the tenth of it is the 17th of the samples."""
    for frames in (8, 12, 16):
        out = settled(burst(frames, split))
        assert out.failed_at() == [None] * 4
        assert (out.pattern[27 : 20 + frames + 4] == out.pattern[27]).all() and out.pattern[27] != Pattern.NORMAL
    assert settled(burst(17, split)).failed_at() == failed


def test_an_interruption_takes_nothing_from_the_frames_that_a_split_has_lasted():
    """Twelve frames are five of the pattern; three in which the samples are together do not count; five more do."""
    samples = rows((20, ALIKE), (12, SPLIT), (3, ALIKE), (20, SPLIT))
    assert settled(samples).failed_at() == [None, None, 40, 40]


def test_nor_from_the_wait_of_a_split_that_no_rule_settles():
    samples = rows((20, ALIKE), (12, SPLIT), (3, ALIKE), (30, SPLIT))
    out = vote_samples(samples, **SLOW, tie_break=[], params={"unresolved_frames": 20})
    assert out.failed_at() == [20 + 12 + 3 + 15] * 4 and out.decided_by[49] == DecidedBy.GIVEN_UP
    closed = vote_samples(burst(12, SPLIT), **SLOW, tie_break=[], params={"unresolved_frames": 6})
    assert closed.failed_at() == [None] * 4 and (closed.pattern[27:36] == Pattern.P2_2).all()


@pytest.mark.parametrize(("rest", "failed"), [(0.95, None), (1.05, 37)])
def test_together_is_within_the_threshold(rest: float, failed: int | None):
    """Of the two at the middle places of what is compared: a pair that comes back to 1.05 is a split still."""
    samples = rows((20, ALIKE), (12, SPLIT), (60, (0, 0, rest, rest)))
    assert settled(samples).failed_at()[2] == failed


def test_of_three_it_is_the_middle_one_beside_any_other():
    """The largest is still away, but the other two are together: what is left of the pattern settles nothing."""
    samples = rows((20, (0, 0, 0, NAN)), (12, (0, 900, -900, NAN)), (12, (0, 900, 0, NAN)))
    out = settled(samples)
    assert (out.pattern[27:33] == Pattern.P1_1_1).all() and out.failed_at()[0] is None and out.failed_at()[2] is None


@pytest.mark.requirement("redundancy", "an unresolved vote stays between two channels")
def test_a_hold_goes_on_where_a_split_is_closed_for_a_frame():
    """The vote stays where the samples touched: both jump back from there."""
    samples = np.full((40, 4), NAN)
    samples[:, :2] = 0.0
    samples[20:, 0], samples[20:, 1] = -400.0, 800.0
    samples[30, :2] = 100.0
    out = vote_samples(samples, **SLOW, channels=2, tie_break=[])
    assert (out.decided_by[27:] == DecidedBy.UNRESOLVED).all()
    assert out.voted[30:] == pytest.approx(np.full(10, 100.0))
