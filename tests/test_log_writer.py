"""What the writer writes must be read, byte for byte, by readers that we did not write."""

import errno
import math
import resource
import subprocess
import sys
import tracemalloc
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.reader import make_reader
from mcap.records import Chunk, Message, MessageIndex
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from rig.core.errors import BadInput, RigError
from rig.core.frame import DISCRETES, FLIGHT_INDEX, SIGNALS, TIMING, DecidedBy, Ilm, Pattern, State, Table, new_block
from rig.flight.events import Event
from rig.log import read_log, recover
from rig.log.chunk_layout import ROW, log_times
from rig.log.container import Container
from rig.log.of_flight import metadata_before, new_log
from rig.log.schema import FRAME_TOPICS, MESSAGES, POSE_TOPICS, SCHEMA_VERSION
from rig.log.writer import LogWriter
from rig.scenario.scenario import load

RATE = 100.0
U1_LIMITS = {"state": 4, "discrete_state": 4, "ilm": 3, "pattern": 7, "decided_by": 7, "law": 3, "end": 8}
U1_LIMITS |= {"discrete_ilm": U1_LIMITS["ilm"]}
WHOLE_BYTE = ("trend_high", "trend_low", "acting")


def random_block(frames, seed=0, first=0):
    """Every field anything that it may be, NaN and infinities included."""
    rng = np.random.default_rng(seed)
    block = new_block(frames, first)
    for name in (n for n in block.dtype.fields or () if n != "frame"):
        shape = block[name].shape
        if block[name].dtype == "f8":
            block[name] = rng.integers(0, 2**64, shape, np.uint64).view("f8")
        else:
            top = 256 if name in WHOLE_BYTE else U1_LIMITS.get(name, 2)
            block[name] = rng.integers(0, top, shape)
    return block


def random_timing(frames, seed=0):
    timing = np.zeros(frames, TIMING)
    timing["frame_us"] = np.random.default_rng(seed).normal(200.0, 20.0, frames)
    return timing


def write(path, frames, events=(), seed=0, rate=RATE, result=None):
    """A log of ``frames`` random frames, a block a second; returns the block."""
    block, timing = random_block(frames, seed), random_timing(frames, seed)
    second = int(rate)
    with LogWriter(path, rate, {"scenario": "{}"}, [("flight.toml", b"duration_s = 1\n")]) as log:
        for start in range(0, frames, second):
            part = slice(start, start + second)
            log.write(Table(block[part], timing=timing[part]), [e for e in events if start <= e.frame < start + second])
        log.close(result)
    return block, timing


def test_the_stock_reader_reads_every_message_and_the_counts_agree(tmp_path):
    events = [
        Event(3, "info", "fault on", "stuck"),
        Event(120, "error", "lost", "pitch_rate"),
        Event(120, "info", "b", ""),
    ]
    write(tmp_path / "a.mcap", 250, events)
    counts = {}
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for _, channel, message in reader.iter_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            assert message.log_time == message.publish_time == message.sequence * 10_000_000
    statistics = summary_of(tmp_path / "a.mcap").statistics
    assert statistics is not None
    every_fourth = 25 + 25 + 13  # of the frames of each chunk
    poses = {topic.name: every_fourth for topic in POSE_TOPICS}
    assert counts == {topic.name: 250 for topic in FRAME_TOPICS} | poses | {"/events": 3}
    assert statistics.message_count == sum(counts.values())
    assert (statistics.message_start_time, statistics.message_end_time) == (0, 2_490_000_000)
    assert statistics.chunk_count == 3


def test_a_streaming_reader_finds_the_checksums_right_and_each_topic_in_the_order_of_time(tmp_path):
    write(tmp_path / "a.mcap", 230)
    times = {}
    with (tmp_path / "a.mcap").open("rb") as file:
        for record in StreamReader(file, validate_crcs=True).records:
            if isinstance(record, Message):
                times.setdefault(record.channel_id, []).append(record.log_time)
    every = [k * 10_000_000 for k in range(230)]
    poses = every[:100:4] + every[100:200:4] + every[200::4]
    assert list(times.values()) == [every] * len(FRAME_TOPICS) + [poses] * len(POSE_TOPICS)


