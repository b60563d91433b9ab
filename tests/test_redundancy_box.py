"""A channel that is out on several signals at once is a failed LRU."""

from typing import Any

import numpy as np
import pytest
from one_stage import step_stage

from rig.computer.redundancy.box import MOST_BOXES, box_of_signals
from rig.computer.redundancy.manager_config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.managers import Manager
from rig.core.frame import SIGNALS, DecidedBy, Ilm, Pattern, S, State, new_block

FRAMES = 30


def fly(
    samples: Any,
    *,
    reference: Any = None,
    fitted: int = 4,
    box_signals: int | None = 4,
    box_persistence: int = 8,
    fade_s: float = 0.0,
    boxes: Any = 1,
) -> Any:
    """``samples`` (S, 4) or (FRAMES, S, 4) through the manager; threshold 1, persistence 8, split 10."""
    params = np.zeros(S, PARAMS)
    for row in params:
        fill(row, SignalConfig(threshold=1.0, fade_s=fade_s), (-1000.0, 1000.0), fitted, False, 100.0)
    params["box"] = boxes
    block = new_block(FRAMES)
    block["channels"] = samples
    block["valid"], block["ilm"] = 1, Ilm.ABSENT
    block["reference"] = np.nan if reference is None else reference
    manager = Manager("cross-channel", params, box_signals=box_signals, box_persistence=box_persistence)
    for k in range(FRAMES):
        step_stage(manager, block, k)
    return block


def apart(signals: int, *channels: int, off: float = 5.0) -> Any:
    """All at 0, but ``channels`` (from 0) off on the first ``signals`` signals."""
    samples = np.zeros((S, 4))
    samples[:signals, list(channels)] = off
    return samples


def failed_at(block: Any, s: int) -> list[int | None]:
    failed = block["state"][:, s] == State.FAILED
    return [int(np.argmax(column)) + 1 if column.any() else None for column in failed.T]


@pytest.mark.requirement("redundancy", "a box that is out on four signals is out on all")
def test_a_channel_off_on_four_signals_is_failed_on_all_at_its_eighth_frame():
    block = fly(apart(4, 2))
    assert all(failed_at(block, s) == [None, None, 8, None] for s in range(S))
    assert (block["level"][7:] == 3).all() and (block["level"][:7] == 4).all()
    assert (block["decided_by"][7, 4:] == DecidedBy.BOX).all()


def test_three_signals_are_three_faults_and_no_box():
    block = fly(apart(3, 2))
    assert all(failed_at(block, s) == [None, None, 8, None] for s in range(3))
    assert all(failed_at(block, s) == [None] * 4 for s in range(3, S))


@pytest.mark.requirement("redundancy", "a box that is out on four signals is out on all")
def test_two_boxes_that_die_together_are_identified_by_the_signals_with_evidence():
    """2:2 on all signals, references on four of them: the others are settled by the boxes, before the trend answers."""
    reference = np.full(S, np.nan)
    reference[:4] = 0.0
    block = fly(apart(S, 2, 3, off=-5.0), reference=reference)  # the trend of constant pairs would keep the smaller
    assert all(failed_at(block, s) == [None, None, 8, 8] for s in range(S))
    assert (block["voted"][8:] == 0.0).all()
    assert (block["pattern"][:8] == Pattern.P2_2).all()


def test_the_trend_is_no_evidence_against_a_box():
    block = fly(apart(S, 2, 3, off=-5.0))
    assert all(failed_at(block, s) == [10, 10, None, None] for s in range(S))
    assert not (block["decided_by"] == DecidedBy.BOX).any()


@pytest.mark.requirement("redundancy", "a box that is out on four signals is out on all")
def test_an_accused_majority_does_not_decide():
    """Three channels each off on other signals: five signals accuse each, none is failed as a box."""
    samples = np.zeros((S, 4))
    for c in range(3):
        samples[5 * c : 5 * c + 5, c] = 5.0
    block = fly(samples)
    assert failed_at(block, S - 1) == [None] * 4
    assert all(failed_at(block, 5 * c)[c] == 8 for c in range(3))


def test_nor_are_two_of_three():
    samples = np.zeros((S, 4))
    for c in range(2):
        samples[5 * c : 5 * c + 5, c] = 5.0
    block = fly(samples, fitted=3)
    assert failed_at(block, S - 1) == [None] * 4
    assert all(failed_at(block, 5 * c)[c] == 8 for c in range(2))


def test_contradicting_evidence_fails_no_channel():
    """Half of the references speak for one pair, half for the other."""
    reference = np.where(np.arange(S) < 8, 0.0, 5.0)
    block = fly(apart(S, 2, 3), reference=reference)
    assert not (block["decided_by"] == DecidedBy.BOX).any()


def test_one_of_two_boxes_is_identified_by_its_evidence():
    reference = np.where(np.arange(S) < 5, 0.0, np.nan)
    block = fly(apart(S, 1, off=-5.0), reference=reference, fitted=2)
    assert all(failed_at(block, s)[:2] == [None, 8] for s in range(S))


def test_a_transient_on_all_signals_is_no_box():
    params = np.zeros(S, PARAMS)
    for row in params:
        fill(row, SignalConfig(threshold=1.0), (-1000.0, 1000.0), 4, False, 100.0)
    block = new_block(FRAMES)
    block["valid"], block["ilm"], block["reference"] = 1, Ilm.ABSENT, np.nan
    block["channels"][10:17, :, 1] = 5.0  # seven frames
    manager = Manager("cross-channel", params, box_signals=4, box_persistence=8)
    for k in range(FRAMES):
        step_stage(manager, block, k)
    assert not (block["state"] == State.FAILED).any()


