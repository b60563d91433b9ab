"""Examples by hand of the monitor's later rules: the freeze, who is asked first, the vote that is held.

Frames are counted from 1 as in the requirement. Defaults: threshold 1, persistence 8, singular persistence 10.
"""

from typing import Any

import numpy as np
import pytest
from conftest import Voted, constant, rows, vote_samples
from numpy.typing import NDArray

from rig.frame import Ilm, Pattern, Resolver, State

NAN = np.nan
GOOD, BAD, ABSENT = Ilm.GOOD, Ilm.BAD, Ilm.ABSENT
SPLIT, NOISY = (0, 0.5, 5, 5.1), (0, 1.2, 5, 5.1)  # 2:2, and the 1:1:2 that noise makes of it
APART = (-9, -3, 3, 9)


# The freeze after a singular run.


@pytest.mark.requirement("redundancy", "counts stand still after a singular run, as long as it was")
@pytest.mark.parametrize(("run", "still"), [(3, 3), (9, 9), (30, 10)])
def test_after_a_singular_run_the_counts_stand_still_for_as_long_up_to_the_singular_persistence(run: int, still: int):
    out = vote_samples(rows((run, SPLIT), (30, NOISY)), resolvers=[])
    assert out.failed_at() == [run + still + 8] * 2 + [None] * 2
    assert (out.state[run:, :2] != State.OK).all()


@pytest.mark.requirement("redundancy", "counts stand still after a singular run, as long as it was")
def test_noise_that_splits_a_pair_of_a_two_to_two_again_and_again_fails_nobody():
    out = vote_samples(rows(*[(3, SPLIT), (3, NOISY)] * 10))
    assert out.failed_at() == [None] * 4


def test_a_freeze_is_the_larger_of_what_is_left_of_it_and_the_new_run():
    """Eight frames, of which two pass, then a run of one: six are left, neither one nor seven."""
    out = vote_samples(rows((8, SPLIT), (2, NOISY), (1, SPLIT), (30, NOISY)))
    assert out.failed_at()[:2] == [8 + 2 + 1 + 6 + 8] * 2


def test_a_run_of_any_mix_of_singular_patterns_counts_as_one():
    out = vote_samples(rows((3, APART), (4, SPLIT), (30, NOISY)), resolvers=[])
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


def failed_and_by(out: Voted) -> tuple[list[int], Resolver]:
    """The channels failed at the tenth frame, and who decided it."""
    return [c for c, k in enumerate(out.failed_at(), 1) if k == 10], Resolver(int(out.resolver[9]))


def test_by_default_the_reference_is_asked_before_the_trend():
    assert failed_and_by(vote_samples(RISING, reference=RISE)) == ([3, 4], Resolver.REFERENCE)
    assert failed_and_by(vote_samples(RISING)) == ([1, 2], Resolver.TREND)


def test_by_default_the_monitors_are_asked_before_the_reference():
    out = vote_samples(RISING, reference=RISE, ilm=flags(*HIGH_GOOD))
    assert failed_and_by(out) == ([1, 2], Resolver.ILM)


def test_the_trend_byte_is_eight_frames_long_and_unusable_before():
    out = vote_samples(RISING)
    assert (out.resolver[:8] == Resolver.UNRESOLVED).all() and (out.resolver[8:10] == Resolver.TREND).all()
    assert (out.trend_high[8:10] == 0xFF).all() and out.trend_low[7] == 0x7F


@pytest.mark.parametrize(("four", "vote"), [(LOW_GOOD, 0.25), (HIGH_GOOD, 5.05)])
def test_the_vote_is_the_mean_of_the_pair_that_is_kept(four: tuple[Ilm, ...], vote: float):
    assert vote_samples(constant(*SPLIT), ilm=flags(*four)).voted == pytest.approx(np.full(30, vote))


@pytest.mark.parametrize(("samples", "four"), [(APART, (GOOD, BAD, BAD, BAD)), (SPLIT, HIGH_GOOD)])
def test_monitors_that_are_not_configured_are_not_asked(samples: tuple[float, ...], four: tuple[Ilm, ...]):
    out = vote_samples(constant(*samples), ilm=flags(*four), resolvers=["reference"])
    assert (out.resolver == Resolver.UNRESOLVED).all() and out.failed_at() == [None] * 4