def test_the_stock_reader_seeks_to_a_time_and_a_topic(tmp_path):
    write(tmp_path / "a.mcap", 120, [Event(5, "info", "x", "y")])
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        heading = [m.sequence for _, _, m in reader.iter_messages("/signal/heading", starting_at=1_050_000_000)]
        events = [m.sequence for _, _, m in reader.iter_messages("/events")]
    assert heading == list(range(105, 120))
    assert events == [5]


def test_every_entry_of_the_message_indexes_leads_to_its_message(tmp_path):
    """MCAP: an entry is the log time of a message and its offset in the chunk before compression."""
    write(
        tmp_path / "a.mcap",
        120,
        [Event(5, "info", "x", "y"), Event(9, "error", "x", "longer"), Event(101, "info", "", "")],
    )
    content, entries = (tmp_path / "a.mcap").read_bytes(), 0
    for index in summary_of(tmp_path / "a.mcap").chunk_indexes:
        begin = index.chunk_start_offset + 9
        chunk = Chunk.read(ReadDataStream(BytesIO(content[begin : begin + index.chunk_length - 9])))
        data = zstandard.decompress(chunk.data)
        for channel, at in index.message_index_offsets.items():
            assert content[at] == 7  # the opcode of a MessageIndex
            found = MessageIndex.read(ReadDataStream(BytesIO(content[at + 9 :])))
            assert found.channel_id == channel
            for time, offset in found.records:
                message = Message.read(ReadDataStream(BytesIO(data[offset + 9 :])), 30)
                assert (data[offset], message.channel_id, message.log_time) == (5, channel, time)
            entries += len(found.records)
    assert entries == 120 * len(FRAME_TOPICS) + (25 + 5) * len(POSE_TOPICS) + 3


def summary_of(path):
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    return summary


def decoded(path, topic):
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [message for _, _, _, message in reader.iter_decoded_messages(topic)]


@pytest.mark.parametrize("i", [0, len(SIGNALS) - 1])
def test_protobuf_decodes_a_signal_to_the_rows(tmp_path, i):
    block, _ = write(tmp_path / "a.mcap", 40)
    messages = decoded(tmp_path / "a.mcap", SIGNALS[i].topic)
    for row, message in zip(block, messages, strict=True):
        for c in range(4):
            np.testing.assert_equal(getattr(message, f"ch_{c + 1}"), row["channels"][i, c])
            assert getattr(message, f"valid_{c + 1}") == bool(row["valid"][i, c])
            assert enum_name(message, f"st_{c + 1}") == State(row["state"][i, c]).name
            assert enum_name(message, f"ilm_{c + 1}") == Ilm(row["ilm"][i, c]).name
        for name in ("voted", "truth", "reference"):
            np.testing.assert_equal(getattr(message, name), row[name][i])
        for name in ("level", "trend_high", "trend_low", "reference_usable"):
            assert getattr(message, name) == row[name][i]
        assert enum_name(message, "pattern") == Pattern(row["pattern"][i]).name
        assert enum_name(message, "decided_by") == DecidedBy(row["decided_by"][i]).name


def enum_name(message, field):
    described = message.DESCRIPTOR.fields_by_name[field].enum_type
    return described.values_by_number[getattr(message, field)].name


