"""The reference's own monitor, what extremes leave, references beyond the range, sources in dispute: by hand.

Frames are counted from 1 as in the requirement. Defaults: threshold 1, persistence 8, split persistence 10.
"""

from typing import Any

import numpy as np
import pytest
from conftest import Voted, constant, rows, vote_samples
from numpy.typing import NDArray
from one_stage import step_stage

from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.managers import Manager
from rig.core.frame import DecidedBy, Ilm, Pattern, State, new_block

NAN = np.nan
LOST = [State.FAILED] * 4


# Section 7: it is compared with the two voting ranks.


@pytest.mark.requirement("redundancy", "a reference is compared with the two voting ranks")
@pytest.mark.parametrize(
    ("samples", "reference", "usable"),
    [
        ((0, 0, 0.8, 0.8), 0.0, True),  # the vote is 0.4 off
        ((0, 0, 0.8, 0.8), 0.8, True),
        ((0, 0, 0.8, 0.8), 0.95, True),
        ((0, 0, 0.8, 0.8), -0.25, False),
        ((0, 0, 0.8, 0.8), 0.4, False),  # on the vote, and near neither
        ((0, 0.7, 0.8, 0.9), 0.0, False),  # on the smallest, which is no voting rank
        ((0, 0.8, NAN, NAN), 0.0, True),
        ((0, 0.8, NAN, NAN), 1.1, False),
        ((0, 0.5, 0.9, NAN), 0.5, True),
        ((0, 0.5, 0.9, NAN), 0.9, False),
    ],
)
def test_a_reference_near_one_of_the_voting_ranks_stays_usable(
    samples: tuple[float, ...], reference: float, usable: bool
):
    channels = int(np.isfinite(samples).sum())
    out = vote_samples(constant(*samples), channels=channels, reference=reference, reference_threshold=0.2)
    assert out.reference_usable[6] == 1 and bool(out.reference_usable[7]) is usable


def test_the_ranks_of_an_angle_are_near_it_the_short_way_round():
    angle: dict[str, Any] = {"wraps": True, "limits": (-np.pi, np.pi), "threshold": 0.2, "reference_threshold": 0.05}
    samples = constant(3.1, 3.1, -3.08, -3.08)  # 0.103 apart
    assert (vote_samples(samples, reference=-3.05, **angle).reference_usable == 1).all()
    assert vote_samples(samples, reference=-3.0, **angle).reference_usable[7] == 0


@pytest.mark.requirement("redundancy", "a reference is compared with the two voting ranks")
@pytest.mark.parametrize("channels", [2, 4])
def test_a_slow_fault_of_half_the_channels_is_settled_by_the_reference_that_it_leaves(channels: int):
    """0.01 a frame on channels in use; the reference is within 0.2 of the others, the vote was not."""
    drift = 0.01 * np.arange(200)
    faulty = np.arange(4) >= channels // 2
    samples = np.where(faulty, drift[:, None], 0.0)
    samples[:, channels:] = NAN
    out = vote_samples(samples, channels=channels, reference=0.0, reference_threshold=0.2)
    at = 102 + 9  # 1.01 in the 102nd frame
    assert out.failed_at() == [at if faulty[c] and c < channels else None for c in range(4)]
    assert out.decided_by[at - 1] == DecidedBy.REFERENCE and (out.reference_usable == 1).all()


def test_a_reference_is_trusted_again_when_it_has_been_near_a_rank_as_long():
    out = vote_samples(constant(0, 0, 0.8, 0.8), reference=rows((8, 5.0), (22, 0.75)), reference_threshold=0.2)
    assert np.flatnonzero(out.reference_usable == 0).tolist() == list(range(7, 15))


# Beyond the range.


@pytest.mark.requirement("redundancy", "a reference beyond the range is at its end")
@pytest.mark.parametrize("side", [1, -1])
def test_sensors_at_their_stop_do_not_contradict_references_beyond_it(side: int):
    samples = side * constant(2.0, 2.0, 1.9, 2.0)
    given: dict[str, Any] = {"limits": (-2.0, 2.0), "reference": side * 9.0, "second": side * 8.0}
    out = vote_samples(samples, common=(5, True), **given)
    assert (out.reference_usable == 1).all() and not out.common_mode.any() and out.failed_at() == [None] * 4
    beyond = vote_samples(samples, common=(5, True), **{**given, "limits": (-9.0, 9.0)})
    assert beyond.common_mode.any() and beyond.failed_at() == [5] * 4


def test_a_last_channel_at_its_stop_is_not_disputed_by_what_is_beyond_it():
    samples = rows((30, (NAN, NAN, NAN, 2.0)))
    out = vote_samples(samples, reference=9.0, limits=(-2.0, 2.0))
    assert out.failed_at() == [8, 8, 8, None] and (out.state[:, 3] == State.OK).all()


