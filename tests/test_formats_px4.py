"""PX4 logs: topics, values and times against pyulog; devices, units and clocks of versions; damage."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import IMU_FIELDS, PX4_LOGS, gyros, ulog, ulog_message

from rig.core.errors import BadInput
from rig.log.recordings.formats.contents import Topic
from rig.log.recordings.formats.known import open_log
from rig.log.recordings.formats.px4 import Px4Log

LOGS = sorted(PX4_LOGS.glob("*.ulg"))
REAL = pytest.mark.skipif(not LOGS, reason="the recorded PX4 logs are not here")


def opened(tmp_path: Path, data: bytes) -> Px4Log:
    path = tmp_path / "flight.ulg"
    path.write_bytes(data)
    log = open_log(path)
    assert isinstance(log, Px4Log)
    return log


def topics(log: Px4Log) -> dict[str, Topic]:
    return {topic.name: topic for topic in log.contents.topics}


@REAL
@pytest.mark.parametrize("path", LOGS, ids=[path.stem for path in LOGS])
def test_every_topic_and_value_of_a_real_log_is_that_of_pyulog(path: Path):
    from pyulog import ULog

    log = Px4Log(path)
    theirs = {f"{data.name}/{data.multi_id}": data for data in ULog(str(path)).data_list}
    assert set(topics(log)) == set(theirs)
    for name, topic in topics(log).items():
        data = theirs[name].data
        names = [field for field in topic.units if field in data]
        assert len(names) == len(data)
        source = log.source(topic, names)
        for field in names:
            values = data[field].astype(np.float64)
            if field in ("alt", "altitude_msl_m") and "fix_type" in data and topic.units[field]:
                values[data["fix_type"] < 3] = np.nan
            np.testing.assert_array_equal(source.fields[field], values)
        times = [data[field] / 1e6 for field in ("timestamp", "timestamp_sample") if field in data]
        assert topic.rows == len(times[0])
        assert any(np.array_equal(source.time_s, stamps) for stamps in times)
        assert (topic.first_s, topic.last_s) == (source.time_s.min(), source.time_s.max())
    assert not log.contents.damage


@REAL
def test_rates_units_and_devices_of_a_real_log_are_what_its_firmware_writes():
    found = topics(Px4Log(PX4_LOGS / "gps_interference.ulg"))
    baros = [found["sensor_baro/0"], found["sensor_baro/1"]]
    assert [topic.units["pressure"] for topic in baros] == ["Pa", "Pa"]
    assert [round(topic.rate_hz, 1) for topic in baros] == [1.0, 1.0]
    assert [topic.device for topic in baros] == ["0x6f0022", "0xb86321"]
    assert found["vehicle_imu/0"].units["gyro[0]"] == "rad/s"
    assert found["vehicle_imu/1"].units["accel[2]"] == "m/s^2"


def test_values_are_those_that_were_written(tmp_path: Path):
    rows = [(1_000_000 + 10_000 * k, 7, 0.5 * k, -1.0 * k, 3.25) for k in range(50)]
    log = opened(tmp_path, ulog({("sensor_gyro", 2): (IMU_FIELDS, rows)}))
    (topic,) = log.contents.topics
    source = log.source(topic, ["x", "y", "z"])
    assert (topic.name, topic.rows, topic.device) == ("sensor_gyro/2", 50, "0x7")
    assert topic.rate_hz == pytest.approx(100.0)
    np.testing.assert_array_equal(source.time_s, [row[0] / 1e6 for row in rows])
    for axis, place in (("x", 2), ("y", 3), ("z", 4)):
        np.testing.assert_array_equal(source.fields[axis], [row[place] for row in rows])


def test_a_file_that_pyulog_writes_holds_the_same(tmp_path: Path):
    from pyulog import ULog

    first = opened(tmp_path, gyros())
    ULog(str(tmp_path / "flight.ulg")).write_ulog(str(tmp_path / "again.ulg"))
    second = Px4Log(tmp_path / "again.ulg")
    assert first.contents == second.contents
    for topic in first.contents.topics:
        ours, again = (log.source(topic, ["x", "y", "z"]) for log in (first, second))
        for axis in "xyz":
            np.testing.assert_array_equal(ours.fields[axis], again.fields[axis])


def nested(padding: int) -> bytes:
    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + ulog_message("B", bytes(40))
    head += ulog_message("F", b"esc:float[2] rpm;uint8_t error;")
    head += ulog_message("F", b"escs:uint64_t timestamp;esc[2] of;uint8_t[3] _padding0;")
    head += ulog_message("A", struct.pack("<BH", 0, 4) + b"escs")
    rows = (struct.pack("<HQ2fB2fB", 4, 1000 * k, k, 2 * k, 1, 3 * k, 4 * k, 2) for k in range(1, 9))
    return head + b"".join(ulog_message("D", row + bytes(padding)) for row in rows)


def test_nested_formats_are_flattened_as_pyulog_does(tmp_path: Path):
    from pyulog import ULog

    log = opened(tmp_path, nested(0))
    (topic,) = log.contents.topics
    (data,) = ULog(str(tmp_path / "flight.ulg")).data_list
    assert list(topic.units) == list(data.data)
    source = log.source(topic, list(topic.units))
    for name, values in data.data.items():
        np.testing.assert_array_equal(source.fields[name], values)


def test_padding_behind_a_row_changes_nothing(tmp_path: Path):
    without, padded = (opened(tmp_path, nested(padding)) for padding in (0, 3))
    (topic,) = padded.contents.topics
    assert padded.contents == without.contents
    np.testing.assert_array_equal(padded.source(topic, ["of[1].error"]).fields["of[1].error"], [2.0] * 8)


def test_devices_that_change_places_are_told_apart_by_their_id(tmp_path: Path):
    def row(k: int, device: int) -> tuple[float, ...]:
        return 1_000_000 + 10_000 * k, device, 10.0 * device, 0.0, 0.0

    first = [row(k, 0 if k < 2 else 5 if k < 30 else 6) for k in range(60)]
    second = [row(k, 6 if k < 30 else 5) for k in range(60)]
    log = opened(tmp_path, ulog({("sensor_gyro", 0): (IMU_FIELDS, first), ("sensor_gyro", 1): (IMU_FIELDS, second)}))
    found = topics(log)
    assert set(found) == {"sensor_gyro/device_5", "sensor_gyro/device_6"}
    for device in (5, 6):
        values = log.source(found[f"sensor_gyro/device_{device}"], ["x"])
        assert set(values.fields["x"]) == {10.0 * device}
        assert (np.diff(values.time_s) > 0).all()
    assert any("changed their places" in remark for remark in log.contents.remarks)


@pytest.mark.parametrize(("pressure", "unit"), [(1013.0, "hPa"), (101_300.0, "Pa")])
def test_the_unit_of_a_barometer_follows_its_values(tmp_path: Path, pressure: float, unit: str):
    fields = {"timestamp": "uint64_t", "device_id": "uint32_t", "pressure": "float"}
    log = opened(tmp_path, ulog({("sensor_baro", 0): (fields, [(1000 * k + 1, 3, pressure) for k in range(9)])}))
    assert log.contents.topics[0].units["pressure"] == unit


def test_a_sample_time_that_is_zero_or_does_not_rise_is_not_used(tmp_path: Path):
    fields = {"timestamp": "uint64_t", "timestamp_sample": "uint64_t", "x": "float"}
    stamps = [1_000_000 + 1000 * k for k in range(9)]
    of = {
        "zero": [0] * 9,
        "good": [stamp - 300 for stamp in stamps],
        "twice": [stamps[0]] * 9,
        "far": list(range(1, 10)),
    }
    rows = {(name, 0): (fields, list(zip(stamps, times, range(9), strict=True))) for name, times in of.items()}
    log = opened(tmp_path, ulog(rows))
    first = {topic.message: topic.first_s for topic in log.contents.topics}
    assert first == {"zero": 1.0, "good": pytest.approx(0.9997), "twice": 1.0, "far": 1.0}


def test_rates_are_angles_over_the_time_of_each(tmp_path: Path):
    fields = {"timestamp": "uint64_t", **{f"delta_angle[{i}]": "float" for i in range(3)}, "delta_angle_dt": "uint32_t"}
    head = ulog({("vehicle_imu", 0): (fields, [(1 + k, 0.5, 0.25, 0.0, 5000 if k else 0) for k in range(4)])})
    array = head.replace(b"float delta_angle[0];float delta_angle[1];float delta_angle[2];", b"float[3] delta_angle;")
    short = len(head) - len(array)
    size = struct.pack("<H", array.index(b"uint32_t delta_angle_dt;") + 24 - array.index(b"vehicle_imu:"))
    at = array.index(b"vehicle_imu:") - 3
    log = opened(tmp_path, array[:at] + size + array[at + 2 :])
    assert short > 0
    source = log.source(log.contents.topics[0], ["gyro[0]", "gyro[1]"])
    np.testing.assert_allclose(source.fields["gyro[0]"], [np.nan, 100.0, 100.0, 100.0])
    np.testing.assert_allclose(source.fields["gyro[1]"], [np.nan, 50.0, 50.0, 50.0])


def test_an_altitude_without_a_fix_is_no_sample(tmp_path: Path):
    fields = {"timestamp": "uint64_t", "fix_type": "uint8_t", "altitude_msl_m": "double"}
    log = opened(tmp_path, ulog({("sensor_gps", 0): (fields, [(1 + k, 3 if k > 2 else 1, 400.0) for k in range(5)])}))
    source = log.source(log.contents.topics[0], ["altitude_msl_m"])
    np.testing.assert_array_equal(source.fields["altitude_msl_m"], [np.nan, np.nan, np.nan, 400.0, 400.0])


def test_the_time_that_the_logger_lost_is_told(tmp_path: Path):
    log = opened(tmp_path, ulog({("sensor_gyro", 0): (IMU_FIELDS, [(1, 2, 0, 0, 0)])}, ulog_message("O", b"\x2c\x01")))
    assert log.contents.remarks == ("0.3 s were lost by the logger (1 dropouts)",)


def test_a_cut_log_is_read_to_its_last_whole_message(tmp_path: Path):
    data = gyros(rows=50)
    whole, cut = opened(tmp_path, data), opened(tmp_path, data[:-10])
    rows = [sum(topic.rows for topic in log.contents.topics) for log in (whole, cut)]
    row = 3 + 2 + 8 + 4 + 12
    assert rows == [150, 149]
    assert cut.contents.remarks == (f"the last message is not whole: its {row - 10} bytes were left out",)
    assert not cut.contents.damage


def test_lost_bytes_are_counted_and_the_rest_is_read(tmp_path: Path):
    data = gyros(rows=200)
    row = 3 + 2 + 8 + 4 + 12
    at = len(data) - 300 * row
    log = opened(tmp_path, data[:at] + bytes(500_000) + data[at:])
    assert sum(topic.rows for topic in log.contents.topics) == 600
    assert log.contents.damage[0].startswith("damaged: 500000 of ")


def test_a_size_that_is_wrong_costs_one_message(tmp_path: Path):
    data = bytearray(gyros(rows=200))
    row = 3 + 2 + 8 + 4 + 12
    data[len(data) - 300 * row + 1] ^= 0x40
    log = opened(tmp_path, bytes(data))
    assert sum(topic.rows for topic in log.contents.topics) == 599
    assert log.contents.damage[0].startswith(f"damaged: {row} of ")


def test_a_definition_that_is_damaged_costs_its_topic(tmp_path: Path):
    data = gyros(rows=100)
    subscribed = ulog_message("A", struct.pack("<BH", 1, 1) + b"sensor_gyro")
    assert subscribed in data
    log = opened(tmp_path, data.replace(subscribed, subscribed[:6] + b"unsubscribe"))
    row = 3 + 2 + 8 + 4 + 12
    assert set(topics(log)) == {"sensor_gyro/0", "sensor_gyro/2"}
    assert sum(topic.rows for topic in log.contents.topics) == 200
    assert log.contents.damage[0].startswith(f"damaged: {100 * row} of ")


def test_data_behind_an_appended_offset_are_read(tmp_path: Path):
    data = gyros(rows=20)
    row = 3 + 2 + 8 + 4 + 12
    cut = data[: -10 * row - 7]
    flags = bytes(8) + b"\x01" + bytes(7) + struct.pack("<3Q", len(cut), 0, 0)
    made = cut[:16] + ulog_message("B", flags) + cut[16 + 43 :] + data[-10 * row :]
    log = opened(tmp_path, made)
    assert sum(topic.rows for topic in log.contents.topics) == 59
    assert log.contents.damage[0].startswith(f"damaged: {row - 7} of ")


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"ULog\x01\x12\x35", "a PX4 log without data"),
        (b"ULog\x01\x12\x35" + bytes(9), "a PX4 log without data"),
        (b"ULog\x01\x12\x35" + bytes(9) + ulog_message("B", bytes(8) + b"\x02" + bytes(31)), "incompatible flags"),
        (b"ULog\x01\x12\x35" + bytes(100_000), "a PX4 log without data; damaged: 99991 of 100007 bytes (100 %)"),
    ],
)
def test_a_file_without_data_is_refused(tmp_path: Path, data: bytes, says: str):
    with pytest.raises(BadInput, match=says.replace("(", r"\(").replace(")", r"\)").replace("+", r"\+")):
        opened(tmp_path, data)


def test_a_format_that_would_fill_the_memory_is_left_out(tmp_path: Path):
    bomb = ulog_message("F", b"f0:uint8_t x;")
    for depth in range(9):
        bomb += ulog_message("F", f"f{depth + 1}:uint64_t timestamp;f{depth}[60000] a;".encode())
    bomb += ulog_message("A", struct.pack("<BH", 0, 9) + b"f9") + ulog_message("F", b"e:")
    bomb += ulog_message("F", b"t:uint64_t timestamp;e[65535] a;") + ulog_message("A", struct.pack("<BH", 0, 8) + b"t")
    bomb += ulog_message("D", struct.pack("<HQ", 9, 1)) * 3
    data = gyros(rows=20)
    log = opened(tmp_path, data[: 16 + 43] + bomb + data[16 + 43 :])
    assert {topic.message for topic in log.contents.topics} == {"sensor_gyro"}
    assert log.contents.damage
