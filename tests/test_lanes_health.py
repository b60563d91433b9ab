"""Who is engaged: accusations against an oracle that counts heads, and the orders of the pilot."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.computer.lanes.computers_table import Command, Config
from rig.computer.lanes.health import NO_LANE, HealthData, accuse, engage, fail_accused, health, suspect, watch_clocks
from rig.computer.lanes.health import test_itself as itself
from rig.core.frame import Health, LaneTest, LinkState
from rig.world.faults.servo_parts import ComputerPart

STROKE = np.full(4, 0.8)
TESTS = [int(LaneTest.NONE), int(LaneTest.COMMANDS), int(LaneTest.LINK), int(LaneTest.CLOCK)]


def lanes(**given: Any) -> HealthData:
    """Lanes at 100 Hz."""
    return health(Config(**{"count": 4, **given}), STROKE, 100.0)


def oracle(states: list[int], accuses: list[list[int]]) -> list[int]:
    """Health after one round of accusations: more than half of the other engaged lanes fail one."""
    engaged = {i for i, state in enumerate(states) if state in (Health.ENGAGED, Health.SUSPECT)}
    out = list(states)
    for j in engaged:
        others = engaged - {j}
        against = [i for i in others if accuses[i][j]]
        if others and len(against) / len(others) > 0.5:
            out[j] = Health.FAILED
    return out


@settings(max_examples=200, deadline=None)
@given(
    count=st.integers(2, 4),
    states=st.lists(st.sampled_from([int(state) for state in Health][1:]), min_size=4, max_size=4),
    accuses=st.lists(st.lists(st.sampled_from(TESTS), min_size=4, max_size=4), min_size=4, max_size=4),
)
def test_a_strict_majority_of_the_other_engaged_lanes_fails_one(count, states, accuses):
    data = lanes(count=count)
    states[count:] = [int(Health.ABSENT)] * (4 - count)
    data.lane["health"], data.lane["accuses"] = states, accuses
    fail_accused(data)
    expected = oracle(states, accuses)
    assert data.lane["health"].tolist() == expected
    for j in range(count):
        if expected[j] != states[j]:
            said = [accuses[i][j] for i in range(count) if i != j and states[i] in (1, 2) and accuses[i][j]]
            assert data.lane["failed_for"][j] == said[0]


@settings(max_examples=200, deadline=None)
@given(
    states=st.lists(st.sampled_from([1, 2, 3, 4, 5]), min_size=4, max_size=4),
    running=st.lists(st.sampled_from([0, 1]), min_size=4, max_size=4),
)
def test_the_first_engaged_lane_that_runs_leads(states, running):
    data = lanes()
    data.lane["health"], data.lane["running"] = states, running
    data.parts[ComputerPart.STOPPED] = 1.0 - np.array(running)
    engage(7, data)
    engaged = [i for i in range(4) if states[i] in (1, 2)]
    first = [i for i in engaged if running[i]] + engaged + [NO_LANE]
    assert data.system["leading"] == first[0] and data.system["backup"] == (not engaged)


def test_lanes_that_accuse_each_other_fail_in_the_same_frame_in_any_order():
    data = lanes(count=2)
    data.lane["accuses"][:2, :2] = [[0, LaneTest.CLOCK], [LaneTest.CLOCK, 0]]
    engage(0, data)
    assert (data.lane["failed_for"][:2] == LaneTest.CLOCK).all()
    assert (data.lane["health"][:2] == Health.FAILED).all() and data.system["leading"] == NO_LANE


def test_what_is_accused_of_is_commands_before_link_before_clock_and_only_among_the_engaged():
    data, none = lanes(), np.full(4, LinkState.FRESH, np.uint8)
    data.lane["off_time"][0] = 5
    lost = np.array([LinkState.ABSENT, LinkState.FAILED, LinkState.FAILED, LinkState.FAILED], np.uint8)
    accuse(0, np.array([0, 1, 0, 0], np.uint8), lost, data)
    assert data.lane["accuses"][0].tolist() == [0, LaneTest.COMMANDS, LaneTest.LINK, LaneTest.LINK]
    accuse(0, np.zeros(4, np.uint8), none, data)
    assert data.lane["accuses"][0].tolist() == [0] + [LaneTest.CLOCK] * 3
    suspect(data)
    assert data.lane["health"].tolist() == [Health.ENGAGED] + [Health.SUSPECT] * 3
    data.lane["health"][2] = Health.FAILED
    accuse(0, np.zeros(4, np.uint8), none, data)
    assert data.lane["accuses"][0].tolist() == [0, LaneTest.CLOCK, 0, LaneTest.CLOCK]
    data.lane["running"][0] = 0
    accuse(0, np.zeros(4, np.uint8), none, data)
    assert not data.lane["accuses"][0].any()


def counted(data: HealthData, frames: int, first: int = 1, off: bool = False) -> int | None:
    """Frame of so many in which lane B fails itself."""
    for frame in range(first, first + frames):
        itself(1, 0, frame, off, data)
        if data.lane["health"][1] == Health.FAILED:
            return frame
    return None


@pytest.mark.parametrize(
    ("test", "part", "frames"),
    [
        (LaneTest.WRAP_AROUND, ComputerPart.INPUT, 4),
        (LaneTest.REFERENCE_VOLTAGE, ComputerPart.SCALE, 6),
        (LaneTest.CHECKSUM, ComputerPart.CODE, 19),
        (LaneTest.WATCHDOG, ComputerPart.STOPPED, 3),
    ],
)
def test_a_test_fails_its_lane_after_its_time_if_it_sees_the_fault(test, part, frames):
    times = {
        "wrap_around": {"persistence_s": 0.04},
        "reference_voltage": {"persistence_s": 0.06},
        "watchdog": {"persistence_s": 0.03},
        "checksum_period_s": 0.2,
    }
    for seen in (0, 1):
        data = lanes(**times)
        data.parts[part, 1], data.seen[test, 1] = 1.0, seen
        data.lane["running"][1] = part != ComputerPart.STOPPED
        assert counted(data, 60) == (frames if seen else None)
        assert data.lane["failed_for"][1] == (test if seen else LaneTest.NONE)
        assert (data.lane["health"][[0, 2, 3]] == Health.ENGAGED).all()


def test_a_miscompare_that_ends_in_time_is_forgotten():
    data = lanes()
    data.seen[LaneTest.WRAP_AROUND, 1] = 1
    assert counted(data, 2, off=True) is None and data.lane["wrap_frames"][1] == 2
    assert counted(data, 1, off=False) is None and data.lane["wrap_frames"][1] == 0
    assert counted(data, 3, off=True) == 3


def test_false_alarms_come_as_often_as_they_should():
    rows = 50_000
    data = lanes(false_alarm_per_hour=1440.0)._replace(alarm=np.random.default_rng(1).random((rows, 4)))
    found = 0
    for k in range(rows):
        itself(1, k, k, False, data)
        found += data.lane["health"][1] == Health.FAILED
        data.lane["health"][1] = Health.ENGAGED
    expected = rows / 100.0 * 1440.0 / 3600.0
    assert abs(found - expected) < 4 * np.sqrt(expected)


def test_clocks_are_watched_from_half_a_second_on_around_the_frame():
    """0.98 frames ahead is 0.02 behind: within the window of 0.05."""
    data, heard = lanes(), np.zeros((4, 4), np.int64)
    lead = np.array([0.0, 0.04, 0.06, 0.98])
    watch_clocks(49, lead, heard, data)
    assert not data.lane["off_time"].any()
    heard[0, 2] = 1
    watch_clocks(50, lead, heard, data)
    apart = np.abs((lead[None] - lead[:, None] + 0.5) % 1.0 - 0.5) > 0.05
    apart[0, 2] = False  # whom a lane does not hear it does not measure
    assert (data.lane["off_time"] == apart).all()


def test_a_readmission_waits_for_no_one_and_only_who_has_agreed_comes_back():
    data = lanes(commands=[Command(at_s=0.05, do="disengage", lane="C"), Command(at_s=2.0, do="readmit", lane="C")])
    engage(5, data)
    assert data.lane["health"][2] == Health.OFF and data.lane["failed_for"][2] == LaneTest.COMMANDED
    data.lane["agreed_frames"][2] = 99
    engage(200, data)
    assert data.lane["health"][2] == Health.OFF
    data.lane["agreed_frames"][2] = 100
    engage(201, data)
    assert data.lane["health"][2] == Health.OFF
    engage(200, data)
    assert data.lane["health"][2] == Health.ENGAGED and data.lane["joins"][2] == 1


def test_a_lane_that_stops_again_while_it_restarts_is_failed_again():
    data, stopped = lanes(), data_of_stop()
    for frame, runs, expected in stopped:
        data.parts[ComputerPart.STOPPED, 1] = not runs
        data.seen[LaneTest.WATCHDOG, 1] = not runs
        engage(frame, data)
        itself(1, 0, frame, False, data)
        assert data.lane["health"][1] == expected, frame


def data_of_stop() -> list[tuple[int, bool, Health]]:
    """Frame, whether the lane runs, and what it is then: the watchdog waits for two frames."""
    return [
        (0, False, Health.ENGAGED),
        (1, False, Health.FAILED),
        (2, True, Health.RESTARTING),
        (3, False, Health.FAILED),
        (4, True, Health.RESTARTING),
    ]


def test_the_back_up_is_for_good_and_takes_over_once():
    data = lanes(commands=[Command(at_s=0.02, do="backup")])
    seen = []
    for frame in range(5):
        engage(frame, data)
        seen.append((int(data.system["leading"][0]), int(data.system["led"][0]), int(data.system["taken_over"][0])))
    assert seen == [(0, 0, 0), (0, 0, 0), (NO_LANE, 0, 1), (NO_LANE, 0, 0), (NO_LANE, 0, 0)]
