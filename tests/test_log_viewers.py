"""The log opens in Rerun through its own importer, with every field of a signal under its name."""

from datetime import timedelta

import pytest
from test_log_writer import random_block, write

from rig.core.frame import SIGNALS, State
from rig.flight.events import Event

chunks = pytest.importorskip("rerun.chunk")
FRAMES = 120


@pytest.fixture(scope="module")
def columns(tmp_path_factory):
    """Values of each component of each entity, as Rerun's importer makes them."""
    path = tmp_path_factory.mktemp("log") / "a.mcap"
    write(path, FRAMES, [Event(7, "warning", "channel failed", "pitch_rate: channel 4")])
    found = {}
    for chunk in chunks.McapReader(path, timeline_type="duration").stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            found.setdefault((str(chunk.entity_path), name), []).extend(batch.column(name).to_pylist())
    return found


@pytest.mark.parametrize("signal", SIGNALS, ids=lambda s: s.name)
def test_each_signal_is_one_component_with_the_values_that_were_flown(columns, signal):
    messages = columns[signal.topic, "rig.Signal:message"]
    i = SIGNALS.index(signal)
    block = random_block(FRAMES)
    assert len(messages) == FRAMES
    for row, (message,) in zip(block, messages, strict=True):
        for c in range(4):
            assert repr(message[f"ch_{c + 1}"]) == repr(float(row["channels"][i, c]))
            assert message[f"st_{c + 1}"]["name"] == State(row["state"][i, c]).name
        assert message["trend_high"] == row["trend_high"][i]


def test_time_begins_at_zero(columns):
    times = columns["/signal/heading", "message_log_time"]
    assert [t // timedelta(microseconds=1) for t in times] == [10_000 * k for k in range(FRAMES)]


def test_pose_position_and_events_become_what_rerun_shows(columns):
    names = {name for entity, name in columns if entity in ("/pose", "/position", "/events")}
    assert {"Transform3D:quaternion", "Transform3D:translation", "GeoPoints:positions"} <= names
    assert columns["/events", "TextLog:text"] == [["pitch_rate: channel 4"]]
