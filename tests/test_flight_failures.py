"""Failures of channels, found in the rows: once each, with the frame and the rule."""

import numpy as np
import pytest

from rig.core.frame import DISCRETE_INDEX, INDEX, Block, DecidedBy, State, new_block
from rig.flight.failures import Failure, became_failed, decisive_s, failures, who_failed

Q, GEAR = INDEX["pitch_rate"], DISCRETE_INDEX["gear_down"]


def blank(frames: int = 30, first: int = 0) -> Block:
    rows = new_block(frames, first)
    rows["valid"] = 1
    return rows


def test_a_failure_names_channel_frame_and_rule():
    rows = blank(first=100)
    rows["state"][12:, Q, 2] = State.FAILED
    rows["decided_by"][12, Q] = DecidedBy.TREND
    rows["discrete_state"][5:, GEAR, 0] = State.FAILED
    assert failures(rows) == [Failure(105, "gear_down", 1, "comparison"), Failure(112, "pitch_rate", 3, "trend")]


def test_a_channel_that_is_readmitted_can_fail_again():
    rows = blank()
    rows["state"][[3, 4, 9], Q, 1] = State.FAILED
    assert [failure.frame for failure in failures(rows)] == [3, 9]


@pytest.mark.parametrize(("decided_by", "by"), [(DecidedBy.NONE, "comparison"), (DecidedBy.UNRESOLVED, "comparison")])
def test_a_rule_that_did_not_decide_is_not_named(decided_by: DecidedBy, by: str):
    rows = blank(1)
    rows["decided_by"][0, Q] = decided_by
    assert who_failed(rows[0], Q, 0) == by


def test_a_channel_that_cannot_be_compared_is_not_failed_by_a_rule():
    rows = blank(1)
    rows["decided_by"][0, Q] = DecidedBy.TREND
    rows["valid"][0, Q, 1] = 0
    rows["channels"][0, Q, 2] = np.nan
    assert [who_failed(rows[0], Q, c) for c in range(4)] == ["trend", "comparison", "comparison", "trend"]


def test_states_of_no_rows_have_no_failures():
    assert became_failed(np.zeros((0, 2, 4), np.uint8)).shape == (0, 3)


def test_the_decisive_seconds_lie_within_the_flight():
    assert decisive_s(0.2, 0.3, 60.0) == pytest.approx((0.0, 1.3))
    assert decisive_s(20.0, 20.07, 20.5) == pytest.approx((19.5, 20.5))
