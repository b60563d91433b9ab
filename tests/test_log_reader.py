"""What was logged comes back bit for bit, or not at all."""

import hashlib
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from test_log_writer import RATE, random_block, random_timing, summary_of, write

import rig
from rig.core.errors import BadInput, BadLog
from rig.core.frame import FLAT, INDEX, TIMING, Table
from rig.flight.events import Event
from rig.log import LogFile, iter_chunks, log_file, read_log, schema
from rig.log.decode import Damaged
from rig.log.scan import About, iter_parts
from rig.log.writer import LogWriter

EVENTS = (
    Event(3, "info", "fault on", "stuck: channel 2"),
    Event(150, "warning", "größer", ""),
    Event(150, "error", "c", "d"),
)


@given(frames=st.integers(0, 330), seed=st.integers(0, 2**32))
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_field_of_every_frame_comes_back_bit_for_bit(tmp_path, frames, seed):
    block, timing = write(tmp_path / "a.mcap", frames, seed=seed)
    log = read_log(tmp_path / "a.mcap")
    assert log.rows.dtype == FLAT
    assert log.rows.tobytes() == block.tobytes()
    assert log.timing.dtype == TIMING
    assert log.timing.tobytes() == timing.tobytes()


def test_every_element_of_a_frame_has_exactly_one_place_in_the_log():
    """Counted from the dtype, not from what the layout makes of it."""
    elements = {name: int(np.prod(FLAT[name].shape)) for name in FLAT.fields or () if name != "frame"}
    found = dict.fromkeys(elements, 0)
    for topic in schema.FRAME_TOPICS:
        for field in schema.MESSAGES.get(topic.message, ()):
            if field.source in found:
                found[field.source] += 1
    assert found == elements


def test_a_log_tells_all_that_was_said(tmp_path):
    write(tmp_path / "a.mcap", 250, EVENTS, result={"survived": "true", "digest": "00ff"})
    log = read_log(tmp_path / "a.mcap")
    assert log.events == list(EVENTS)
    assert log.metadata == {"scenario": "{}", "schema_version": str(schema.SCHEMA_VERSION), "rate_hz": "100.0"}
    assert log.result == {"survived": "true", "digest": "00ff"}
    assert log.scenario_text == "duration_s = 1\n"
    assert log.rate_hz == RATE


def test_a_log_without_result_or_attachment_says_none(tmp_path):
    with LogWriter(tmp_path / "a.mcap", 60.0, {}) as log:
        log.write(Table(random_block(7), timing=random_timing(7)))
    read = read_log(tmp_path / "a.mcap")
    assert (read.result, read.scenario_text, read.rate_hz, len(read.rows)) == (None, None, 60.0, 7)


def test_events_without_frames_are_kept(tmp_path):
    with LogWriter(tmp_path / "a.mcap", RATE, {}) as log:
        log.write(Table(random_block(0), timing=random_timing(0)), EVENTS[:1])
    assert [e.text for e in read_log(tmp_path / "a.mcap").events] == [EVENTS[0].text]


@pytest.mark.parametrize(("held", "decoded"), [(2**30, 1), (0, 3)])
def test_a_log_that_can_be_held_is_decoded_once(tmp_path, monkeypatch, held, decoded):
    block, _ = write(tmp_path / "a.mcap", 330)
    calls = []
    monkeypatch.setattr(log_file, "iter_parts", lambda *args: calls.append(args) or iter_parts(*args))
    monkeypatch.setattr(log_file, "HELD_BYTES", held)
    log = LogFile.open(tmp_path / "a.mcap")
    assert b"".join(part.rows.tobytes() for part in log.blocks()) == block.tobytes()
    table = log.table(("frame", "voted"))
    assert (table["voted"].tobytes(), table.timing is None) == (block["voted"].tobytes(), held == 0)
    assert len(calls) == decoded and log.frames == 330 and log.complete


def test_a_long_log_is_read_a_second_at_a_time(tmp_path):
    block, _ = write(tmp_path / "a.mcap", 250, EVENTS)
    parts = list(iter_chunks(tmp_path / "a.mcap"))
    assert [len(rows) for rows, _, _ in parts] == [100, 100, 50]
    assert b"".join(rows.tobytes() for rows, _, _ in parts) == block.tobytes()
    assert [len(events) for _, _, events in parts] == [1, 2, 0]


@pytest.mark.parametrize("content", [b"", b"\x89MCAP", b"time,alpha\n0,1\n" * 100])
def test_what_is_no_mcap_is_refused(tmp_path, content):
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(BadLog, match="not an MCAP file"):
        read_log(path)


@pytest.mark.parametrize("name", ["missing.mcap", "."])
def test_a_missing_file_or_a_folder_is_refused(tmp_path, name):
    with pytest.raises(BadLog, match=r"no such file|is a folder"):
        read_log(tmp_path / name)


def test_a_foreign_mcap_is_refused(tmp_path):
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/odometry", "json", writer.register_schema("o", "jsonschema", b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    with pytest.raises(BadLog, match="not a log of this rig"):
        read_log(path)


@pytest.mark.parametrize("version", [schema.OLDEST - 1, schema.SCHEMA_VERSION + 1])
def test_another_schema_is_refused_with_both_versions(tmp_path, monkeypatch, version):
    monkeypatch.setattr("rig.log.writer.SCHEMA_VERSION", version)
    write(tmp_path / "a.mcap", 5)
    with pytest.raises(
        BadLog, match=rf"schema version {version} .*this one reads {schema.OLDEST} to {schema.SCHEMA_VERSION}"
    ):
        read_log(tmp_path / "a.mcap")


