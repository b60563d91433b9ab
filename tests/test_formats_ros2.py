"""ROS 2 bags: values of rosbags' writer in SQLite and MCAP; instances, stamps, publishers; damage."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_logs import RosBag

from rig.core.errors import BadInput
from rig.log.recordings.formats.contents import Topic
from rig.log.recordings.formats.known import open_log
from rig.log.recordings.formats.ros2 import Ros2Log, publishers
from rig.log.recordings.read import read
from rig.log.recordings.vote_config import config_of

T0 = 1_700_000_000 * 10**9
STEP = 10_000_000


def written(path: Path, write: Callable[[RosBag], None], mcap: bool = False) -> Ros2Log:
    with RosBag(path, mcap) as bag:
        write(bag)
    log = open_log(path)
    assert isinstance(log, Ros2Log)
    return log


def changed(path: Path, *statements: str) -> None:
    with closing(sqlite3.connect(path)) as base, base:
        for statement in statements:
            base.execute(statement)


def topics(log: Ros2Log) -> dict[str, Topic]:
    return {topic.name: topic for topic in log.contents.topics}


def values(k: int, i: int) -> list[float]:
    return [k / 3 + i, -k / 7, 0.1, 1e-3 * k, 2.0, -9.81]


def two_imus(bag: RosBag, rows: int = 40) -> None:
    for k in range(rows):
        for i in (0, 1):
            bag.imu(f"/imu{i}", T0 + STEP * k + i, values(k, i), frame=("odd", "base_link")[i])


@pytest.mark.parametrize("mcap", [False, True], ids=["db3", "mcap"])
def test_values_and_stamps_are_those_that_rosbags_wrote(tmp_path: Path, mcap: bool):
    log = written(tmp_path / "bag", two_imus, mcap)
    names = ["angular_velocity.x", "angular_velocity.y", "angular_velocity.z"]
    names += ["linear_acceleration.x", "linear_acceleration.y", "linear_acceleration.z"]
    for i in (0, 1):
        topic = topics(log)[f"/imu{i}"]
        source = log.source(topic, names)
        assert (topic.rows, topic.device, topic.units[names[0]]) == (40, ("odd", "base_link")[i], "rad/s")
        for place, name in enumerate(names):
            np.testing.assert_array_equal(source.fields[name], [values(k, i)[place] for k in range(40)])
        np.testing.assert_allclose(source.time_s, (T0 + STEP * np.arange(40) + i) / 1e9, rtol=1e-16)


@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "abcd", "abcde", "abcdef", "abcdefg", "é"])
def test_numbers_are_found_behind_a_frame_of_any_length(tmp_path: Path, frame: str):
    def write(bag: RosBag) -> None:
        types = bag.store.types
        header = bag.header(T0, frame)
        bag.imu("/imu", T0, [1.5, 2.5, 3.5, 4.5, 5.5, 6.5], frame)
        field = types["sensor_msgs/msg/MagneticField"](
            header=header,
            magnetic_field=types["geometry_msgs/msg/Vector3"](1e-5, 2e-5, 3e-5),
            magnetic_field_covariance=np.arange(9.0),
        )
        bag.write("/mag", "MagneticField", T0, field)
        pressure = types["sensor_msgs/msg/FluidPressure"](header=header, fluid_pressure=101_325.5, variance=4.0)
        bag.write("/baro", "FluidPressure", T0, pressure)
        for k, status in enumerate((-1, 0, 2)):
            fix = types["sensor_msgs/msg/NavSatFix"](
                header=bag.header(T0 + k, frame),
                status=types["sensor_msgs/msg/NavSatStatus"](status=status, service=3),
                latitude=47.5,
                longitude=8.5,
                altitude=400.25,
                position_covariance=np.arange(9.0),
                position_covariance_type=2,
            )
            bag.write("/gps", "NavSatFix", T0 + k, fix)

    log = written(tmp_path / "bag", write)
    found = topics(log)

    def first(topic: str, field: str) -> Any:
        return log.source(found[topic], [field]).fields[field]

    assert first("/imu", "angular_velocity.y") == [2.5]
    assert first("/imu", "linear_acceleration.z") == [6.5]
    assert first("/mag", "magnetic_field.z") == [3e-5]
    assert first("/baro", "fluid_pressure") == [101_325.5]
    np.testing.assert_array_equal(first("/gps", "altitude"), [np.nan, 400.25, 400.25])
    assert found["/mag"].units["magnetic_field.x"] == "T"


def test_an_imu_that_measures_no_acceleration_has_none(tmp_path: Path):
    from rig.log.recordings.formats.cdr import KINDS, decoded

    written(tmp_path / "bag", two_imus)
    with closing(sqlite3.connect(tmp_path / "bag" / "bag.db3")) as base:
        (raw,) = base.execute("SELECT data FROM messages").fetchone()
    plain = decoded(raw, KINDS["sensor_msgs/msg/Imu"])
    at = raw.index(np.arange(20.0, 29.0).tobytes())
    none = decoded(raw[:at] + np.float64(-1.0).tobytes() + raw[at + 8 :], KINDS["sensor_msgs/msg/Imu"])
    assert none.values[:3] == plain.values[:3]
    assert np.isnan(none.values[3:]).all()


def test_messages_of_the_other_byte_order_are_read():
    import struct

    from rig.log.recordings.formats.cdr import KINDS, decoded

    raw = b"\0\0\0\0" + struct.pack(">iII3s", 5, 7, 3, b"ab\0") + bytes(1) + struct.pack(">2d", 9e4, 0.0)
    assert decoded(raw, KINDS["sensor_msgs/msg/FluidPressure"]) == (5_000_000_007, b"ab", [9e4])
    with pytest.raises(ValueError, match="encoding 0007"):
        decoded(b"\0\7" + raw[2:], KINDS["sensor_msgs/msg/FluidPressure"])


def test_a_file_without_its_folder_and_with_any_ending_is_read(tmp_path: Path):
    whole = written(tmp_path / "bag", two_imus)
    shutil.copy(tmp_path / "bag" / "bag.db3", tmp_path / "copy.data")
    alone = open_log(tmp_path / "copy.data")
    assert alone is not None
    assert alone.contents == whole.contents
    (tmp_path / "bag" / "metadata.yaml").unlink()
    folder = open_log(tmp_path / "bag")
    assert folder is not None
    assert folder.contents == whole.contents


def test_the_files_of_a_bag_are_one_log(tmp_path: Path):
    for number in (2, 10):
        with RosBag(tmp_path / f"bag{number}") as bag:
            for k in range(20):
                bag.imu("/imu", T0 + STEP * (k + 20 * (number == 10)), values(k, 0))
    shutil.copy(tmp_path / "bag10" / "bag10.db3", tmp_path / "bag2")
    log = open_log(tmp_path / "bag2")
    assert log is not None
    assert log.contents.topics[0].rows == 40


def test_frames_of_one_topic_are_instances(tmp_path: Path):
    def write(bag: RosBag) -> None:
        for k in range(30):
            bag.imu("/imu", T0 + STEP * k, values(k, 0), "left")
            bag.imu("/imu", T0 + STEP * k + 400, values(k, 1), "right")

    log = written(tmp_path / "bag", write)
    assert set(topics(log)) == {"/imu#left", "/imu#right"}
    assert set(log.source(topics(log)["/imu#right"], ["angular_velocity.x"]).fields["angular_velocity.x"]) == {
        values(k, 1)[0] for k in range(30)
    }


def test_two_publishers_of_one_topic_and_frame_are_no_channel(tmp_path: Path):
    def write(bag: RosBag) -> None:
        for k in range(60):
            bag.imu("/imu", T0 + STEP * k, values(k, 0))
            bag.imu("/imu", T0 + STEP * k + STEP // 4, values(k, 1))
            bag.imu("/good", T0 + STEP * k, values(k, 1))

    log = written(tmp_path / "bag", write)
    assert "steps of 0.0025 and 0.0075 s in turn: two publishers" in topics(log)["/imu"].unusable
    assert not topics(log)["/good"].unusable
    with pytest.raises(BadInput, match="'/imu': steps of"):
        log.contents.named(tmp_path, "/imu")


def test_two_values_of_one_stamp_are_two_publishers_and_copies_are_left_out(tmp_path: Path):
    def write(bag: RosBag) -> None:
        for k in range(60):
            for i in (0, 1):
                bag.imu("/two", T0 + STEP * k, values(k, i))
                bag.imu("/copy", T0 + STEP * k, values(k, 0))

    log = written(tmp_path / "bag", write)
    assert "60 stamps have two values" in topics(log)["/two"].unusable
    assert (topics(log)["/copy"].rows, topics(log)["/copy"].unusable) == (60, "")
    assert "/copy: 60 copies of messages were left out" in log.contents.remarks


@pytest.mark.parametrize("jitter", [0.0, 0.05, 0.4])
def test_one_publisher_is_one_at_any_jitter(jitter: float):
    rng = np.random.default_rng(2)
    time_s = 0.01 * np.arange(2000) + 0.01 * jitter * rng.uniform(-1, 1, 2000)
    assert publishers(np.sort(time_s)) == ""


def test_steps_of_a_scheduler_that_differ_but_not_in_turn_are_one_publisher():
    steps = np.random.default_rng(3).choice([0.002, 0.008], 2000)
    assert publishers(np.cumsum(steps)) == ""


def test_without_a_stamp_the_time_of_the_log_counts(tmp_path: Path):
    def write(bag: RosBag) -> None:
        for k in range(30):
            bag.imu("/none", T0 + STEP * k, values(k, 0), stamp_ns=0)
            bag.imu("/some", T0 + STEP * k, values(k, 0), stamp_ns=0 if k < 3 else None)

    log = written(tmp_path / "bag", write)
    assert topics(log)["/none"].first_s == T0 / 1e9
    assert topics(log)["/some"].rows == 27
    assert log.contents.remarks == (
        "/none: header.stamp is 0: the time of the log is used",
        "/some: 3 messages without a stamp were left out",
    )


def test_a_bag_without_such_messages_is_refused_with_its_types(tmp_path: Path):
    def write(bag: RosBag) -> None:
        two_imus(bag, 2)

    written(tmp_path / "bag", write)
    changed(tmp_path / "bag" / "bag.db3", "UPDATE topics SET type = 'std_msgs/msg/String'")
    with pytest.raises(BadInput, match=r"no messages of .*NavSatFix; there are: std_msgs/msg/String"):
        open_log(tmp_path / "bag")


@pytest.mark.parametrize(
    "statement",
    [
        "CREATE VIEW more AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x FROM c",
        "CREATE TRIGGER t AFTER INSERT ON messages BEGIN SELECT 1; END",
        "CREATE VIRTUAL TABLE v USING fts5(x)",
    ],
)
def test_a_file_that_would_compute_something_is_refused(tmp_path: Path, statement: str):
    written(tmp_path / "bag", two_imus)
    changed(tmp_path / "bag" / "bag.db3", statement)
    with pytest.raises(BadInput, match="which is no table"):
        open_log(tmp_path / "bag")


def test_rows_that_were_not_written_back_are_told(tmp_path: Path):
    written(tmp_path / "bag", two_imus)
    (tmp_path / "bag" / "bag.db3-wal").write_bytes(bytes(100))
    log = open_log(tmp_path / "bag" / "bag.db3")
    assert log is not None
    assert log.contents.damage == ("bag.db3-wal holds rows that were not written back: left out",)


def test_messages_that_are_damaged_are_counted(tmp_path: Path):
    written(tmp_path / "bag", two_imus)
    changed(
        tmp_path / "bag" / "bag.db3",
        "UPDATE messages SET data = x'00010000' WHERE id IN (3, 5, 7)",
        "UPDATE messages SET data = zeroblob(5000000) WHERE id = 9",
    )
    log = open_log(tmp_path / "bag")
    assert log is not None
    assert sum(topic.rows for topic in log.contents.topics) == 76
    assert log.contents.damage == (
        "bag.db3: /imu0: 1 messages are too long: left out",
        "3 messages are damaged: left out",
    )


def test_compressed_bags_are_refused_with_the_way_out(tmp_path: Path):
    written(tmp_path / "bag", two_imus)
    changed(tmp_path / "bag" / "bag.db3", "UPDATE messages SET data = x'28b52ffd00'")
    with pytest.raises(BadInput, match="compressed messages"):
        open_log(tmp_path / "bag")
    (tmp_path / "bag" / "bag.db3").rename(tmp_path / "bag" / "bag.db3.zstd")
    with pytest.raises(BadInput, match="compressed files: unpack them"):
        open_log(tmp_path / "bag")


def add_json(path: Path) -> None:
    """Write an MCAP file with the messages of the one at ``path``, and JSON on /x."""
    from mcap.reader import make_reader
    from mcap.writer import Writer

    with path.open("rb") as source, path.with_name("both.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        mine: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            if channel.topic not in mine:
                assert schema is not None
                of = writer.register_schema(schema.name, schema.encoding, schema.data)
                mine[channel.topic] = writer.register_channel(channel.topic, "cdr", of)
            writer.add_message(mine[channel.topic], message.log_time, message.data, message.log_time)
        schema_of_x = writer.register_schema("x", "jsonschema", b"{}")
        other = writer.register_channel("/x", "json", schema_of_x)
        for k in range(20):
            writer.add_message(other, T0 + STEP * k, json.dumps({"a": k, "b": k + 0.5}).encode(), T0 + STEP * k)
        writer.finish()


def test_other_topics_of_an_mcap_file_are_left_to_its_reader(tmp_path: Path):
    written(tmp_path / "bag", two_imus, mcap=True)
    add_json(tmp_path / "bag" / "bag.mcap")
    both = tmp_path / "bag" / "both.mcap"
    one = {"default": {"threshold": 1.0}}
    x = read(both, config_of({**one, "mapping": {"x.1": "/x:a", "x.2": "/x:b"}}, Path("c")))
    np.testing.assert_array_equal(x.signals["x"].channels[1], np.arange(20) + 0.5)
    imus = {"g.1": "/imu0:angular_velocity.x", "g.2": "/imu1:angular_velocity.x"}
    assert len(read(both, config_of({**one, "mapping": imus}, Path("c"))).time_s) == 40
    with pytest.raises(BadInput, match="no topic '/x'"):
        read(both, config_of({**one, "mapping": {**imus, "g.3": "/x:a"}}, Path("c")))


def test_an_mcap_file_of_another_encoding_is_left_to_its_reader(tmp_path: Path):
    from mcap.writer import Writer

    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        channel = writer.register_channel("/x", "json", schema)
        writer.add_message(channel, 1, json.dumps({"x": 1}).encode(), 1)
        writer.finish()
    assert open_log(tmp_path / "x.mcap") is None


def test_the_time_of_a_topic_may_be_a_field_of_it(tmp_path: Path):
    written(tmp_path / "bag", two_imus)
    names = sorted(topics(Ros2Log(tmp_path / "bag")))
    mapping = {f"x.{c}": f"{name}:angular_velocity.x" for c, name in enumerate(names[:2], 1)}
    tables = {"default": {"threshold": 1.0}, "mapping": mapping}
    plain = read(tmp_path / "bag", config_of(tables, Path("c")))
    named = read(tmp_path / "bag", config_of({**tables, "time": "header.stamp"}, Path("c")))
    assert named.time_s.tolist() == plain.time_s.tolist()
    with pytest.raises(BadInput, match=r"time: no field 'header\.stmp'; .*header\.stamp"):
        read(tmp_path / "bag", config_of({**tables, "time": "header.stmp"}, Path("c")))