def test_protobuf_decodes_every_other_topic_to_the_rows(tmp_path):
    block, timing = write(tmp_path / "a.mcap", 20)
    for topic in FRAME_TOPICS:
        if topic.message not in ("rig.Discrete", "rig.Control", "rig.AutopilotCommand", "rig.Flight", "rig.Timing"):
            continue
        messages = decoded(tmp_path / "a.mcap", topic.name)
        source = timing if topic.message == "rig.Timing" else block
        for row, message in zip(source, messages, strict=True):
            for field in MESSAGES[topic.message]:
                value = row[field.source]
                value = value if topic.item is None else value[topic.item]
                np.testing.assert_equal(getattr(message, field.name), value[field.index])
    assert len(decoded(tmp_path / "a.mcap", DISCRETES[-1].topic)) == 20


def euler_quaternion(roll, pitch, yaw):
    """Body axes in north-east-down axes (w, x, y, z)."""
    cr, sr, cp, sp, cy, sy = (f(a / 2) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def rotated(q, vector):
    """``vector`` turned by the quaternion, in plain vector algebra."""
    axis, vector = np.array([q.x, q.y, q.z]), np.array(vector)
    return vector + 2 * np.cross(axis, np.cross(axis, vector) + q.w * vector)


def test_pose_and_position_say_where_the_aircraft_is_and_points(tmp_path):
    roll, pitch, yaw = 0.3, 0.2, 1.1
    block = new_block(1, first_frame=12_345_678)
    flight = block["flight"][0]
    for name, value in zip("wxyz", euler_quaternion(roll, pitch, yaw), strict=True):
        flight[FLIGHT_INDEX[f"quaternion_{name}"]] = value
    known = {"north_m": 10.0, "east_m": 20.0, "altitude_m": 300.0, "latitude_rad": 0.8, "longitude_rad": -2.0}
    for name, value in known.items():
        flight[FLIGHT_INDEX[name]] = value
    path = tmp_path / "a.mcap"
    with LogWriter(path, RATE, {}) as log:
        log.write(Table(block, timing=np.zeros(1, TIMING)))
    (pose,) = decoded(path, "/pose")
    forward = [math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch), math.sin(pitch)]  # east, north, up
    np.testing.assert_allclose(rotated(pose.rotation, [1, 0, 0]), forward, atol=1e-12)
    # Left wing: up when rolling right, by sin(roll) cos(pitch).
    np.testing.assert_allclose(rotated(pose.rotation, [0, 1, 0])[2], math.sin(roll) * math.cos(pitch), atol=1e-12)
    assert (pose.translation.x, pose.translation.y, pose.translation.z) == (20.0, 10.0, 300.0)
    assert pose.timestamp.ToNanoseconds() == 123_456_780_000_000
    (fix,) = decoded(path, "/position")
    assert (fix.latitude, fix.longitude, fix.altitude) == (math.degrees(0.8), math.degrees(-2.0), 300.0)
    assert fix.timestamp.ToNanoseconds() == 123_456_780_000_000


def test_events_are_foxglove_logs(tmp_path):
    write(tmp_path / "a.mcap", 150, [Event(107, "warning", "channel failed", "pitch_rate: channel 4")])
    (message,) = decoded(tmp_path / "a.mcap", "/events")
    assert (message.name, message.message) == ("channel failed", "pitch_rate: channel 4")
    assert message.level == message.WARNING
    assert message.timestamp.ToNanoseconds() == 1_070_000_000


@pytest.mark.parametrize("rate", [100.0, 60.0, 119.88, 1.0, 997.0])
def test_time_is_exact_to_the_nanosecond_after_a_day(rate):
    frames = np.array([0, 1, 7, 8_640_000 - 1])
    exact = [round(int(f) * 10**9 / rate) for f in frames]
    assert log_times(frames, rate).tolist() == exact