def test_the_present_schema_is_the_one_of_the_history():
    """Who changes a message gives the schema a new version, and the history in docs/reference/log.md a line."""
    text = "".join(
        f"{topic.name} {topic.message} {schema.descriptors(topic.message).SerializeToString(deterministic=True).hex()}"
        for topic in schema.TOPICS
        if topic.message in schema.MESSAGES
    )
    fingerprint = hashlib.sha256(text.encode()).hexdigest()[:12]
    history = (Path(__file__).parent.parent / "docs" / "reference" / "log.md").read_text()
    assert f"| {schema.SCHEMA_VERSION} | `{fingerprint}` |" in history


def test_a_signal_of_a_log_is_read_as_arrays(tmp_path):
    block, _ = write(tmp_path / "a.mcap", 40)
    log = rig.read_log(tmp_path / "a.mcap")
    heading, wheels = log.signal("heading"), log.discrete("weight_on_wheels")
    assert heading.channels.tobytes() == block["channels"][:, INDEX["heading"]].tobytes()
    assert heading.reference.tobytes() == block["reference"][:, INDEX["heading"]].tobytes()
    assert wheels.state.tobytes() == block["discrete_state"][:, 0].tobytes()
    assert heading.time_s.tolist() == wheels.time_s.tolist() == log.time_s.tolist() == [k / 100 for k in range(40)]
    with pytest.raises(BadInput, match="unknown signal 'haeding', nearest: heading"):
        log.signal("haeding")
    with pytest.raises(BadInput, match="unknown discrete 'heading'"):
        log.discrete("heading")


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (b"/signal/heading", b"/signal/Heading", "/signal/heading is /signal/Heading"),
        (b"trend_high", b"trend_higH", "the fields of rig.Signal are not"),
    ],
)
def test_a_log_of_other_signals_is_refused_by_name(tmp_path, old, new, says):
    path = tmp_path / "a.mcap"
    write(path, 5)
    path.write_bytes(path.read_bytes().replace(old, new))
    with pytest.raises(BadLog, match=says):
        read_log(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "whole.mcap"
    write(path, 23, EVENTS[:1], rate=10.0, result={"survived": "true"})
    return path


@given(bit=st.integers(0, 2**32))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_flipped_bit_is_noticed(tmp_path, whole, bit):
    damaged = bytearray(whole.read_bytes())
    damaged[bit // 8 % len(damaged)] ^= 1 << bit % 8
    path = tmp_path / "a.mcap"
    path.write_bytes(damaged)
    with pytest.raises(BadLog) as caught:
        read_log(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_any_flipped_bit_of_the_first_and_the_last_bytes_is_noticed(tmp_path, whole):
    path, content = tmp_path / "a.mcap", whole.read_bytes()
    for at in [*range(40), *range(len(content) - 60, len(content))]:
        damaged = bytearray(content)
        damaged[at] ^= 1 << at % 8
        path.write_bytes(damaged)
        with pytest.raises(BadLog):
            read_log(path)


@given(number=st.integers(0, 2**32))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_cut_is_noticed_and_recovery_is_named(tmp_path, whole, number):
    path, content = tmp_path / "a.mcap", whole.read_bytes()
    cut = 8 + number % (len(content) - 8)
    path.write_bytes(content[:cut])
    with pytest.raises(BadLog, match=f"truncated at byte {cut}; rig recover"):
        read_log(path)


@pytest.mark.parametrize("number", [0, 1, 12, 23, 24])
def test_all_before_a_damaged_chunk_is_given_in_order_and_nothing_of_what_comes_after(tmp_path, number):
    """More chunks than are decoded ahead; the result, which stands behind them, must not be known either."""
    path = tmp_path / "a.mcap"
    block, _ = write(path, 2500, rate=100.0, result={"survived": "true"})
    content = bytearray(path.read_bytes())
    chunk = sorted(summary_of(path).chunk_indexes, key=lambda index: index.chunk_start_offset)[number]
    content[chunk.chunk_start_offset + chunk.chunk_length // 2] ^= 1
    path.write_bytes(content)
    about = About()
    given = iter_parts(path, about)
    assert b"".join(next(given).rows.tobytes() for _ in range(number)) == block[: number * 100].tobytes()
    with pytest.raises(Damaged, match=f"damaged at byte {chunk.chunk_start_offset}: "):
        next(given)
    assert list(given) == [] and about.result is None


def test_a_pipe_without_a_writer_is_refused_instead_of_waited_for(tmp_path: Path):
    os.mkfifo(tmp_path / "x.mcap")
    with pytest.raises(BadLog, match="is a pipe"):
        read_log(tmp_path / "x.mcap")


@pytest.mark.parametrize("command", [["info"], ["score"], ["report"], ["replay"], ["export", "--to", "csv"]])
def test_an_output_of_rig_vote_is_called_what_it_is(tmp_path: Path, rig_command, command: list[str]):
    (tmp_path / "c.toml").write_text("[default]\nthreshold = 0.03\n")
    channels = Path(__file__).parents[1] / "docs" / "examples" / "channels.csv"
    name, *options = command
    assert rig_command("vote", channels, "--config", "c.toml", "--out", "v.mcap")[0] == 0
    code, _, err = rig_command(name, "v.mcap", *options)
    assert code == 2 and "v.mcap: an output of rig vote, no log of a flight: rig view shows it" in err
