"""Servo actuators in the viewer and on the terminal: which channel was shut off, when, by whom."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import McapReader, RrdReader
from rich.console import Console

from rig.core.errors import BadInput
from rig.core.frame import MOVED, SERVO_FIELDS, TIMING, ActuatorMonitor, Table, new_block, second_rows
from rig.core.frame.fields import elements
from rig.log.schema import PART_TOPICS
from rig.log.writer import LogWriter
from rig.show.terminal.redundancy_page import Page
from rig.show.viewer import servo_series as servos
from rig.show.viewer.blueprint import SERVOS, blueprint
from rig.show.viewer.facts import Facts, FaultFact, Layout, Shown
from rig.show.viewer.opened import read, save
from rig.show.viewer.rerun_columns import struct
from rig.show.viewer.state_strips import Changes
from rig.show.viewer.story import look

HZ, FRAMES, ONSET, FAILED = 100.0, 300, 100, 104
ELEVATOR, RUDDER = 0, 2
FACTS = Facts("a flight", {"pitch_rate": 1.0}, (FaultFact("coil", "actuator.elevator", (2,), 1.0),), servos=True)


@pytest.fixture(scope="module")
def moved() -> Table:
    """Channel 2 of the elevator is shut off by its current; the rudder is bypassed at the end."""
    block, rng = second_rows(FRAMES), np.random.default_rng(1)
    block["frame"] = np.arange(FRAMES)
    for name in ("asked", "lvdt", "ram", "ram_model", "current", "spool", "spool_model", "pressure"):
        block["servo"][name] = rng.uniform(-0.1, 0.1, block["servo"][name].shape)
    block["servo"]["failed_by"][FAILED:, ELEVATOR, 1] = ActuatorMonitor.CURRENT
    block["servo"]["bypassed"][200:, RUDDER] = 1
    return Table(new_block(FRAMES), block, np.zeros(FRAMES, TIMING))


@pytest.fixture(scope="module")
def log(moved: Table, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("servos") / "flight.mcap"
    with LogWriter(path, HZ, {}, parts=("servo",)) as writer:
        writer.write(moved)
    return path


def changed(found: list[Changes], path: str) -> list[tuple[int, str]]:
    return [
        (int(k), state) for each in found if each.path == path for k, state in zip(each.rows, each.states, strict=True)
    ]


def test_a_lane_says_when_a_channel_was_shut_off_and_by_whom(moved: Table) -> None:
    found = list(servos.SHOWN.changes(moved, None))
    assert changed(found, "/elevator/channel_2") == [(0, "NONE"), (FAILED, "CURRENT")]
    assert changed(found, "/elevator/channel_1") == [(0, "NONE")]
    assert changed(found, "/elevator/moved_by") == [(0, "HELD_4"), (FAILED, "HELD_3")]
    assert changed(found, "/rudder/moved_by") == [(0, "HELD_4"), (200, "BYPASSED")]


def test_the_list_of_a_surface_has_angles_in_degrees_and_shares_as_they_are(moved: Table) -> None:
    shown, rows = servos.values(moved, RUDDER), moved.servo[:, RUDDER]
    for name, expected in (
        ("ram", np.degrees(rows["ram"])),
        ("lvdt_3", np.degrees(rows["lvdt"][:, 2])),
        ("current_4", rows["current"][:, 3]),
        ("pressure_2", rows["pressure"][:, 1]),
    ):
        np.testing.assert_allclose(shown[:, servos.NAMES.index(name)], expected, rtol=1e-6)


def components(chunks: Any) -> dict[str, Any]:
    found: dict[str, list[Any]] = {}
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if chunk.entity_path.startswith("/actuator/") and "rig.Actuator:message" in batch.schema.names:
            found.setdefault(chunk.entity_path, []).append(batch["rig.Actuator:message"])
    return {path: pa.chunked_array(parts) for path, parts in found.items()}


def test_the_importer_makes_the_same_messages_of_our_log(log: Path, tmp_path: Path) -> None:
    save(read([log]), tmp_path / "opened.rrd")
    ours = components(RrdReader(tmp_path / "opened.rrd").stream())
    theirs = components(McapReader(log, timeline_type="duration").stream())
    assert ours.keys() == theirs.keys() == {servos.topic(surface) for surface in MOVED}
    for topic, values in ours.items():
        assert values.type == theirs[topic].type
        assert values.equals(theirs[topic])


def test_every_number_of_the_message_is_a_column(moved: Table) -> None:
    made = struct(moved.servo, PART_TOPICS["servo"][ELEVATOR])
    assert [field.name for field in made.type] == [name for field in SERVO_FIELDS for name, _ in elements(field)]


def test_the_headline_names_channel_delay_and_monitor_and_the_tab_shows_these_seconds(moved: Table) -> None:
    rows = new_block(FRAMES)
    rows["acting"][ONSET:, 0] = 1
    facts, told = look(FACTS, Table(rows, moved.beside), HZ, True)
    assert told == "SURVIVED: actuator.elevator, channel 2, shut off at 1.04 s, 40 ms after onset, by current"
    assert facts.seen is not None and facts.seen.isolated_s == 1.04
    assert facts.seen.coils_s == pytest.approx((0.5, 2.04))


def test_the_tab_is_there_for_flights_with_servos_alone() -> None:
    blueprint(Layout((Shown(facts=FACTS),), SERVOS))
    with pytest.raises(BadInput, match=r'no tab .actuators.: no flight had \[actuators\] model = "servo"'):
        blueprint(Layout((Shown(),), SERVOS))


def test_the_terminal_marks_the_channel_that_is_shut_off_and_says_by_whom(moved: Table) -> None:
    screen = Console(file=io.StringIO(), record=True, width=100)
    screen.print(Page().draw(moved[FAILED : FAILED + 1], HZ))
    lines = {line.split()[0]: line for line in screen.export_text().splitlines() if " servo " in line}
    assert lines.keys() == set(MOVED)
    assert lines["elevator"].count("x") == 1 and lines["elevator"].split()[-3:] == ["3", "2", "current"]
    assert lines["rudder"].count("x") == 0 and lines["rudder"].split()[-1] == "4"
