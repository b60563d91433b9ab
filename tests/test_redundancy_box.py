"""A channel that is out on several signals at once is a box that died."""

from typing import Any

import numpy as np
import pytest
from one_stage import step_stage

from rig.computer.redundancy.config import PARAMS, SignalConfig, fill
from rig.computer.redundancy.managers import Manager
from rig.frame import Ilm, Pattern, Resolver, S, State, new_block

FRAMES = 30


def fly(
    samples: Any,
    *,
    reference: Any = None,
    fitted: int = 4,
    box_signals: int = 4,
    box_persistence: int = 8,
    fade_s: float = 0.0,
) -> Any:
    """``samples`` (S, 4), the same in every frame, through the manager; threshold 1, persistence 8, singular 10."""
    params = np.zeros(S, PARAMS)
    for row in params:
        fill(row, SignalConfig(threshold=1.0, fade_s=fade_s), (-1000.0, 1000.0), fitted, False, 100.0)
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
    assert (block["resolver"][7, 4:] == Resolver.BOX).all()


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
    assert not (block["resolver"] == Resolver.BOX).any()


@pytest.mark.requirement("redundancy", "a box that is out on four signals is out on all")
def test_an_accused_majority_is_not_believed():
    """Three channels each off on other signals: five signals accuse each, nobody is failed as a box."""
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


def test_contradicting_evidence_fails_nobody():
    """Half of the references speak for one pair, half for the other."""
    reference = np.where(np.arange(S) < 8, 0.0, 5.0)
    block = fly(apart(S, 2, 3), reference=reference)
    assert not (block["resolver"] == Resolver.BOX).any()


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
