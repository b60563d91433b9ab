"""Presets, and the commands on logs of other systems."""

from __future__ import annotations

import json
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import tomli_w
from foreign_logs import IMU, IMU_FIELDS, IMU_UNITS, PX4_LOGS, RosBag, dataflash, gyros, imus, ulog

import rig as api
from rig.core.errors import BadInput
from rig.log.recordings.formats.contents import LogContents, topic_of
from rig.log.recordings.formats.known import open_log
from rig.log.recordings.formats.presets import PRESETS, comparable, config, found
from rig.log.recordings.vote_config import config_of


class Ended(NamedTuple):
    """A command that has ended."""

    code: int
    out: str
    err: str


Run = Callable[[str], Ended]


@pytest.fixture
def run(rig_command: Callable[..., tuple[int, str, str]]) -> Run:
    return lambda line: Ended(*rig_command(*line.split()))


def log(*topics: tuple[str, str, float, dict[str, str]], preset: str = "px4") -> LogContents:
    made = [topic_of(name, instance, np.arange(200) / rate, units) for name, instance, rate, units in topics]
    return LogContents("PX4", preset, tuple(made))


IMU_STATUS = {**{f"mean_gyro[{i}]": "rad/s" for i in range(3)}, **{f"mean_accel[{i}]": "m/s^2" for i in range(3)}}
XYZ = dict.fromkeys("xyz", "rad/s")


def test_fast_samples_come_before_means_and_means_before_slow_samples():
    fast, slow = (
        log(*(("sensor_gyro", i, rate, XYZ) for i in "01"), *(("vehicle_imu_status", i, 1.0, IMU_STATUS) for i in "01"))
        for rate in (50.0, 1.0)
    )
    assert [one.fields.message for one in comparable(fast)] == ["sensor_gyro", "vehicle_imu_status"]
    assert [one.fields.message for one in comparable(slow)] == ["vehicle_imu_status"] * 2
    alone = log(("sensor_gyro", "0", 1.0, XYZ), ("sensor_gyro", "1", 1.0, XYZ))
    assert [one.fields.message for one in comparable(alone)] == ["sensor_gyro"]


def test_four_instances_are_channels_and_more_are_told():
    (one,) = comparable(log(*(("sensor_gyro", str(i), 50.0, XYZ) for i in range(6))))
    assert [topic.instance for topic in one.topics] == ["0", "1", "2", "3"]
    assert [topic.instance for topic in one.others] == ["4", "5"]


def test_one_instance_is_nothing_to_compare():
    with pytest.raises(BadInput, match="f: one channel of each sensor: nothing to compare"):
        found(log(("sensor_gyro", "0", 50.0, XYZ)), Path("f"))


@pytest.mark.parametrize(("unit", "threshold"), [("T", 2e-5), ("gauss", 0.2), ("mgauss", 200.0), ("uT", 20.0)])
def test_a_threshold_is_in_the_unit_of_the_log(unit: str, threshold: float):
    units = {f"magnetic_field.{axis}": unit for axis in "xyz"}
    tables = config(log(("/a", "", 9.0, units), ("/b", "", 9.0, units), preset="ros2-imu"), Path("f"))
    assert tables["signal"]["mag_x"]["threshold"] == pytest.approx(threshold, rel=1e-5)
    assert tables["signal"]["mag_x"]["range"] == pytest.approx([-250 * threshold, 250 * threshold], rel=1e-5)


def test_a_unit_of_a_damaged_log_is_refused_in_one_line():
    units = dict.fromkeys("xyz", "\0\0rad@")
    with pytest.raises(BadInput, match="f: sensor_gyro/0: x: unit: unknown unit"):
        config(log(("sensor_gyro", "0", 50.0, units), ("sensor_gyro", "1", 50.0, units)), Path("f"))


@pytest.mark.parametrize("name", PRESETS)
def test_every_quantity_of_a_preset_makes_a_config_that_is_accepted(name: str):
    for quantity in PRESETS[name]:
        for fields in quantity.candidates:
            units = dict.fromkeys(fields.names, quantity.unit)
            topics = [(fields.message or f"/{i}", str(i), 50.0, units) for i in range(3)]
            contents = log(*topics, preset=name)
            tables = config(contents, Path("f"))
            made = config_of(tables, Path("f"))
            signals = made.signals(dict.fromkeys(tables["signal"]), "f")
            assert {own.threshold > 0 for own in signals.values()} == {True}
            assert len(tables["mapping"]) == 3 * len(fields.names)


