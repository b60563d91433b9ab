"""Failures of channels, found in the rows: once each, with the frame and the resolver."""

import numpy as np
import pytest

from rig.core.frame import DISCRETE_INDEX, INDEX, Block, Resolver, State, new_block
from rig.flight.failures import Failure, became_failed, decided_by, decisive_s, failures

Q, GEAR = INDEX["pitch_rate"], DISCRETE_INDEX["gear_down"]


def blank(frames: int = 30, first: int = 0) -> Block:
    rows = new_block(frames, first)
    rows["valid"] = 1
    return rows


def test_a_failure_names_channel_frame_and_resolver():
    rows = blank(first=100)
    rows["state"][12:, Q, 2] = State.FAILED
    rows["resolver"][12, Q] = Resolver.TREND
    rows["discrete_state"][5:, GEAR, 0] = State.FAILED
    assert failures(rows) == [Failure(105, "gear_down", 1, "comparison"), Failure(112, "pitch_rate", 3, "trend")]


def test_a_channel_that_is_readmitted_can_fail_again():
    rows = blank()
    rows["state"][[3, 4, 9], Q, 1] = State.FAILED
    assert [failure.frame for failure in failures(rows)] == [3, 9]


@pytest.mark.parametrize(("resolver", "by"), [(Resolver.NONE, "comparison"), (Resolver.UNRESOLVED, "comparison")])
def test_a_resolver_that_did_not_decide_is_not_named(resolver: Resolver, by: str):
    rows = blank(1)
    rows["resolver"][0, Q] = resolver
    assert decided_by(rows[0], Q, 0) == by


def test_a_channel_that_cannot_be_compared_is_not_failed_by_a_resolver():
    rows = blank(1)
    rows["resolver"][0, Q] = Resolver.TREND
    rows["valid"][0, Q, 1] = 0
    rows["channels"][0, Q, 2] = np.nan
    assert [decided_by(rows[0], Q, c) for c in range(4)] == ["trend", "comparison", "comparison", "trend"]


def test_states_of_no_rows_have_no_failures():
    assert became_failed(np.zeros((0, 2, 4), np.uint8)).shape == (0, 3)


def test_the_decisive_seconds_lie_within_the_flight():
    assert decisive_s(0.2, 0.3, 60.0) == pytest.approx((0.0, 1.3))
    assert decisive_s(20.0, 20.07, 20.5) == pytest.approx((19.5, 20.5))