def test_a_chunk_is_no_longer_than_two_seconds_unless_asked_nor_than_a_mebibyte(tmp_path):
    write(tmp_path / "a.mcap", 2500, rate=1000.0)
    with LogWriter(tmp_path / "b.mcap", 10.0, {}) as log:
        log.write(Table(random_block(50), timing=random_timing(50)))
    for name in "a", "b":
        indexes = summary_of(tmp_path / f"{name}.mcap").chunk_indexes
        assert len(indexes) > 2
        assert all(index.message_end_time - index.message_start_time < 2 * 10**9 for index in indexes)
        assert all(index.uncompressed_size <= 2**20 for index in indexes)
    with LogWriter(tmp_path / "c.mcap", 10.0, {}, chunk_frames=500) as log:
        assert 10 < log.chunk_frames < 500
        log.write(Table(random_block(500), timing=random_timing(500)))
    assert [index.uncompressed_size <= 2**20 for index in summary_of(tmp_path / "c.mcap").chunk_indexes] == [True, True]


def test_a_log_of_no_frames_is_a_log(tmp_path):
    with LogWriter(tmp_path / "a.mcap", RATE, {"seed": "1"}):
        pass
    with (tmp_path / "a.mcap").open("rb") as file:
        assert list(make_reader(file, validate_crcs=True).iter_messages()) == []
    assert len(read_log(tmp_path / "a.mcap").rows) == 0


def test_close_twice_and_abort_after_close_do_nothing(tmp_path):
    log = LogWriter(tmp_path / "a.mcap", RATE, {})
    log.close({"survived": "true"})
    size = (tmp_path / "a.mcap").stat().st_size
    log.close({"survived": "false"})
    log.abort()
    assert (tmp_path / "a.mcap").stat().st_size == size
    with pytest.raises(RigError, match="closed"):
        log.write(Table(random_block(1), timing=random_timing(1)))


def test_each_chunk_is_in_the_file_when_write_returns(tmp_path):
    log = LogWriter(tmp_path / "a.mcap", RATE, {})
    before = (tmp_path / "a.mcap").stat().st_size
    log.write(Table(random_block(100), timing=random_timing(100)))
    assert (tmp_path / "a.mcap").stat().st_size > before + 50_000
    log.abort()


def test_a_value_that_does_not_fit_is_refused_by_name(tmp_path):
    block = random_block(10)
    block["level"][4, 2] = 128
    with LogWriter(tmp_path / "a.mcap", RATE, {}) as log, pytest.raises(RigError, match="level above 127"):
        log.write(Table(block, timing=random_timing(10)))


@pytest.mark.parametrize("path", ["missing/a.mcap", ".", "/dev/full"])
def test_a_log_that_cannot_be_made_is_bad_input_before_the_flight(tmp_path, path):
    if path == "/dev/full" and not Path(path).exists():
        pytest.skip("no /dev/full")
    with pytest.raises(BadInput, match="the log cannot be written"):
        LogWriter(tmp_path / path, RATE, {})


def test_a_full_disk_ends_the_log_with_what_it_holds(tmp_path):
    path = tmp_path / "a.mcap"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    log = LogWriter(path, RATE, {"seed": "1"}, [("flight.toml", b"")])
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, limits[1]))
    try:
        with pytest.raises(RigError, match=r"disk full .*flight stopped at \d+\.990 s; the log is complete"):
            for k in range(100):
                log.write(Table(random_block(100, k, 100 * k), timing=random_timing(100)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    read = read_log(path)
    assert 100 <= len(read.rows) < 1000
    assert read.rows[:100].tobytes() == random_block(100, 0).tobytes()


def test_a_disk_that_is_full_from_the_first_byte_is_no_bad_input_and_leaves_no_folder(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Container, "_put", full)
    with pytest.raises(RigError, match=r"the log cannot be written: No space left on device") as error:
        new_log(tmp_path / "new" / "logs", "s", load("f16_pitch_rate_hardover"), "")
    assert not isinstance(error.value, BadInput) and list(tmp_path.iterdir()) == []


def test_a_full_disk_that_takes_no_summary_is_said_to_need_recovery(tmp_path, monkeypatch):
    log = LogWriter(tmp_path / "a.mcap", RATE, {})

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Container, "_put", full)
    with pytest.raises(RigError, match=r"disk full .*run rig recover"):
        log.write(Table(random_block(10), timing=random_timing(10)))
    log.close()
    monkeypatch.undo()
    assert recover(tmp_path / "a.mcap", tmp_path / "b.mcap").frames == 0


KILLED = """
import os, sys
from test_log_writer import random_block, random_timing
from rig.core.frame import Table
from rig.log.writer import LogWriter
log = LogWriter(sys.argv[1], 100.0, {"seed": "1"})
for k in range(3):
    log.write(Table(random_block(100, k, 100 * k), timing=random_timing(100)))
os.kill(os.getpid(), 9)
"""


def test_a_killed_process_leaves_every_second_that_it_wrote(tmp_path):
    path = tmp_path / "a.mcap"
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], cwd=Path(__file__).parent, check=False)
    assert done.returncode == -9
    assert recover(path, tmp_path / "b.mcap").frames == 300