def test_of_a_split_the_vote_is_never_a_reference_beyond_the_range():
    out = vote_samples(constant(0, 0.1, 5, 5), reference=90.0, limits=(-5.0, 5.0), tie_break=["reference"])
    assert (out.voted[:10] == 5.0).all() and out.failed_at() == [10, 10, None, None]


@pytest.mark.parametrize("reference", [np.inf, -np.inf, NAN])
def test_what_is_no_number_is_no_reference_at_the_stop_either(reference: float):
    out = vote_samples(constant(2, 2, 2, 2), reference=reference, limits=(-2.0, 2.0))
    assert (out.reference_usable == 0).all()


def test_an_angle_goes_round_its_range():
    angle: dict[str, Any] = {"wraps": True, "limits": (0.0, 2 * np.pi), "threshold": 0.2}
    out = vote_samples(constant(0.1, 0.1, 0.1, 0.1), reference=2 * np.pi + 0.1, reference_threshold=0.1, **angle)
    assert (out.reference_usable == 1).all()


# Section 8, item 1: the pair that extremes leave.

LEFT = (0.0, 1.5, 20.0, -20.0)  # of four apart 3 and 4 are failed at frame 10
PAIR: dict[str, Any] = {"threshold_duplex": 2.0, "tie_break": ["trend", "extremes"]}  # then these agree


def left(reference: Any, *, frames: int = 40, samples: tuple[float, ...] = LEFT, **more: Any) -> Voted:
    """The reference, a value or a column from the eleventh row on, beside the pair that extremes leave."""
    references = np.full(frames, NAN)
    references[10:] = reference
    return vote_samples(constant(*samples, frames=frames), reference=references, **{**PAIR, **more})


@pytest.mark.requirement("redundancy", "a pair that extremes leave may be cut")
@pytest.mark.parametrize(
    ("reference", "at"),
    [
        (9.0, 18),
        (-9.0, 18),
        (3.6, 18),  # 2.1 off the nearer, more than 1.5 reference thresholds and than what two agree within
        (3.4, None),  # 1.9
        (-1.9, None),
        (0.75, None),
        (NAN, None),
    ],
)
def test_a_reference_off_both_of_the_pair_cuts_it(reference: float, at: int | None):
    out = left(reference)
    assert out.failed_at() == [at, at, 10, 10]
    if at:
        assert out.decided_by[at - 1] == DecidedBy.REFERENCE and out.pattern[at - 1] == Pattern.NORMAL
        assert out.level[at - 1] == 0 and (out.reference_usable[10:] == 1).all() and out.voted[-1] == 0.75


def test_one_and_a_half_reference_thresholds_are_the_limit_where_they_are_more():
    assert left(4.4, reference_threshold=2.0).failed_at()[0] is None  # 2.9 off
    assert left(4.6, reference_threshold=2.0).failed_at()[0] == 18


@pytest.mark.parametrize("between", [0.0, NAN])
def test_every_other_frame_begins_the_count_again(between: float):
    references = np.full(30, 9.0)
    references[4] = between  # row 15
    assert left(references).failed_at() == [23, 23, 10, 10]
    silent = constant(*LEFT, frames=40)
    silent[14, 0] = NAN
    references = rows((10, NAN), (30, 9.0))
    assert vote_samples(silent, reference=references, **PAIR).failed_at() == [23, 23, 10, 10]


def test_such_a_pair_does_not_judge_the_reference():
    out = left(3.4, reference_threshold=0.1)  # within what two agree, so the pair is not cut
    assert out.failed_at() == [None, None, 10, 10] and (out.reference_usable[10:] == 1).all()


def test_nor_is_a_reference_that_was_set_aside_before_used():
    samples = rows((8, (0, 0, 0, 0)), (40, LEFT))
    out = vote_samples(samples, reference=9.0, **PAIR)
    assert out.failed_at() == [None, None, 18, 18] and (out.reference_usable[7:] == 0).all()


def test_a_pair_left_by_two_failures_is_not_under_suspicion():
    samples = rows((20, (0.0, 0.5, 0.0, 0.0)), (40, (0.0, 1.5, NAN, NAN)))
    out = vote_samples(samples, reference=9.0, **PAIR)
    assert out.failed_at() == [None, None, 28, 28] and (out.reference_usable[8:] == 0).all()


def test_the_suspicion_ends_when_a_channel_comes_back():
    """The fourth is readmitted in row 41: the reference is monitored from that row on, and set aside in the 48th."""
    samples = constant(*LEFT, frames=60)
    samples[12:, 3] = 0.75
    references = np.full(60, NAN)
    references[40:] = 9.0
    out = vote_samples(samples, reference=references, readmit_frames=10, resets=[(40, 4)], **PAIR)
    assert out.level[40] == 3 and out.failed_at()[:2] == [None, None]
    assert np.flatnonzero(out.reference_usable[40:] == 0)[0] == 7