@pytest.mark.parametrize(("samples", "resolvers"), [(APART, ["middle", "trend"]), (SPLIT, ["extremes", "middle"])])
def test_nor_is_a_reference(samples: tuple[float, ...], resolvers: list[str]):
    out = vote_samples(constant(*samples, frames=8), reference=np.full(8, samples[0]), resolvers=resolvers)
    assert (out.resolver == Resolver.UNRESOLVED).all()


# 1:1:1:1 and 1:1:1.


@pytest.mark.requirement("redundancy", "1:1:1:1 and 1:1:1 by in-line monitors and reference first")
@pytest.mark.parametrize("good", [1, 2, 3, 4])
def test_the_one_channel_whose_monitor_says_good_is_kept_of_four_apart(good: int):
    one = [GOOD if c == good else BAD for c in range(1, 5)]
    out = vote_samples(constant(*APART), ilm=flags(*one))
    assert failed_and_by(out) == ([c for c in range(1, 5) if c != good], Resolver.ILM)
    assert (out.voted == APART[good - 1]).all()
    assert (out.pattern[:10] == Pattern.P1_1_1_1).all() and (out.pattern[10:] == Pattern.NORMAL).all()
    assert (out.level[10:] == 1).all()


@pytest.mark.parametrize(
    "four", [(GOOD, BAD, BAD, ABSENT), (ABSENT, BAD, BAD, BAD), (GOOD, GOOD, BAD, BAD), (BAD,) * 4, (GOOD,) * 4]
)
def test_monitors_that_do_not_single_out_one_channel_give_no_answer(four: tuple[Ilm, ...]):
    out = vote_samples(constant(*APART, frames=12), ilm=flags(*four, frames=12))
    assert failed_and_by(out) == ([1, 4], Resolver.EXTREMES)
    assert (out.voted[:10] == 0).all()


@pytest.mark.requirement("redundancy", "1:1:1:1 and 1:1:1 by in-line monitors and reference first")
@pytest.mark.parametrize(("reference", "good"), [(9.9, 4), (-9.5, 1), (2.5, 3), (10.0, 4)])
def test_the_only_sample_within_the_reference_threshold_is_kept_of_four_apart(reference: float, good: int):
    out = vote_samples(constant(*APART), reference=np.full(30, reference))
    assert failed_and_by(out) == ([c for c in range(1, 5) if c != good], Resolver.REFERENCE)
    assert (out.voted[:10] == APART[good - 1]).all()


@pytest.mark.parametrize(("reference", "threshold"), [(0.0, 1.0), (10.0005, 1.0), (0.0, 3.0), (6.0, 3.0)])
def test_a_reference_near_none_or_two_of_them_gives_no_answer(reference: float, threshold: float):
    samples, references = constant(*APART, frames=12), np.full(12, reference)
    out = vote_samples(samples, reference=references, reference_threshold=threshold)
    assert failed_and_by(out) == ([1, 4], Resolver.EXTREMES)


@pytest.mark.parametrize(("first", "failed"), [("ilm", [2, 3, 4]), ("reference", [1, 2, 3])])
def test_four_apart_are_settled_in_the_configured_order_extremes_last(first: str, failed: list[int]):
    order = ["extremes", first, *({"ilm", "reference"} - {first})]
    given: dict[str, Any] = {"ilm": flags(GOOD, BAD, BAD, BAD), "reference": np.full(30, 9.0)}
    out = vote_samples(constant(*APART), resolvers=order, **given)
    assert failed_and_by(out) == (failed, Resolver[first.upper()])