def test_memory_does_not_grow_with_the_flight(tmp_path):
    rows, timing, events = random_block(0), random_timing(0), [Event(1, "info", "name", "text")]
    with LogWriter(tmp_path / "a.mcap", 2.0, {}) as log:
        log.write(Table(rows, timing=timing), events)
        tracemalloc.start()
        for _ in range(1000):  # 17 minutes at a chunk a second
            log.write(Table(rows, timing=timing), events)
        grown, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert grown < 1000 * 450  # what the summary needs of a chunk
    assert peak < grown + 2**20


def test_noisy_frames_cost_at_most_1500_bytes_each_on_disk(tmp_path):
    """Sixteen signals, noise of 4 steps of a binary fraction, three in four with a reference; all else irrational."""
    rng = np.random.default_rng(0)
    frames = 300
    block = new_block(frames)
    t = np.arange(frames) / RATE
    for i, signal in enumerate(SIGNALS):
        step = 2.0 ** np.round(np.log2((signal.high - signal.low) / 2**15))
        truth = (signal.low + signal.high) / 2 + step * 2000 * np.sin(t * (1 + i / 7))
        channels = np.round((truth[:, None] + rng.normal(0, 4 * step, (frames, 4))) / step) * step
        block["truth"][:, i], block["channels"][:, i] = truth, channels
        block["voted"][:, i] = np.sort(channels, axis=1)[:, 1:3].mean(axis=1)
        block["reference"][:, i] = truth + rng.normal(0, step, frames) if i % 4 else np.nan
    for name in ("flight", "command", "surface"):
        block[name] = np.cumsum(rng.normal(size=block[name].shape), axis=0)
    block["trend_high"] = rng.integers(0, 8, block["trend_high"].shape)
    path = tmp_path / "a.mcap"
    with LogWriter(path, RATE, {}) as log:
        empty = path.stat().st_size
        for k in range(0, frames, 100):
            log.write(Table(block[k : k + 100], timing=random_timing(100, k)))
    assert (path.stat().st_size - empty) / frames < 1500
    assert ROW < 4000


def test_metadata_and_attachments_are_found_by_the_stock_reader(tmp_path):
    write(tmp_path / "a.mcap", 5, result={"survived": "true"})
    with (tmp_path / "a.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
        (attachment,) = reader.iter_attachments()
    assert metadata["rig"] == {"scenario": "{}", "schema_version": str(SCHEMA_VERSION), "rate_hz": "100.0"}
    assert metadata["result"] == {"survived": "true"}
    assert (attachment.name, attachment.data) == ("flight.toml", b"duration_s = 1\n")
    channels = {c.topic: c.metadata for c in summary_of(tmp_path / "a.mcap").channels.values()}
    assert channels["/signal/heading"]["unit"] == "rad"


def test_metadata_that_are_no_text_are_refused_before_a_unit_starts(tmp_path: Path):
    scenario = load(None).model_copy(update={"title": "odd\udce9"})
    with pytest.raises(BadInput, match="logs cannot be kept there"):
        metadata_before(scenario, tmp_path)
