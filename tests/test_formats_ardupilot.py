"""ArduPilot logs: values against pymavlink's reader; instances, units and clocks of versions; damage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from foreign_logs import IMU, IMU_UNITS, dataflash, dataflash_message, imus

from rig.core.errors import BadInput
from rig.log.recordings.formats.ardupilot import ArduPilotLog
from rig.log.recordings.formats.contents import Topic
from rig.log.recordings.formats.known import open_log

ROW = 3 + 8 + 1 + 24  # bytes of an IMU message


def opened(tmp_path: Path, data: bytes) -> ArduPilotLog:
    path = tmp_path / "flight.bin"
    path.write_bytes(data)
    log = open_log(path)
    assert isinstance(log, ArduPilotLog)
    return log


def topics(log: ArduPilotLog) -> dict[str, Topic]:
    return {topic.name: topic for topic in log.contents.topics}


def imu_rows(log: ArduPilotLog) -> int:
    return sum(topic.rows for topic in log.contents.topics if topic.message == "IMU")


def test_values_and_times_are_those_that_were_written(tmp_path: Path):
    rows = [
        (1_000_000 + 40_000 * k + i, i, 0.5 * k, -0.25, 0.125 * i, 1.0, 2.0, -9.75) for k in range(50) for i in (0, 1)
    ]
    log = opened(tmp_path, dataflash({"IMU": (*IMU, rows)}, {"IMU": IMU_UNITS}))
    for i in (0, 1):
        topic = topics(log)[f"IMU/{i}"]
        mine = [row for row in rows if row[1] == i]
        source = log.source(topic, ["GyrX", "AccZ"])
        assert (topic.rows, topic.units["GyrX"], topic.units["AccX"]) == (50, "rad/s", "m/s^2")
        np.testing.assert_allclose(source.time_s, [row[0] / 1e6 for row in mine], rtol=1e-15)
        np.testing.assert_array_equal(source.fields["GyrX"], [row[2] for row in mine])
        np.testing.assert_array_equal(source.fields["AccZ"], [row[7] for row in mine])
    assert not log.contents.damage


def test_values_are_those_of_pymavlink(tmp_path: Path):
    from pymavlink.DFReader import DFReader_binary

    letters, columns = "QBhHcCiIeELfdqQM", "TimeUS,I,a,b,c,d,e,f,g,h,k,l,m,n,o,p"
    rows = [
        (
            1000 * k,
            k % 3,
            -k,
            k,
            -7 * k,
            7 * k,
            -k,
            k,
            -11 * k,
            11 * k,
            47_123_456 * (k % 9),
            0.1 * k,
            0.2 * k,
            -k,
            k,
            k % 9,
        )
        for k in range(1, 60)
    ]
    log = opened(tmp_path, dataflash({"ALL": (letters, columns, rows), "IMU": (*IMU, [(9, 0, *range(6))])}))
    reader = DFReader_binary(str(tmp_path / "flight.bin"))
    theirs = []
    while (message := reader.recv_match(type="ALL")) is not None:
        theirs.append(message.to_dict())
    source = log.source(topics(log)["ALL"], columns.split(","))
    for name in columns.split(","):
        np.testing.assert_allclose(source.fields[name], [row[name] for row in theirs], rtol=1e-13)
    reader.close()


def test_an_instance_is_what_the_unit_says_and_not_a_field_of_that_name(tmp_path: Path):
    pid = [(1000 * k, 0.5 * k, 0.1) for k in range(1, 20)]
    vibe = [(1000 * k, k % 2, 3.0) for k in range(1, 20)]
    log = opened(
        tmp_path,
        dataflash(
            {
                "PIDR": ("Qff", "TimeUS,I,Des", pid),
                "VIBE": ("QBf", "TimeUS,IMU,VibeX", vibe),
                "IMU": (*IMU, [(9, 2, *range(6))]),
            },
            {"PIDR": ("s--", "F--"), "VIBE": ("s#-", "F--"), "IMU": IMU_UNITS},
        ),
    )
    assert {"PIDR", "VIBE/0", "VIBE/1", "IMU/2"} <= set(topics(log))
    assert not any(name.startswith("PIDR/") for name in topics(log))


def test_before_version_4_the_instance_is_in_the_name_of_the_message(tmp_path: Path):
    old = ("Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    rows = [(100 + 20 * k, *range(6)) for k in range(30)]
    baro = ("Iff", "TimeMS,Alt,Press", [(100 + 20 * k, 1.0, 95_000.0) for k in range(30)])
    mag = ("Ihhh", "TimeMS,MagX,MagY,MagZ", [(100 + 20 * k, 250, -30, 400) for k in range(30)])
    log = opened(
        tmp_path, dataflash({"IMU": (*old, rows), "IMU2": (*old, rows), "BARO": baro, "BAR2": baro, "MAG": mag})
    )
    found = topics(log)
    assert {"IMU/0", "IMU/1", "BARO/0", "BARO/1", "MAG/0"} <= set(found)
    assert (found["IMU/1"].units["GyrX"], found["BARO/1"].units["Press"], found["MAG/0"].units["MagX"]) == (
        "rad/s",
        "Pa",
        "gauss",
    )
    source = log.source(found["MAG/0"], ["MagX", "MagY"])
    np.testing.assert_allclose(source.fields["MagX"], 0.25, rtol=1e-15)
    np.testing.assert_allclose(source.time_s, 0.1 + 0.02 * np.arange(30), rtol=1e-12)


def test_an_instance_field_without_units_counts_in_a_sensor_message_only(tmp_path: Path):
    rows = [(1000 * k, k % 2, *range(6)) for k in range(1, 40)]
    log = opened(
        tmp_path, dataflash({"IMU": (*IMU, rows), "PIDR": ("Qff", "TimeUS,I,P", [(5, 1.5, 2.5), (6, 2.5, 2.5)])})
    )
    assert {"IMU/0", "IMU/1", "PIDR"} <= set(topics(log))


def test_the_clock_of_an_old_gps_message_is_not_the_time_of_the_week(tmp_path: Path):
    gps = (
        "BIILI",
        "Status,TimeMS,Week,Alt,T",
        [(3, 225_022_000 + 200 * k, 1800, 4_000_000, 5_000 + 200 * k) for k in range(9)],
    )
    imu = ("If", "TimeMS,GyrX", [(5_000 + 100 * k, 0.0) for k in range(17)])
    log = opened(tmp_path, dataflash({"GPS": gps, "IMU": imu}, clock=1))
    found = topics(log)
    assert (found["GPS/0"].first_s, found["GPS/0"].last_s) == (5.0, pytest.approx(6.6))
    assert (found["IMU/0"].first_s, found["IMU/0"].last_s) == (5.0, pytest.approx(6.6))


def test_of_two_factors_of_a_field_one_is_applied(tmp_path: Path):
    rows = [(1000 * k, 0, 512, 512, 512) for k in range(1, 9)]
    log = opened(
        tmp_path,
        dataflash({"MAG": ("QBhch", "TimeUS,I,MagX,MagY,MagZ", rows)}, {"MAG": ("s#GGG", "F-CB0")}),
    )
    source = log.source(topics(log)["MAG/0"], ["MagX", "MagY", "MagZ"])
    assert topics(log)["MAG/0"].units["MagX"] == "gauss"
    assert [source.fields[f"Mag{axis}"][0] for axis in "XYZ"] == pytest.approx([0.512, 5.12, 512.0])


def test_an_altitude_without_a_fix_is_no_sample(tmp_path: Path):
    rows = [(1000 * k, k % 2, 3 if k > 4 else 1, 40_000) for k in range(1, 11)]
    log = opened(tmp_path, dataflash({"GPS": ("QBBe", "TimeUS,I,Status,Alt", rows)}, {"GPS": ("s#-P", "F--0")}))
    np.testing.assert_array_equal(
        log.source(topics(log)["GPS/0"], ["Alt"]).fields["Alt"], [np.nan, np.nan, 400.0, 400.0, 400.0]
    )


def test_messages_that_pymavlink_finds_are_found(tmp_path: Path):
    from pymavlink.DFReader import DFReader_binary

    log = opened(tmp_path, imus(rows=500))
    reader = DFReader_binary(str(tmp_path / "flight.bin"))
    counts = {
        reader.formats[number].name: len(offsets) for number, offsets in enumerate(reader.offsets) if len(offsets)
    }
    reader.close()
    ours: dict[str, int] = {}
    for topic in log.contents.topics:
        ours[topic.message] = ours.get(topic.message, 0) + topic.rows
    assert {name: count for name, count in counts.items() if name != "FMT"} == ours


def test_marks_within_values_are_no_messages(tmp_path: Path):
    mark = int.from_bytes(b"\xa3\x95\x0e\x00", "little")
    rows = [(mark * 65536 + k, k % 2, mark, mark) for k in range(1, 90)]
    log = opened(tmp_path, dataflash({"IMU": ("QBII", "TimeUS,I,GyrX,GyrY", rows)}, {"IMU": ("s#EE", "F-00")}))
    assert imu_rows(log) == 89
    assert not log.contents.damage


def test_a_cut_log_is_read_to_its_last_whole_message(tmp_path: Path):
    data = imus(rows=100)
    log = opened(tmp_path, data[:-10])
    assert imu_rows(log) == 299
    assert log.contents.remarks == (f"the last message is not whole: its {ROW - 10} bytes were left out",)
    assert not log.contents.damage


def test_lost_bytes_and_unknown_messages_are_counted_and_the_rest_is_read(tmp_path: Path):
    data = imus(rows=100)
    at = len(data) - 150 * ROW
    junk = np.random.default_rng(0).integers(0, 256, 200_000, np.uint8).tobytes() + dataflash_message(200, "Q", [5])
    log = opened(tmp_path, data[:at] + junk + data[at:])
    assert imu_rows(log) >= 298
    assert log.contents.damage[0].startswith(f"damaged: {len(junk) + (300 - imu_rows(log)) * ROW} of ")


def test_a_page_that_was_not_filled_is_no_damage(tmp_path: Path):
    log = opened(tmp_path, imus(rows=20) + b"\xff" * 200)
    assert (imu_rows(log), log.contents.damage) == (60, ())


@pytest.mark.parametrize("data", [b"\xa3\x95\x80", b"\xa3\x95\x80" + bytes(86), b"\xa3\x95\x80" * 10_000])
def test_a_file_without_data_is_refused(tmp_path: Path, data: bytes):
    with pytest.raises(BadInput, match=r"flight\.bin: an ArduPilot log without data"):
        opened(tmp_path, data)


def test_formats_that_are_damaged_cost_their_messages(tmp_path: Path):
    att = ("Qf", "TimeUS,Roll", [(k, 1.0) for k in range(1, 9)])
    data = dataflash({"IMU": (*IMU, [(9, 0, *range(6))]), "ATT": att})
    log = opened(tmp_path, data.replace(b"IMU\x00", b"\xff\xff\xff\xff", 1))
    assert set(topics(log)) == {"ATT"}
    assert log.contents.damage