@pytest.mark.parametrize(("signals", "persistence", "at"), [(2, 3, 3), (16, 5, 5), (0, 3, None)])
def test_how_many_signals_and_how_long_is_chosen(signals: int, persistence: int, at: int | None):
    block = fly(apart(2 if signals == 2 else S, 3), box_signals=signals, box_persistence=persistence)
    last = failed_at(block, S - 1)[3]
    assert last == (8 if at is None else at)


def test_where_a_box_agreed_with_the_others_the_vote_fades_from_the_next_frame_on():
    samples = apart(4, 0)
    samples[S - 1] = 0.0, 0.6, 0.8, 0.9  # 0.7 of four, 0.8 of the last three
    voted = fly(samples, fade_s=0.05)["voted"][:, S - 1]
    assert voted[:8] == pytest.approx(np.full(8, 0.7))
    assert voted[8:15] == pytest.approx(0.8 - 0.1 * np.array([5, 4, 3, 2, 1, 0, 0]) / 6)


# Several boxes: four signals are in the first, seven in the second, one in the third, four in none.

BOXES = [1] * 4 + [2] * 7 + [3] + [0] * 4


def off_on(*signals: int, channel: int = 2) -> Any:
    samples = np.zeros((S, 4))
    samples[list(signals), channel] = 5.0
    return samples


def failed_by_box(block: Any, c: int = 2) -> list[int]:
    """The signals on which a channel has been failed as a box, in frame 3."""
    return np.flatnonzero(block["state"][2, :, c] == State.FAILED).tolist()


def fly_boxes(samples: Any, box_signals: int | None = None) -> Any:
    return fly(samples, box_signals=box_signals, box_persistence=3, boxes=BOXES)


@pytest.mark.requirement("redundancy", "a box that is out on more than half of its signals is out on all")
@pytest.mark.parametrize(
    ("off", "failed"),
    [
        ([0, 1, 2], [0, 1, 2, 3]),
        ([0, 1], []),
        ([4, 5, 6, 7], list(range(4, 11))),
        ([4, 5, 6], []),
        ([0, 1, 2, 4, 5, 6, 7], list(range(11))),
        ([0, 1, 4, 5, 6, 11, 12, 13, 14, 15], []),  # none of them half
    ],
)
def test_a_box_dies_by_its_own_signals_and_on_its_own(off: list[int], failed: list[int]):
    block = fly_boxes(off_on(*off))
    assert failed_by_box(block) == failed
    assert (block["decided_by"][2, failed] == DecidedBy.BOX).all() and (block["level"][2, failed] == 3).all()
    assert (block["level"][2, np.setdiff1d(np.arange(S), failed)] == 4).all()


@pytest.mark.parametrize(
    ("needed", "off", "failed"),
    [
        (2, [0, 1], [0, 1, 2, 3]),
        (5, [0, 1, 2, 3], [0, 1, 2, 3]),  # no box needs more than it has
        (5, [4, 5, 6, 7], []),
        (5, [4, 5, 6, 7, 8], list(range(4, 11))),
        (1, [11], []),  # one signal is no box
        (1, [12, 13, 14, 15], []),  # nor are those in none
        (0, list(range(S)), []),
    ],
)
def test_a_number_that_is_given_is_that_of_every_box(needed: int, off: list[int], failed: list[int]):
    assert failed_by_box(fly_boxes(off_on(*off), needed)) == failed


@pytest.mark.requirement("redundancy", "a box that is out on more than half of its signals is out on all")
def test_an_accused_majority_in_one_box_does_not_save_another():
    """Of the first box three channels are silent on three signals each, of the second one."""
    samples = off_on(4, 5, 6, 7)
    samples[:3, :3] = np.nan
    block = fly_boxes(samples)
    assert failed_by_box(block) == list(range(4, 11))
    assert [failed_by_box(block, c) for c in (0, 1, 3)] == [[], [], []]


def test_the_count_of_a_box_begins_again_where_too_few_accuse_whatever_others_do():
    samples = np.tile(off_on(0, 1, 2, 4, 5, 6, 7), (FRAMES, 1, 1))
    samples[1, 0] = 0.0  # two of four in the second frame
    block = fly_boxes(samples)
    assert failed_by_box(block) == list(range(4, 11))
    assert failed_at(block, 3)[2] == 5


@pytest.mark.parametrize(
    ("boxes", "says"),
    [
        ({"air": ["pitch_rat"]}, "air: unknown signal"),
        ({"air": ["pitch_rate"], "rates": ["pitch_rate"]}, "pitch_rate is in two boxes, air and rates"),
        ({"air": ["pitch_rate"]}, "in no box; each signal is in one of air"),
        ({f"b{i}": [] for i in range(MOST_BOXES + 1)}, f"at most {MOST_BOXES} boxes, got {MOST_BOXES + 1}"),
    ],
)
def test_each_signal_is_in_one_box(boxes: dict[str, list[str]], says: str):
    with pytest.raises(ValueError, match=says):
        box_of_signals(boxes, [signal.name for signal in SIGNALS])


def test_signals_are_numbered_by_their_boxes_and_all_in_one_where_none_are_named():
    assert box_of_signals({"x": ["b", "c"], "y": ["a"]}, ["a", "b", "c"]) == [2, 1, 1]
    assert box_of_signals({}, ["a", "b", "c"]) == [1, 1, 1]
