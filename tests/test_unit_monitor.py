"""The monitor in C, docs/examples/unit: the same bits as the rig's own manager, over flights and random rows."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
from unit_files import COMPILER, Library, config, differing, inputs, library
from unit_rows import HUGE, give_slow_tests, random_discretes, random_params, random_rows, slow_rows, vote

from rig.core.frame import INDEX, Block, DecidedBy, Ilm, Law, Pattern, State
from rig.flight.loop import fly_rows, redundancy
from rig.scenario import scenario
from rig.unit.session import box_rule, settings_of
from rig.unit.unit_records import Role, Said, members

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler is installed")

FLIGHTS = (
    ("f16_fault_in_the_split", ["duration_s=15"]),
    ("history_afti_flight_44", ["duration_s=20"]),
    ("f16_split_2_2_wrong_ilm", ["duration_s=20"]),
    ("f16_split_1_1_1", ["duration_s=15", "redundancy.resets=[{at_s=9.0, signal='pitch_rate'}]"]),
    ("b747_lost_pitch_rate", ["duration_s=20"]),
    ("b737_turn_through_north", ["duration_s=35"]),
    ("b737_gear_down_inverted", ["duration_s=10"]),
)


@pytest.fixture(scope="module")
def monitor() -> Library:
    return Library(library("monitor"))


@pytest.mark.parametrize(("name", "overrides"), FLIGHTS, ids=[name for name, _ in FLIGHTS])
def test_a_flight_is_voted_to_the_same_bits(monitor: Library, name: str, overrides: list[str]):
    loaded = scenario.load(name, overrides)
    stage, rows = redundancy(loaded), fly_rows(loaded)
    record = config(stage.manager.params, stage.discretes.params, stage.manager.boxes)
    assert differing(monitor.fly(record, rows), rows) == {}


RANDOM_FLIGHTS = 30  # of each seed
FLIGHT_FRAMES = 150  # of a random flight: channels are failed for good in most of them, so many short ones say more


def random_flight(seed: Sequence[int], hostile: bool = False) -> tuple[np.ndarray, Block]:
    """CONFIG, and rows voted by the kernels."""
    draw = np.random.default_rng(seed)
    params, discretes = random_params(draw), random_discretes(draw)
    if hostile:
        params["low"][::5], params["high"][::5] = -HUGE, HUGE
    rows = random_rows(draw, params, FLIGHT_FRAMES, hostile)
    signals = int(draw.integers(-2, 13))  # of a box; below zero: more than half
    manager = vote(rows, params, discretes, None if signals < 0 else signals, int(draw.integers(1, 5)))
    return config(params, discretes, manager.boxes), rows


def test_random_rows_are_voted_to_the_same_bits_and_reach_every_state_and_readmission(
    monitor: Library,
):
    seen: Counter[object] = Counter()
    for flight in range(8 * RANDOM_FLIGHTS):
        record, rows = random_flight(divmod(flight, RANDOM_FLIGHTS))
        assert differing(monitor.fly(record, rows), rows) == {}, flight
        for name, enum in (
            ("pattern", Pattern),
            ("decided_by", DecidedBy),
            ("state", State),
            ("discrete_state", State),
        ):
            values, counts = np.unique(rows[name], return_counts=True)
            seen.update({(name, enum(value)): int(count) for value, count in zip(values, counts, strict=True)})
        seen["common mode"] += int(rows["common_mode"].sum())
        for name, found in (("level", "readmitted"), ("discrete_level", "discrete readmitted")):
            seen[found] += int((np.diff(rows[name].astype(int), axis=0) > 0).sum())
    expected = [("pattern", one) for one in Pattern] + [("decided_by", one) for one in members(DecidedBy)]
    expected = [one for one in expected if one[1] not in (DecidedBy.LANE, *OF_TESTS)]  # a unit has no lanes to ask
    expected += [(name, one) for name in ("state", "discrete_state") for one in State]
    counts = {one: seen[one] for one in (*expected, "common mode", "readmitted", "discrete readmitted")}
    assert min(counts.values()) >= 10, counts


@pytest.mark.parametrize("seed", [100, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(101, 104))])
def test_so_are_rows_with_infinities_and_numbers_near_the_largest(monitor: Library, seed: int):
    for flight in range(RANDOM_FLIGHTS):
        record, rows = random_flight((seed, flight), hostile=True)
        assert differing(monitor.fly(record, rows), rows) == {}, flight


OF_TESTS = (DecidedBy.SLOW_MEANS, DecidedBy.SLOW_SQUARES, DecidedBy.SLOW_HALVES)


def slow_flight(seed: Sequence[int], hostile: bool = False) -> tuple[np.ndarray, Block]:
    """CONFIG with slow-fault tests on all signals, and rows voted by the kernels."""
    draw = np.random.default_rng(seed)
    params, discretes = random_params(draw), random_discretes(draw)
    give_slow_tests(draw, params)
    if hostile:
        params["low"][::5], params["high"][::5] = -HUGE, HUGE
    rows = slow_rows(draw, params, 1500, hostile)
    manager = vote(rows, params, discretes, None, 4)
    return config(params, discretes, manager.boxes), rows


@pytest.mark.parametrize("hostile", [pytest.param(False, marks=pytest.mark.long), True])
def test_so_are_rows_long_enough_for_the_slow_fault_tests(monitor: Library, hostile: bool):
    seen: Counter[int] = Counter()
    for flight in range(RANDOM_FLIGHTS):
        record, rows = slow_flight((200, flight), hostile)
        assert differing(monitor.fly(record, rows), rows) == {}, flight
        seen.update(rows["decided_by"].ravel().tolist())
    assert min(seen[one] for one in OF_TESTS) >= 5, seen


# Each switch that versions 2 and 3 of the records brought, and what it is when it is off.
SWITCHES = {
    **dict.fromkeys(("slow_limit", "stale_frames", "count_down", "unresolved_frames"), 0),
    **dict.fromkeys(("trend_tumbles", "trend_beside_reference", "referred", "sources", "box", "weighted"), 0),
    "trend_small": -1.0,
}


def test_each_switch_decides_in_the_random_rows():
    differ: Counter[str] = Counter()
    for flight in range(RANDOM_FLIGHTS):
        record, rows = random_flight((0, flight))
        for name, off in SWITCHES.items():
            params, discretes = settings_of(record)
            params[name], again = off, rows.copy()
            vote(again, params, discretes, **box_rule(record))
            other = (rows["state"] != again["state"]).any(axis=2) | (rows["voted"] != again["voted"])
            differ[name] += int(other.any(axis=0).sum())
    assert min(differ[name] for name in SWITCHES) > 2, differ  # of sixteen signals a flight


def quiet(frames: int) -> tuple[np.ndarray, Block]:
    """CONFIG of a bundled scenario whose samples may repeat, and rows of zeros, all valid, without references."""
    stage = redundancy(scenario.load("f16_split_2_2_ilm"))
    stage.manager.params["stale_frames"] = 0
    rows = np.zeros(frames, fly_rows(scenario.load("f16_split_2_2_ilm"), 1).dtype)
    rows["valid"] = rows["discrete_valid"] = 1
    rows["ilm"] = rows["discrete_ilm"] = Ilm.ABSENT
    rows["reference"] = rows["second_reference"] = np.nan
    return config(stage.manager.params, stage.discretes.params, stage.manager.boxes), rows


def test_a_monitor_that_is_absent_does_not_say_bad(monitor: Library):
    record, rows = quiet(20)
    record["signal"][0, 0]["tie_break"] = [DecidedBy.ILM, 0, 0, 0, 0]
    rows["channels"][:, 0] = [0.0, 0.0, 1.0, 1.0]
    rows["ilm"][:, 0] = [Ilm.GOOD, Ilm.GOOD, Ilm.ABSENT, Ilm.ABSENT]
    rows["discrete_channels"] = 1
    out = monitor.fly(record, rows)
    assert set(out["decided_by"][:, 0]) == {DecidedBy.UNRESOLVED}
    assert (out["discrete_voted"] == 1).all()


def test_a_reset_readmits_only_a_channel_that_has_agreed_long_enough(monitor: Library):
    record, rows = quiet(400)
    rows["channels"][:100, 0, 3] = 1.0
    wait = int(record["signal"][0, 0]["readmit_frames"])
    rows["reset"][[50, 99 + wait, 101 + wait], 0] = 8  # in disagreement, a frame too early, in time
    states = monitor.fly(record, rows)["state"][:, 0, 3]
    assert (states[50 : 101 + wait] == State.FAILED).all()
    assert (states[101 + wait :] == State.OK).all()


def test_an_open_after_a_close_begins_at_the_first_frame(monitor: Library):
    record, rows = random_flight((3, 0))
    once, again = monitor.fly(record, rows), monitor.fly(record, rows)
    assert once.tobytes() == again.tobytes()
    assert list(once["stepped"][[0, -1]]) == [1, FLIGHT_FRAMES]
    assert set(once["said"]) == {int(Said.VOTED | Said.STATE | Said.PATTERN | Said.TREND | Said.DISCRETES)}


@pytest.mark.parametrize("name", ["monitor", "first_valid", "autopilot"])
def test_a_configuration_of_another_layout_is_refused(name: str):
    record, _ = quiet(1)
    record["layout"] ^= 1
    assert Library(library(name)).open(record) != 0


def test_the_first_valid_unit_votes_the_first_channel_in_range_and_holds_without_one():
    record, rows = quiet(3)
    rows["channels"][:, 0] = [np.nan, 9.0, 0.25, 0.5]
    rows["valid"][1, 0, 2] = 0
    rows["valid"][2, 0] = 0
    out = Library(library("first_valid")).fly(record, rows)
    assert list(out["voted"][:, 0]) == [0.25, 0.5, 0.5]
    assert set(out["said"]) == {int(Said.VOTED | Said.STATE)}


def test_the_autopilot_puts_the_nose_and_the_wings_back_within_the_stops():
    record, rows = quiet(3)
    record["role"], record["rate_hz"] = Role.FLIGHT_COMPUTER, 100.0
    record["surface_low"], record["surface_high"] = -0.3, [0.3, 0.3, 0.3, 1.0]
    record["trim_surface"] = [0.01, 0.0, 0.0, 0.25]
    rows["channels"][:, INDEX["dynamic_pressure"]] = 5276.0
    rows["channels"][1, INDEX["pitch_angle"]] = [0.05, 0.05, 0.05, 1.0]  # nose up: the elevator goes down, positive
    rows["channels"][1, INDEX["roll_angle"]] = 0.05
    rows["channels"][2, INDEX["pitch_angle"]] = -1.0
    rows["channels"][2, INDEX["roll_angle"]] = -1.0
    out = Library(library("autopilot")).fly(record, rows)
    assert np.allclose(out["surface"][0], [0.01, 0.0, 0.0, 0.25])
    assert out["surface"][1, 0] > 0.05 and out["surface"][1, 1] < -0.05
    assert list(out["surface"][2, :2]) == [-0.3, 0.3]
    assert set(out["law"]) == {Law.EXTERNAL} and set(out["said"]) == {int(Said.SURFACE)}


def test_the_inputs_are_the_fields_of_the_frame():
    _, rows = quiet(2)
    rows["channels"][1, 15] = [1, 2, 3, 4]
    assert list(inputs(rows)["channels"][1, 15]) == [1, 2, 3, 4]