def written(kind: str) -> Path:
    """A log with three healthy instances."""
    if kind == "ros2":
        with RosBag(Path("bag")) as bag:
            rng = np.random.default_rng(3)
            for k in range(100):
                for i in range(3):
                    values = np.array([np.sin(k / 50), 0.1, 0.2, 0.3, 0.4, -9.8]) + rng.normal(0, 0.002, 6)
                    bag.imu(f"/imu{i}", 1_700_000_000 * 10**9 + 20_000_000 * k + 1000 * i, list(values))
        return Path("bag")
    Path("flight.log").write_bytes({"px4": gyros, "ardupilot": imus}[kind]())
    return Path("flight.log")


@pytest.mark.parametrize("kind", ["px4", "ardupilot", "ros2"])
def test_a_log_is_voted_without_a_config_and_with_the_one_that_is_written(kind: str, run: Run):
    path = written(kind)
    first = run(f"vote {path} --out a.csv --write vote.toml --json")
    assert first.code == 0, first.err
    summary = json.loads(first.out)
    assert {len(signal["channels"]) for signal in summary["signals"].values()} == {3}
    assert all(channel["state"] == "ok" for signal in summary["signals"].values() for channel in signal["channels"])
    assert run(f"vote {path} --out b.csv --config vote.toml").code == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()
    tables = tomllib.loads(Path("vote.toml").read_text())
    assert {name.rpartition("_")[0] for name in tables["signal"]} <= {"gyro", "accel"}
    api.vote(path, out="c.csv")
    assert Path("a.csv").read_bytes() == Path("c.csv").read_bytes()
    with pytest.raises(BadInput, match="--preset: unknown preset 'x'"):
        api.vote(path, preset="x")


@pytest.mark.parametrize("kind", ["px4", "ardupilot", "ros2"])
def test_a_step_in_one_instance_isolates_it(kind: str, run: Run):
    path = written(kind)
    start_s = json.loads(run(f"vote {path} --out a.csv --json").out)["time_s"][0] + 0.4
    fault = {"signal": "gyro_y", "channels": [2], "kind": "offset", "offset": 0.5, "start_s": start_s}
    Path("f.toml").write_text(tomli_w.dumps({"faults": [fault]}))
    result = run(f"vote {path} --out a.csv --inject f.toml --json")
    assert result.code == 0, result.err
    states = [channel["state"] for channel in json.loads(result.out)["signals"]["gyro_y"]["channels"]]
    assert states == ["ok", "failed", "ok"]


def test_write_alone_makes_the_config_and_no_vote(run: Run):
    written("px4")
    made = run("vote flight.log --write vote.toml")
    assert made.code == 0
    assert "gyro_x" in made.out
    assert sorted(path.name for path in Path().iterdir()) == ["flight.log", "vote.toml"]