APPROACH = 0.1 * np.arange(1.0, 31)[:, None] * [1, -1, 0, 0] + (0, 9, 20, -20)


@pytest.mark.requirement("redundancy", "a pair that extremes leave may be cut")
def test_a_pair_that_moves_towards_each_other_is_wrong_on_both_sides():
    """Two remain from frame 11 on; eight changes are seen in the 19th, which speak for all since the 12th."""
    out = vote_samples(APPROACH, tie_break=["trend", "extremes"])
    assert (out.decided_by[10:18] == DecidedBy.UNRESOLVED).all() and (out.decided_by[18:20] == DecidedBy.TREND).all()
    assert out.failed_at() == [20, 20, 10, 10] and out.voted[18:20] == pytest.approx([4.5, 4.5])


def test_of_any_other_pair_the_trend_says_nothing_then():
    out = vote_samples(np.where(np.arange(4) < 2, APPROACH, NAN), channels=2, tie_break=["trend"])
    assert (out.decided_by == DecidedBy.UNRESOLVED).all() and (out.trend_high[8:] == 0).all()
    assert (out.trend_low[8:] == 255).all()


def test_nor_of_a_pair_that_moves_apart():
    apart = 0.1 * np.arange(1.0, 31)[:, None] * [-1, 1, 0, 0] + (0, 9, 20, -20)
    out = vote_samples(apart, tie_break=["trend", "extremes"])
    assert out.failed_at() == [None, None, 10, 10] and (out.decided_by[10:] == DecidedBy.UNRESOLVED).all()


# Sources in dispute.


def told(first: Any, second: Any, teller: Any, teller_second: Any = NAN, frames: int = 40, common: int = 5) -> Any:
    """Two signals at 0 with two references each, by frame; those of the first read the second signal."""
    params = np.zeros(2, PARAMS)
    for row in params:
        fill(row, SignalConfig(threshold=1.0), (-1000.0, 1000.0), 4, False, 100.0)
        row["common_persistence"], row["second_threshold"] = common, 1.0
    params["tells"], params["sources"] = [0, 2], [2, 0]
    block = new_block(frames)
    block["channels"] = 0.0
    block["valid"], block["ilm"] = 1, Ilm.ABSENT
    block["reference"], block["second_reference"] = NAN, NAN
    for name, s, values in (
        ("reference", 0, first),
        ("second_reference", 0, second),
        ("reference", 1, teller),
        ("second_reference", 1, teller_second),
    ):
        block[name][:, s] = values
    manager = Manager("cross-channel", params)
    for k in range(frames):
        step_stage(manager, block, k)
    return block


def common_from(block: Any) -> int | None:
    flags = block["common_mode"][:, 0]
    return int(np.argmax(flags)) + 1 if flags.any() else None


def since(row: int, value: float, before: float = 0.0, frames: int = 40) -> NDArray[np.float64]:
    return rows((row - 1, before), (frames - row + 1, value))


@pytest.mark.requirement("redundancy", "two references count as two while what they read is in order")
def test_no_contradiction_begins_while_a_source_is_in_dispute():
    """The source's own reference is off from frame 1, set aside in the 8th; both others speak from the 9th on."""
    both = since(9, 5.0)
    assert common_from(told(both, both, 0.0)) == 13
    assert common_from(told(both, both, 5.0)) is None
    assert common_from(told(since(8, 5.0), since(8, 5.0), 5.0)) == 12  # as of the end of the last frame


def test_one_that_has_begun_goes_on():
    both = since(5, 5.0)
    block = told(both, both, 5.0, common=10)
    assert block["reference_usable"][13, 1] == 0 and common_from(block) == 14
    gap = both.copy()
    gap[11] = 0.0  # and does not begin again
    assert common_from(told(gap, gap, 5.0, common=10)) is None


@pytest.mark.parametrize(("off", "at"), [(1.6, None), (1.4, 13)])
def test_a_second_reference_off_its_vote_for_its_persistence_is_a_dispute_too(off: float, at: int | None):
    both = since(9, 5.0)
    assert common_from(told(both, both, 0.0, off)) == at
    assert common_from(told(both, both, NAN, np.where(np.arange(40) == 3, 0.0, 1.6))) == 13  # five frames in a row only


def test_a_dispute_ends_with_the_second_reference():
    both = since(9, 5.0)
    assert common_from(told(both, both, NAN, np.where(np.arange(40) < 20, 5.0, 0.0))) == 26  # seen from the 22nd on


def test_a_signal_without_others_that_read_it_disputes_nothing():
    both = since(9, 5.0)
    block = told(0.0, 0.0, both, both)
    flags = block["common_mode"][:, 1]
    assert int(np.argmax(flags)) + 1 == 13
