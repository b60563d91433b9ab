"""Several computers in the viewer and on the terminal: which lane failed, when, for what, and whose links."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader
from rich.console import Console

from rig.core.errors import BadInput
from rig.core.frame import (
    LINKS,
    SURFACES,
    TIMING,
    DecidedBy,
    Health,
    LaneTest,
    LinkState,
    Pattern,
    Table,
    new_block,
    second_rows,
)
from rig.log.writer import LogWriter
from rig.show.terminal.redundancy_page import Page
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer.blueprint import COMPUTERS, blueprint
from rig.show.viewer.facts import Facts, FaultFact, Layout, Shown
from rig.show.viewer.opened import read, save
from rig.show.viewer.state_strips import Changes
from rig.show.viewer.story import look

HZ, FRAMES, ONSET, FAILED, SILENT = 100.0, 300, 100, 105, 104
A, B, C, D = range(4)
STOP = FaultFact("stop", "computer.B", start_s=1.0, lanes=(B,))
FACTS = Facts("a flight", {"pitch_rate": 1.0}, (STOP,), computers=4)


@pytest.fixture(scope="module")
def moved() -> Table:
    """A accuses B with C and D, which is failed a frame later; its links fail; at 2 s no lane leads any more."""
    block = second_rows(FRAMES, ("computer",))
    lanes = block["computer"]
    lanes["health"], lanes["leads"][:, A] = Health.ENGAGED, 1
    lanes["link"] = LinkState.FRESH
    lanes["link"][:, range(4), range(4)] = LinkState.ABSENT
    lanes["surface"] = np.arange(FRAMES)[:, None, None] * 1e-3 + np.arange(4)[None, :, None]
    lanes["clock_lead"] = [0.0, 0.1, 0.2, 0.3]
    lanes["accuses"][FAILED - 1, (A, C, D), B] = LaneTest.COMMANDS
    lanes["health"][FAILED:, B], lanes["failed_for"][FAILED:, B] = Health.FAILED, LaneTest.COMMANDS
    lanes["link"][SILENT:, (A, C, D), B] = LinkState.FAILED
    lanes["outvoted"][150, A, D] = 1
    lanes["command_pattern"][120:, A, 0] = Pattern.P1_1
    lanes["command_decided_by"][130:, A, 0] = DecidedBy.UNRESOLVED
    lanes["leads"][200:] = 0
    return Table(new_block(FRAMES), block, np.zeros(FRAMES, TIMING))


def changed(found: list[Changes], path: str) -> list[tuple[int, str]]:
    return [
        (int(k), state) for each in found if each.path == path for k, state in zip(each.rows, each.states, strict=True)
    ]


def test_lanes_say_which_computer_failed_when_for_what_and_who_leads(moved: Table) -> None:
    found = list(computers.SHOWN.changes(moved, None))
    assert changed(found, "/lane_A") == [(0, "ENGAGED")]
    assert changed(found, "/lane_B") == [(0, "ENGAGED"), (FAILED, "FAILED_COMMANDS")]
    assert changed(found, "/lane_B/reported_by") == [(0, "NONE"), (FAILED - 1, "BY_ACD"), (FAILED, "NONE")]
    assert changed(found, "/leading_lane") == [(0, "A"), (200, "BACKUP")]


def test_lanes_say_which_links_and_votes_of_commands_were_not_in_order(moved: Table) -> None:
    found = list(computers.SHOWN.changes(moved, None))
    assert changed(found, "/B_to_C") == [(0, "FRESH"), (SILENT, "FAILED")]
    assert changed(found, "/C_to_B") == [(0, "FRESH")]
    assert changed(found, "/D_to_A") == [(0, "FRESH"), (150, "OUTVOTED"), (151, "FRESH")]
    assert changed(found, "/vote_elevator") == [(0, "NORMAL"), (120, "P1_1"), (130, "UNRESOLVED"), (200, "NORMAL")]
    assert changed(found, "/vote_aileron") == [(0, "NORMAL")]


def test_every_state_of_a_strip_has_a_look_and_red_is_for_failures_alone() -> None:
    for strip in computers.STRIPS:
        assert set(strip.states.values()) - strip.looks.keys() <= {"FAILED"}  # for no test, or by command: never
        red = {label for label, color in strip.looks.values() if color == servos.FAILED}
        assert all(label.startswith("failed") for label in red)


def test_computers_that_are_not_fitted_are_left_out() -> None:
    assert [strip.path for strip in computers.fitted(computers.HEALTH, 2)] == ["/lane_A", "/lane_B"]
    assert [strip.path for strip in computers.fitted(computers.OF_LINKS, 2)] == ["/A_to_B", "/B_to_A"]
    assert len(computers.fitted(computers.OF_LINKS, 4)) == len(LINKS)


def test_the_list_of_a_computer_has_angles_in_degrees_the_throttle_and_its_clock(moved: Table) -> None:
    shown, rows = computers.values(moved, C), moved.lane[:, C]
    expected = [*np.degrees(rows["surface"][:, :3]).T, rows["surface"][:, 3], rows["clock_lead"]]
    np.testing.assert_allclose(shown.T, expected)
    assert computers.NAMES[:4] == SURFACES


def test_the_headline_names_computer_delay_and_accusers_and_the_tab_shows_these_seconds(moved: Table) -> None:
    rows = new_block(FRAMES)
    rows["acting"][ONSET:, 0] = 1
    facts, told = look(FACTS, Table(rows, moved.beside), HZ, True)
    silent = "link B to A, C, D failed at 1.04 s, 40 ms after onset, by message timeout"
    failed = "computer B failed at 1.05 s, 50 ms after onset, by lanes A, C and D in the vote of commands"
    assert told == f"SURVIVED: {silent}; {failed}"
    assert facts.seen is not None and facts.seen.isolated_s == 1.04
    assert facts.seen.lanes_s == pytest.approx((0.5, 2.04))


def test_a_channel_that_fails_with_its_computer_has_that_fault_on_it() -> None:
    assert STOP.acts_on("pitch_rate", B + 1) and not STOP.acts_on("pitch_rate", A + 1)


def test_a_saved_recording_has_the_lanes_and_lists_of_the_log(moved: Table, tmp_path: Path) -> None:
    with LogWriter(tmp_path / "flight.mcap", HZ, {}, parts=("computer",)) as writer:
        writer.write(moved)
    save(read([tmp_path / "flight.mcap"]), tmp_path / "opened.rrd")
    rows: dict[str, int] = {}
    for chunk in RrdReader(tmp_path / "opened.rrd").stream():
        rows[chunk.entity_path] = rows.get(chunk.entity_path, 0) + chunk.to_record_batch().num_rows
    assert [rows[computers.topic(i)] for i in range(4)] == [FRAMES] * 4
    assert (rows["/lane_B"], rows["/leading_lane"], rows["/D_to_A"]) == (2, 2, 3)


def test_the_tab_is_there_for_flights_with_several_computers_alone() -> None:
    blueprint(Layout((Shown(facts=FACTS),), COMPUTERS))
    with pytest.raises(BadInput, match=r"no tab .computers.: no flight had \[computers\] count of 2 or more"):
        blueprint(Layout((Shown(),), COMPUTERS))


def page(row: Table) -> dict[str, str]:
    screen = Console(file=io.StringIO(), record=True, width=120)
    screen.print(Page().draw(row, HZ))
    return {line.split("  ")[0]: line for line in screen.export_text().splitlines()}


def test_the_terminal_marks_the_computer_that_failed_and_says_for_what_and_whose_messages_miss(
    moved: Table,
) -> None:
    lines = page(moved[140:141])
    assert lines["computers"].split() == ["computers", "A", "Bx", "C", "D", "A", "3", "B", "vote", "of", "commands"]
    told = "messages received 3 0x 3 3 B to A failed, B to C failed and 1 more"
    assert " ".join(lines["messages received"].split()) == told
    assert lines["elevator command"].count("x") == 1 and lines["elevator command"].split()[-2:] == ["1:1", "unresolved"]
    assert "normal" in lines["throttle command"]


def test_the_terminal_says_that_the_back_up_flies(moved: Table) -> None:
    assert page(moved[-1:])["computers"].split()[5:8] == ["none", "3", "back-up"]


def test_a_servo_channel_that_its_failed_computer_has_shut_off_counts_as_off() -> None:
    rows = Table(new_block(1), second_rows(1))
    rows.servo["valve"][:, 0, B] = 1
    found = list(servos.SHOWN.changes(rows, None))
    assert changed(found, "/elevator/channel_2") == [(0, "WITH_COMPUTER")]
    assert changed(found, "/elevator/moved_by") == [(0, "HELD_3")]
    assert page(rows)["elevator servo"].split()[-3:] == ["3", "2", "computer"]