REFUSED = {
    "neither output": ("vote flight.log", "--out: missing"),
    "an unknown preset": ("vote flight.log --out a.csv --preset px5", "--preset: unknown preset 'px5'; allowed: px4"),
    "the preset of another format": ("vote flight.log --out a.csv --preset ardupilot", "a PX4 log: --preset px4"),
    "a preset and a config": (
        "vote flight.log --out a.csv --preset px4 --config c.toml",
        "--preset, --config: only one",
    ),
    "write and a config": ("vote flight.log --write w.toml --config c.toml", "--write, --config: only one"),
    "a preset of a table": ("vote in.csv --out a.csv --preset px4", "in.csv: --preset is for logs of PX4"),
    "write of a table": ("vote in.csv --write w.toml", "in.csv: --write is for logs of PX4"),
    "another ending": ("vote flight.log --write w.txt", "--write w.txt: must end with .toml"),
    "the input": ("vote flight.log --write flight.log", "--write flight.log: is the input"),
    "a topic that is not there": (
        "vote flight.log --config topic.toml --out a.csv",
        "no topic 'sensor_gyro/7'; allowed: sensor_gyro/0",
    ),
    "a field that is not there": (
        "vote flight.log --config field.toml --out a.csv",
        "topic 'sensor_gyro/0' has no field 'w'; allowed",
    ),
    "no mapping": (
        "vote flight.log --config c.toml --out a.csv",
        "flight.log: a PX4 log: CONFIG needs a [mapping]; rig vote --write makes one",
    ),
    "one instance": ("vote one.log --out a.csv", "one.log: one channel of each sensor: nothing to compare"),
    "Betaflight": ("vote beta.bbl --out a.csv", "beta.bbl: a Betaflight log: it has one gyro, nothing to compare"),
    "info of Betaflight": ("info beta.bbl", "beta.bbl: a Betaflight log: it has one gyro, nothing to compare"),
    "an empty file": ("vote empty.ulg --out a.csv", "empty.ulg: the file is empty"),
    "info of an empty file": ("info empty.ulg", "empty.ulg: the file is empty"),
    "another content": ("vote text.ulg --out a.csv", "text.ulg: no log of PX4, ArduPilot, ROS 2, MDF 4"),
    "magic alone": ("vote magic.ulg --out a.csv", "magic.ulg: a PX4 log without data"),
    "topics of a flight": ("info in.csv --topics", "in.csv: --topics: for logs of other systems"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_voted_is_refused_in_one_line(case: str, run: Run):
    command, says = REFUSED[case]
    written("px4")
    Path("one.log").write_bytes(gyros(1))
    Path("beta.bbl").write_bytes(b"H Product:Blackbox flight data recorder by Nicholas Sherlock\nH x:1\n")
    Path("empty.ulg").write_bytes(b"")
    Path("text.ulg").write_text("no log")
    Path("magic.ulg").write_bytes(b"ULog\x01\x12\x35")
    Path("in.csv").write_text("time_s,x.1,x.2\n0,1,1\n1,1,1\n")
    Path("c.toml").write_text("[default]\nthreshold = 1.0\n")
    for name, place in (("topic", "sensor_gyro/7:x"), ("field", "sensor_gyro/0:w")):
        tables = {"default": {"threshold": 1.0}, "mapping": {"x.1": "sensor_gyro/1:x", "x.2": place}}
        Path(f"{name}.toml").write_text(tomli_w.dumps(tables))
    before = sorted(path.name for path in Path().iterdir())
    result = run(command)
    assert result.code == 2
    assert says in result.err
    assert len(result.err.strip().splitlines()) == 1
    assert sorted(path.name for path in Path().iterdir()) == before


def test_info_lists_the_sensors_and_what_can_be_compared(run: Run):
    written("px4")
    facts = json.loads(run("info flight.log --json").out)
    assert (facts["format"], facts["preset"], facts["damage"]) == ("PX4", "px4", None)
    assert [(t["topic"], t["rows"], t["device"], t["measures"]) for t in facts["topics"]] == [
        ("sensor_gyro/0", 100, "0xb", {"gyro": "rad/s"}),
        ("sensor_gyro/1", 100, "0x16", {"gyro": "rad/s"}),
        ("sensor_gyro/2", 100, "0x21", {"gyro": "rad/s"}),
    ]
    assert facts["topics"][0]["rate_hz"] == pytest.approx(50.0)
    (one,) = facts["compared"]
    assert (one["signals"], one["unit"]) == (["gyro_x", "gyro_y", "gyro_z"], "rad/s")
    shown = run("info flight.log").out
    assert "compared gyro of sensor_gyro/0, sensor_gyro/1, sensor_gyro/2, rad/s, 50 Hz" in " ".join(shown.split())


def test_info_lists_all_topics_when_asked(run: Run):
    Path("a.bin").write_bytes(
        dataflash(
            {"ATT": ("Qf", "TimeUS,Roll", [(k, 0.0) for k in range(9)]), "IMU": (*IMU, [(9, 0, *range(6))])},
            {"IMU": IMU_UNITS},
        )
    )
    assert "ATT" not in run("info a.bin").out
    shown = run("info a.bin --topics").out
    assert "ATT" in shown
    assert "IMU/0" in shown
    assert "nothing: one channel of each sensor" in run("info a.bin").out


def test_info_and_vote_of_a_damaged_log_tell_what_was_left_out(run: Run):
    data = gyros(rows=200)
    Path("cut.ulg").write_bytes(data[:-1000] + bytes(300) + data[-700:])
    told = run("info cut.ulg")
    assert told.code == 2
    assert "cut.ulg: damaged: " in told.err
    assert "sensor_gyro/2" in told.out
    voted = run("vote cut.ulg --out a.csv --json")
    assert voted.code == 0
    assert any("bytes" in line and "left out" in line for line in json.loads(voted.out)["warnings"])


def test_instances_with_devices_that_change_places_are_voted_by_device(run: Run):
    def rows(of: list[int]) -> list[tuple[float, ...]]:
        return [
            (1_000_000 + 20_000 * k, of[k >= 100], 0.4 * (of[k >= 100] == 7 and k >= 50), 0.0, 0.0) for k in range(200)
        ]

    topics = {("sensor_gyro", i): (IMU_FIELDS, rows(of)) for i, of in enumerate(([7, 8], [8, 7], [9, 9]))}
    Path("a.ulg").write_bytes(ulog(topics))
    summary = json.loads(run("vote a.ulg --out a.csv --json").out)
    channels = summary["signals"]["gyro_x"]["channels"]
    assert [channel["state"] for channel in channels] == ["failed", "ok", "ok"]
    assert any("changed their places" in remark for remark in summary["remarks"])


def test_thresholds_and_benchmark_read_these_logs(run: Run):
    Path("logs").mkdir()
    for seed in range(4):
        rng = np.random.default_rng(seed)
        t = np.arange(3000) / 50
        topics = {}
        for i in range(3):
            values = np.stack([np.sin(t), np.cos(t), np.sin(3 * t)], axis=1) + rng.normal(0, 0.01, (3000, 3))
            topics["sensor_gyro", i] = IMU_FIELDS, [(1e6 + 1e6 * s, i + 1, *v) for s, v in zip(t, values, strict=True)]
        Path("logs", f"{seed}.ulg").write_bytes(ulog(topics))
    how = "--budget 3 --persistence 8 --filter 0 --levels 3 --slow-faults none --json"
    made = run(f"thresholds logs {how} --out t.toml")
    assert made.code == 0, made.err
    assert json.loads(made.out)["flights"] == 4
    assert run("vote logs/0.ulg --config t.toml --out a.csv").code == 0
    assert run("vote logs/0.ulg --write w.toml").code == 0
    same = run(f"thresholds logs {how} --config w.toml --out u.toml")
    assert json.loads(same.out)["signals"] == json.loads(made.out)["signals"]


@pytest.mark.long
def test_a_benchmark_reads_these_logs(run: Run):
    for seed in range(2):
        rng = np.random.default_rng(seed)
        t = np.arange(900) / 20
        topics = {
            ("sensor_gyro", i): (
                IMU_FIELDS,
                [
                    (1e6 + 1e6 * s, i + 1, np.sin(s) + e, 0.0, 0.0)
                    for s, e in zip(t, rng.normal(0, 0.01, 900), strict=True)
                ],
            )
            for i in range(3)
        }
        Path(f"{seed}.ulg").write_bytes(ulog(topics))
    mapping = {f"gyro.{i + 1}": f"sensor_gyro/{i}:x" for i in range(3)}
    Path("c.toml").write_text(tomli_w.dumps({"signal": {"gyro": {"threshold": 0.1}}, "mapping": mapping}))
    made = run("benchmark --recordings 0.ulg --recordings 1.ulg --config c.toml --json")
    assert made.code == 0, made.err
    assert {row["signal"] for row in json.loads(made.out)["table"]} == {"gyro"}


@pytest.mark.skipif(not PX4_LOGS.is_dir(), reason="the recorded PX4 logs are not here")
@pytest.mark.parametrize(
    ("name", "signals"),
    [("battery_brownout", 6), ("ekf_failure", 6), ("gps_interference", 7), ("motor_failure", 0), ("sample", 0)],
)
def test_the_real_logs_are_voted_or_have_one_channel(name: str, signals: int, run: Run):
    shutil.copy(PX4_LOGS / f"{name}.ulg", "flight")
    result = run("vote flight --out a.csv --json")
    if not signals:
        assert result.code == 2
        assert "flight: one channel of each sensor: nothing to compare" in result.err
        return
    summary = json.loads(result.out)
    assert len(summary["signals"]) == signals
    assert not any(channel["failed"] for signal in summary["signals"].values() for channel in signal["channels"])
    log_of = open_log(Path("flight"))
    assert log_of is not None
    assert summary["rows"] in range(55, 80)
