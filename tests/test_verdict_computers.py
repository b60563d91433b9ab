"""Score and conclusion of several computers: which failed, by whom, for what; the back-up; no channel blamed for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from rig.flight.fly import fly
from rig.verdict.of_log import Scored, score_log
from rig.verdict.score_records import ActuatorScore, Yardstick
from rig.verdict.score_tables import tables
from rig.verdict.servo_words import bypass_text

ONE_AFTER_THE_OTHER = (
    'kind="wrong_command", signal="computer.A", surface="elevator", does="hardover", start_s=0.5',
    'kind="computer_stop", signal="computer.B", start_s=1.0',
    'kind="link_loss", signal="ccdl.C", start_s=1.5',
    'kind="dac", signal="computer.D", surface="elevator", does="hardover", start_s=2.0',
)


def scored(out: Path, faults: tuple[str, ...], *sets: str) -> Scored:
    tables = ", ".join(f"{{{fault}}}" for fault in faults)
    given = ["duration_s=2.6", "computers.count=4", f"faults=[{tables}]", *sets]
    return score_log(fly(None, overrides=given, out=out).log, Yardstick(), baseline=False)


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Scored:
    """Four lanes lost one after the other, each by another fault that a test of its own or the others see."""
    sure = "computers.wrap_around.coverage=1.0"
    return scored(tmp_path_factory.mktemp("lost"), ONE_AFTER_THE_OTHER, 'actuators.model="servo"', sure)


def test_the_score_has_every_lane_with_test_and_accusers_the_links_and_the_back_up(lost: Scored):
    score = lost.score.computers
    assert score is not None
    assert [(one.lane, one.frame, one.test, "".join(one.accusers)) for one in score.failures] == [
        ("A", 55, "vote of commands", "BCD"),
        ("B", 101, "watchdog", ""),
        ("C", 155, "link", "D"),
        ("D", 202, "wrap-around", ""),
    ]
    assert score.links_failed == {"B-A": 104, "B-C": 104, "B-D": 104, "C-A": 154, "C-B": 154, "C-D": 154}
    assert (score.backup_frame, score.backup_reason) == (203, "no lane is engaged")
    assert lost.as_dict()["computers"]["failures"][0]["lane"] == "A"


def test_the_conclusion_names_the_lanes_and_the_back_up_and_no_healthy_channel(lost: Scored):
    told = lost.conclusion
    assert told[1] == "back-up: flies from 2.03 s on: no lane is engaged"
    assert [row.label for row in told.rows[1:5]] == ["computer A", "computer B", "links from C", "computer D"]
    assert told[0].endswith("4 of 4 faults detected, no healthy channel isolated")


def test_a_surface_that_is_moved_again_is_not_told_as_bypassed_to_the_end():
    passing, slow_faults = ActuatorScore([], {}, 202, 3), ActuatorScore([], {}, 202, 58)
    assert bypass_text(passing, 260, 100.0) == "bypassed at 2.02 s, for 30 ms in all"
    assert bypass_text(slow_faults, 260, 100.0) == "bypassed from 2.02 s on"


def test_the_table_has_a_row_for_each(lost: Scored):
    rows = [tuple(row.values()) for row in tables(lost.score, 100.0)["computers"].rows]
    assert rows[0] == ("lane A", "0.55 s (frame 55)", "B, C, D", "vote of commands", "own fault")
    assert ("link C-D", "1.54 s (frame 154)", "D", "silence", "") in rows
    assert rows[-1] == ("back-up engaged", "2.03 s (frame 203)", "", "no lane is engaged", "")


def test_a_bus_that_fails_takes_two_lanes_and_their_sensors_and_no_healthy_channel(tmp_path: Path):
    found = scored(tmp_path, ('kind="power_loss", signal="bus.1", start_s=0.5',))
    score = found.score.computers
    assert score is not None and [(one.lane, one.frame) for one in score.failures] == [("A", 51), ("C", 51)]
    assert found.conclusion[1].startswith("all 19 signals, channels 1 and 3: power lost at 0.50 s, isolated after ")
    assert found.conclusion[0].endswith("no healthy channel isolated")


def test_one_computer_has_no_such_score(tmp_path: Path):
    found = scored(tmp_path, (), "computers.count=1")
    assert found.score.computers is None and not tables(found.score, 100.0)["computers"].rows
    assert not any("computer" in sentence for sentence in found.conclusion)
