"""A unit under test as one of several computers: three are the rig's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from unit_files import HERE, faulty, needs_a_compiler, udp, unit, written

import rig
from rig.bench.replay.verify import verify
from rig.core.errors import BadInput
from rig.core.frame import COMPUTERS, Health, LaneTest, Law, State, UnitStatus, sig
from rig.log.info import info
from rig.log.recordings.flown_log import recorded
from rig.studies.campaign.flying import fly as fly_in_memory
from rig.studies.campaign.tables import rows as campaign_rows
from rig.unit.running_unit import running
from rig.unit.unit_file import Unit, as_lane
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick
from rig.verdict.scoring import score

pytestmark = needs_a_compiler
B = COMPUTERS.index("B")
HARDOVER = rig.fault("hardover", signal="pitch_rate", channels=[1], start_s=0.5)
FOUR: dict[str, Any] = {"duration_s": 2.0, "computers": {"count": 4}, "actuators": {"model": "servo"}}


def fly(out: Path, tested: Unit | None = None, lane: str | None = None, **keys: Any) -> rig.Flight:
    return rig.fly({**FOUR, **keys}, out=out, unit=tested, lane=lane)


def lanes_of(flight: rig.Flight) -> np.ndarray[Any, Any]:
    lanes = flight.recorded.parts
    assert lanes is not None
    return lanes["computer"]


def differing(one: rig.Flight, other: rig.Flight) -> set[str]:
    pairs = (one.rows, other.rows), (lanes_of(one), lanes_of(other))
    return {name for a, b in pairs for name in a.dtype.names or () if a[name].tobytes() != b[name].tobytes()}


@pytest.mark.parametrize("lane", ["A", *(pytest.param(lane, marks=pytest.mark.long) for lane in "BD")])
def test_our_monitor_in_c_as_one_lane_flies_the_bits_of_four_of_ours(tmp_path: Path, lane: str):
    faults = [HARDOVER, rig.fault("computer_stop", signal="computer.C", start_s=1.0)]
    theirs = fly(tmp_path, unit(tmp_path, "monitor"), lane, faults=faults)
    assert differing(theirs, fly(tmp_path, faults=faults)) == {"unit"}
    assert (theirs.rows["unit"] == UnitStatus.ANSWERED).all() and (theirs.rows["unit_age"] == 0).all()
    assert theirs.failed["pitch_rate"] == [1] or theirs.failed["pitch_rate"] == [1, 3]
    assert theirs.voter == f"manager cross-channel, unit monitor as lane {lane}"


def test_what_the_back_up_takes_over_from_it_is_what_ours_would_have(tmp_path: Path):
    sets = ["duration_s=10"]
    ours = rig.fly("f16_four_lanes_lost", out=tmp_path, overrides=sets)
    theirs = rig.fly("f16_four_lanes_lost", out=tmp_path, overrides=sets, unit=unit(tmp_path, "monitor"), lane="D")
    assert differing(theirs, ours) == {"unit"}
    assert set(theirs.lanes_failed) == set(COMPUTERS)


def test_by_datagrams_it_is_the_same(tmp_path: Path):
    library, datagrams = (fly(tmp_path, one, "B") for one in (unit(tmp_path, "monitor"), udp(tmp_path, [], "monitor")))
    assert library.digest == datagrams.digest


def test_a_lane_whose_unit_dies_is_failed_by_its_watchdog_and_three_fly_on(tmp_path: Path):
    flight = fly(tmp_path, faulty(tmp_path, "segv", on_dead="hold"), "B")
    lanes = lanes_of(flight)
    assert flight.survived and flight.frames == 200 and set(flight.lanes_failed) == {"B"}
    failed = np.flatnonzero(lanes["health"][:, B] == Health.FAILED)
    assert lanes["failed_for"][failed[0], B] == LaneTest.WATCHDOG
    assert 50 <= failed[0] <= 53 and failed.tolist() == list(range(failed[0], 200))
    assert (flight.rows["unit"][51:] == UnitStatus.DEAD).all()
    assert lanes["health"][:, [0, 2, 3]].max() < Health.FAILED
    assert not flight.failed  # its lane still passes its samples on
    found = score_log(flight.log, Yardstick(), baseline=False)
    assert found.score.isolations == [] and flight.conclusion == found.conclusion
    assert flight.conclusion and flight.conclusion[1].startswith("computer B: the unit under test, isolated at ")


def test_a_campaign_counts_no_healthy_channel_of_a_lane_that_is_a_unit(tmp_path: Path):
    tested = unit(tmp_path, "first_valid", lane="B")
    which = rig.load({**FOUR, "faults": [HARDOVER]})
    with running(tested) as again:
        assert again is not None
        flown = fly_in_memory(which, again)
        found = score(which, flown.table, unit_lane=again.lane)
    (row,) = campaign_rows("runs", 0, which, found, flown)
    assert (row["detected"], row["missed"], row["false_alarms"], row["wrong_isolations"]) == (1, 0, 0, 0)
    assert row["healthy_coils_failed"] == 0 and not campaign_rows("alarms", 0, which, found)


def test_a_voter_that_uses_a_faulty_channel_is_outvoted_and_failed_by_the_others(tmp_path: Path):
    flight = fly(tmp_path, unit(tmp_path, "first_valid"), "B", faults=[HARDOVER])
    lanes = lanes_of(flight)
    assert flight.survived and set(flight.lanes_failed) == {"B"}
    assert lanes["failed_for"][-1, B] == LaneTest.COMMANDS
    assert flight.failed == {"pitch_rate": [1]}  # by the leading lane, which is ours
    found = score_log(flight.log, Yardstick(), baseline=False)
    computers = found.score.computers
    assert computers is not None and [one.cause for one in computers.failures] == ["unit under test"]
    assert not found.score.isolations
    assert flight.conclusion and flight.conclusion == found.conclusion
    assert flight.conclusion[0].endswith("no healthy channel isolated")
    told = "computer B: the unit under test, isolated at "
    assert flight.conclusion[1].startswith(told) and "by computers A, C and D" in flight.conclusion[1]


def test_a_flight_computer_has_its_own_law_and_no_part_in_the_integrators_of_the_others(tmp_path: Path):
    flight = fly(tmp_path, unit(tmp_path, "autopilot", role="flight-computer"), "B")
    ours, lanes = lanes_of(fly(tmp_path)), lanes_of(flight)
    others = [0, 2, 3]
    assert np.array_equal(lanes["integral"][:3, others], ours["integral"][:3, others])
    assert np.ptp(lanes["integral"][:, others], axis=1).max() == 0.0
    assert not lanes["integral"][:, B].any() or np.ptp(lanes["integral"][:, B], axis=0).max() == 0.0
    assert flight.survived and not (flight.rows["law"] == Law.EXTERNAL).any()


def test_a_lane_that_stops_and_starts_again_is_readmitted_with_a_unit_that_had_no_frames_meanwhile(tmp_path: Path):
    keys = {
        "faults": [rig.fault("computer_stop", signal="computer.B", start_s=0.5, end_s=0.7)],
        "computers": {"count": 4, "commands": [{"at_s": 1.8, "do": "readmit", "lane": "B"}]},
    }
    flight = fly(tmp_path, unit(tmp_path, "monitor"), "B", **keys)
    lanes, asked = lanes_of(flight), flight.rows["unit"] == UnitStatus.ANSWERED
    assert lanes["health"][60, B] == Health.FAILED and lanes["health"][-1, B] == Health.ENGAGED
    assert np.flatnonzero(~asked).tolist() == list(range(50, 70))
    # The others have failed channel 2, which was missing; the unit does not know of it and votes with all four.
    assert (lanes["state"][-1, [0, 2, 3], 0, 1] == State.FAILED).all() and lanes["state"][-1, B, 0, 1] == State.OK


def test_its_log_is_scored_and_flown_again_as_the_lane_that_it_was(tmp_path: Path):
    tested = unit(tmp_path, "monitor")
    flight = fly(tmp_path, tested, "B", faults=[HARDOVER])
    assert info(flight.log)["lane"] == "B"
    with running(tested) as again:
        scored = score_log(flight.log, Yardstick(), unit=again)
        assert scored.voter.endswith("unit monitor as lane B") and scored.score.faults[0].outcome == "detected"
        assert verify(recorded(flight.log), fly=True, unit=again).comparison.identical
        with pytest.raises(BadInput, match="one lane of several; use --fly to fly it again"):
            verify(recorded(flight.log), unit=again)


def test_the_key_of_the_unit_file_is_the_option(tmp_path: Path):
    by_option, by_key = (
        fly(tmp_path, unit(tmp_path, "monitor"), "B"),
        fly(tmp_path, unit(tmp_path, "monitor", lane="B")),
    )
    assert by_key.digest == by_option.digest and by_key.voter == by_option.voter


@pytest.mark.parametrize(
    ("keys", "lane", "said"),
    [
        ({}, "E", "--lane E: must be one of A, B, C, D"),
        ({}, None, "with a unit under test allowed: 1; --lane replaces one of them"),
        ({"computers": {"count": 1}}, "B", "lane B cannot be a unit under test: there is one computer"),
        ({"computers": {"count": 2}, "actuators": {"model": "lag"}}, "C", "lane C cannot be .*: there are A, B"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(tmp_path: Path, keys: dict[str, Any], lane: str, said: str):
    tested = unit(tmp_path)
    with pytest.raises(BadInput, match=said):
        fly(tmp_path / "logs", tested, lane, **keys)
    assert not (tmp_path / "logs").exists()


def test_a_lane_without_a_unit_and_a_class_as_a_lane_are_refused(tmp_path: Path):
    with pytest.raises(BadInput, match="--lane B: needs --unit, the unit under test"):
        fly(tmp_path, None, "B")
    with pytest.raises(BadInput, match="a Python class replaces the manager"):
        as_lane(Unit(name="mine", transport="python", manager="mine:Mine"), "B")


# A control law ------------------------------------------------------------------------------------------------


def test_a_law_that_is_our_own_in_one_lane_flies_the_bits_of_four_of_ours(tmp_path: Path, monkeypatch):
    """It tells no integrators, so they are not averaged here."""
    monkeypatch.syspath_prepend(HERE)
    import built_in_law  # pyright: ignore[reportMissingImports] # from that folder

    keys = {"computers": {"count": 4, "equalise": False}, "faults": [HARDOVER]}
    ours = fly(tmp_path, **keys)
    built_in_law.flown[:] = [ours.scenario]
    law = {"name": "law", "role": "control-law", "transport": "python", "law": "built_in_law:BuiltIn"}
    theirs = fly(tmp_path, written(tmp_path, law), "B", **keys)
    assert differing(theirs, ours) == {"unit", "integral"}
    assert theirs.voter == "manager cross-channel, law law as lane B"


def test_a_law_that_dies_in_its_lane_is_failed_and_three_fly_on(tmp_path: Path):
    flight = fly(tmp_path, faulty(tmp_path, "segv", role="control-law", on_dead="hold"), "B")
    assert flight.survived and set(flight.lanes_failed) == {"B"} and not flight.failed


def test_a_law_that_commands_other_surfaces_is_outvoted_with_the_votes_of_its_lane(tmp_path: Path):
    flight = fly(tmp_path, unit(tmp_path, "pid", role="control-law"), "B", faults=[HARDOVER])
    lanes = lanes_of(flight)
    assert flight.survived and flight.failed == {"pitch_rate": [1]}
    assert (lanes["state"][-1, B, sig.Q] == lanes["state"][-1, 0, sig.Q]).all()
    assert np.array_equal(lanes["voted"][:, B], lanes["voted"][:, 0])