@pytest.mark.parametrize(
    ("given", "failed", "by"),
    [
        ({"ilm": flags(GOOD, BAD, BAD, GOOD)}, [2, 3], Resolver.ILM),
        ({"reference": np.full(30, 8.5)}, [1, 2], Resolver.REFERENCE),
        ({}, [1, 3], Resolver.MIDDLE),
        ({"reference": np.full(30, 8.5), "resolvers": ["middle", "trend", "ilm"]}, [1, 3], Resolver.MIDDLE),
    ],
)
def test_three_apart_are_settled_by_monitors_and_reference_before_the_middle(
    given: dict[str, Any], failed: list[int], by: Resolver
):
    out = vote_samples(constant(-9, 3, 9, NAN), channels=3, **given)
    assert failed_and_by(out) == (failed, by)
    (kept,) = {1, 2, 3} - set(failed)
    assert (out.voted[:10] == (-9, 3, 9)[kept - 1]).all()


@pytest.mark.requirement("redundancy", "extremes and middle may be left out")
@pytest.mark.parametrize("samples", [APART, (-9, 3, 9, NAN)])
def test_without_extremes_and_middle_nobody_is_failed(samples: tuple[float, ...]):
    channels = int(np.isfinite(samples).sum())
    together = tuple(np.where(np.isfinite(samples), 0.5, NAN))
    frames = rows((2, together), (28, samples))
    for left in (["ilm", "reference", "trend"], ["trend", "middle" if channels == 4 else "extremes"]):
        out = vote_samples(frames, channels=channels, resolvers=left)
        assert (out.state[:, :channels] != State.FAILED).all()
        assert (out.resolver[2:] == Resolver.UNRESOLVED).all()
        assert (out.voted == 0.5).all()


def test_an_answer_after_the_count_is_reached_decides_at_once():
    references = rows((14, NAN), (16, 9.0))
    out = vote_samples(constant(*APART), reference=references, resolvers=["reference"])
    assert out.failed_at() == [15, 15, 15, None]


# The vote of an unresolved pattern.


@pytest.mark.requirement("redundancy", "an unresolved vote does not take half of the jump")
def test_the_unresolved_vote_does_not_take_half_of_the_faults_jump_with_it():
    out = vote_samples(rows((5, (0, 0, 0, 0)), (25, (0, 0, 5, 5))), resolvers=[])
    assert (out.resolver[5:] == Resolver.UNRESOLVED).all()
    assert (out.voted == 0).all()


def test_after_its_first_frame_the_unresolved_vote_follows_the_mean_change_of_the_ranks():
    low, high = 0.2 * np.arange(20), 5 + 0.4 * np.arange(20)
    split = np.stack([low, low, high, high], axis=1)
    out = vote_samples(np.concatenate([constant(0, 0, 0, 0, frames=5), split]), resolvers=[])
    assert np.allclose(out.voted[5:], 0.3 * np.arange(20))


@pytest.mark.parametrize("then", [(-9, 0, 3, 9), (0, NAN, NAN, 5), (-5, 0, 5, NAN)])
def test_nor_the_jump_to_another_pattern_or_number_of_samples(then: tuple[float, ...]):
    out = vote_samples(rows((5, (0, 0, 0, 0)), (3, (0, 0, 5, 5)), (3, then)), resolvers=[])
    assert (out.resolver[5:] == Resolver.UNRESOLVED).all()
    assert (out.voted == 0).all()


@pytest.mark.parametrize(("samples", "vote"), [((-9, 1, 9, NAN), 1.0), ((0, 5, NAN, NAN), 2.5), (APART, 0.0)])
def test_in_the_first_frame_of_all_the_unresolved_vote_is_the_mean_of_the_middle_ranks(
    samples: tuple[float, ...], vote: float
):
    out = vote_samples(rows((3, samples)), resolvers=[])
    assert out.voted.tolist() == [vote] * 3


def test_an_unresolved_vote_whose_change_overflows_holds():
    limit = 1.79e308
    low, high = (-1.7e308, -1.7e308, 0, 0), (1e308, 1e308, 1.7e308, 1.7e308)
    with np.errstate(over="ignore"):
        out = vote_samples(rows((2, low), (2, high)), resolvers=[], limits=(-limit, limit))
    assert out.voted.tolist() == [-0.85e308] * 4
