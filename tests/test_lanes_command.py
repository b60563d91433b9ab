"""The vote of the lanes' commands, each lane for itself: median, who is failed, what settles a tie, integrators."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lanes_flown import flown

from rig.computer.lanes.command import (  # fmt: skip
    CommandData,
    agree,
    commands,
    equalise,
    middle_of_engaged,
    note_unresolved,
    vote_commands,
)
from rig.computer.lanes.computers_table import Config
from rig.computer.lanes.health import NO_LANE, HealthData, health
from rig.computer.lanes.link import LinkData, links
from rig.core.frame import FCC, DecidedBy, Health
from rig.flight.loop import Rig
from rig.scenario import scenario

LIMITS = np.array([[-0.4, 0.4]] * 3 + [[0.0, 1.0]])
STROKE = LIMITS[:, 1] - LIMITS[:, 0]
THRESHOLD = 0.05 * STROKE[0]


class Voters(NamedTuple):
    """What a vote needs."""

    fcc: Any
    links: LinkData
    health: HealthData
    commands: CommandData


@cache
def healthy() -> Rig:
    return Rig(scenario.load(None, ["faults=[]"]))


def told(elevator: list[float], who: Voters, frames: int = 1, lead: Any = None) -> None:
    """Let the lanes tell an elevator command for so many frames, and all vote."""
    n = len(elevator)
    for _ in range(frames):
        who.commands.before[:] = who.commands.told
        who.commands.told[:n, 0] = elevator
        for i in range(n):
            if who.health.lane["health"][i] in (Health.ENGAGED, Health.SUSPECT):
                vote_commands(i, np.zeros(4) if lead is None else lead, who.fcc, who.links, who.health, who.commands)
        note_unresolved(who.health, who.commands)


@settings(max_examples=100, deadline=None)
@given(
    count=st.integers(3, 4),
    middle=st.floats(-0.3, 0.3),
    apart=st.lists(st.floats(0.0, 0.9), min_size=4, max_size=4),
)
def test_commands_within_the_threshold_are_voted_to_their_median(count, middle, apart):
    who = voters_like(count)
    given_ = [middle + THRESHOLD * x for x in apart[:count]]
    told(given_, who)
    assert who.commands.meant[:count, 0] == pytest.approx(float(np.median(given_)), abs=1e-15)
    assert not who.commands.differs.any()


def voters_like(count: int, **given: Any) -> Voters:
    """Lanes at 100 Hz that vote the signals alike."""
    config = Config(**{"count": count, **given})
    signals = healthy().redundancy.data.manager.params
    return Voters(
        np.zeros(4, FCC), links(config, 100.0, signals), health(config, STROKE, 100.0), commands(config, LIMITS, 100.0)
    )


@pytest.mark.parametrize("wrong", range(4))
def test_one_that_is_beyond_the_threshold_has_no_part_and_is_failed_after_its_time(wrong: int):
    who, given_ = voters_like(4), [0.1, 0.1, 0.1, 0.1]
    told(given_, who, 3)
    given_[wrong] = 0.1 + 1.5 * THRESHOLD
    told(given_, who, 4)
    assert not who.commands.differs.any() and who.commands.meant[:, 0] == pytest.approx(0.1)
    told(given_, who)
    assert (who.commands.differs == [[j == wrong for j in range(4)]] * 4).all()
    assert who.commands.meant[:, 0] == pytest.approx(0.1)


def test_a_tie_of_two_goes_to_those_whose_own_tests_are_content():
    who = voters_like(4)
    told([0.1] * 4, who, 3)
    who.health.lane["wrap_frames"][[2, 3]] = 1
    told([0.1, 0.1, 0.2, 0.2], who, 5)
    assert (who.commands.differs == [[0, 0, 1, 1]] * 4).all() and who.commands.meant[:, 0] == pytest.approx(0.1)


def test_a_tie_of_two_goes_to_the_largest_group_of_lanes_that_vote_the_signals_alike():
    who = voters_like(4)
    told([0.1] * 4, who, 3)
    who.fcc["voted"][2, 5], who.fcc["voted"][3, 5] = 1.0, 2.0
    told([0.1, 0.1, 0.2, 0.2], who, 5)
    assert (who.commands.differs == [[0, 0, 1, 1]] * 4).all() and who.commands.meant[:, 0] == pytest.approx(0.1)


@pytest.mark.parametrize("votes", [[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 2.0, 3.0]])
def test_votes_of_the_signals_that_do_not_tell_the_two_sides_apart_settle_nothing(votes: list[float]):
    who = voters_like(4)
    told([0.1] * 4, who, 3)
    who.fcc["voted"][:, 5] = votes
    told([0.1, 0.1, 0.2, 0.2], who, 10)
    assert not who.commands.differs.any() and who.health.system["backup"][0] == 1


@pytest.mark.parametrize("given_", [[0.1, 0.2], [0.1, 0.1, 0.2, 0.2]])
def test_a_tie_that_nothing_settles_goes_to_the_back_up_after_its_time_and_not_to_a_coin(given_: list[float]):
    """Ten frames of 0.1 s after the vote is unresolved."""
    who = voters_like(len(given_))
    told([0.1] * len(given_), who, 3)
    frames = 0
    while not who.health.system["backup"][0] and frames < 100:
        told(given_, who)
        frames += 1
        unresolved = int(who.health.system["unresolved_frames"][0])
        assert (who.commands.decided_by[0, 0] == DecidedBy.UNRESOLVED) == (unresolved > 0)
    assert who.health.system["unresolved_frames"][0] == 10 and 10 <= frames <= 15
    assert not who.commands.differs.any()


def test_what_the_link_has_not_brought_is_no_wrong_command():
    who = voters_like(4)
    who.links.silent[:3, 3] = 1
    told([0.1, 0.1, 0.1, 0.4], who, 20)
    assert not who.commands.differs[:3].any() and who.commands.meant[:3, 0] == pytest.approx(0.1)


def test_a_late_message_counts_as_that_of_the_frame_before():
    who = voters_like(4)
    lead = np.array([0.9, 0.0, 0.0, 0.0])
    told([0.0] * 4, who, lead=lead)
    told([0.01, 0.012, 0.012, 0.012], who, lead=lead)
    assert who.commands.meant[0, 0] == 0.0  # its own 0.01 and three of 0
    assert who.commands.meant[1:, 0] == pytest.approx(0.012)


@settings(max_examples=100, deadline=None)
@given(
    count=st.integers(2, 4),
    integral=st.lists(st.floats(-0.2, 0.2), min_size=4, max_size=4),
    out=st.integers(0, 3),
)
def test_integrators_go_to_the_median_of_the_engaged_lanes(count, integral, out):
    who, law = voters_like(count), healthy().control.data.state[0].copy()
    who.commands.integral[:, 1] = integral
    if out < count:
        who.health.lane["health"][out] = Health.FAILED
    equalise(0, law, who.links, who.health, who.commands)
    assert law["aileron_integral"] == float(np.median([integral[j] for j in range(count) if j != out]))
    off = voters_like(count, equalise=False)
    law["aileron_integral"] = 0.123
    equalise(0, law, off.links, off.health, off.commands)
    assert law["aileron_integral"] == 0.123


def test_with_the_lag_the_actuator_gets_the_median_of_what_the_engaged_lanes_put_out():
    who = voters_like(4)
    who.commands.put[:, 0] = [0.1, 0.4, 0.2, 0.3]
    assert middle_of_engaged(0, 9.0, who.health, who.commands) == pytest.approx(0.25)
    who.health.lane["health"][1] = Health.FAILED
    assert middle_of_engaged(0, 9.0, who.health, who.commands) == 0.2
    who.health.lane["health"][:] = Health.OFF
    assert middle_of_engaged(0, 9.0, who.health, who.commands) == 9.0


def test_a_lane_that_is_out_agrees_while_it_commands_what_is_voted_and_no_longer():
    who = voters_like(4)
    who.health.lane["health"][3] = Health.FAILED
    for near, expected in ((1.0, 1), (0.9, 2), (1.1, 0), (0.0, 1)):
        told([0.1, 0.1, 0.1, 0.1 + near * THRESHOLD * (1 - 1e-9)], who)
        agree(3, who.links, who.health, who.commands)
        assert who.health.lane["agreed_frames"][3] == expected
    who.health.system["leading"] = NO_LANE
    agree(3, who.links, who.health, who.commands)
    assert who.health.lane["agreed_frames"][3] == 0


def test_equalising_has_no_effect_on_lanes_that_agree():
    sets = ("computers.clock_drift_ppm=0",)
    one, two = (flown(seconds=1.0, sets=(*sets, f"computers.equalise={e}")) for e in ("true", "false"))
    for kind in ("rows", "lanes"):
        first, second = getattr(one, kind), getattr(two, kind)
        assert all(first[name].tobytes() == second[name].tobytes() for name in first.dtype.names), kind
