"""``rig diagnose``: the same verdicts from every format, the page, injected faults, what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from foreign_logs import gyros
from sensor_flights import Flight, Kind, ardupilot, flown, parquet, px4, ros2

import rig as api

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)


def faulty(count: int = 3, size: float = 0.5) -> Flight:
    """A step in gyro y of channel 2."""
    flight = flown(Kind(seed=5, rate_hz=25.0, seconds=40.0, count=count, noise=0.004, vibration=0.005)).copy()
    since, _ = flight.since(1)
    flight.gyro[1, since, 1] += size
    return flight


def written(kind: str, flight: Flight) -> list[str]:
    """Write the flight; return the arguments that read it."""
    if kind == "csv":
        Path("c.toml").write_text(tomli_w.dumps(parquet(Path("a.csv"), flight)))
        return ["a.csv", "--config", "c.toml"]
    {"ulg": px4, "bin": ardupilot, "bag": ros2}[kind](Path(f"a.{kind}"), flight)
    return [f"a.{kind}"]


def told(rig_command: Command, *words: str) -> dict[str, Any]:
    code, out, err = rig_command("diagnose", *words, "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


INSTANCES = {"ulg": ("sensor_gyro/1", "0x16"), "bin": ("IMU/1", None), "bag": ("/imu1", "imu"), "csv": ("gyro.2", None)}


@pytest.mark.parametrize("kind", INSTANCES)
def test_the_wrong_instance_is_named_whatever_the_format(rig_command: Command, kind: str):
    data = told(rig_command, *written(kind, faulty()))
    one = data["signals"]["gyro_y"]
    assert (one["verdict"], one["channel"]) == ("channel", 2)
    assert (one["instance"], one["device"]) == INSTANCES[kind]
    assert one["since_s"] == pytest.approx(16.0, abs=0.5)
    assert one["time_s"] == pytest.approx(data["first_s"] + one["since_s"], abs=1e-5)
    assert one["in_flight"]["isolated"] and one["in_flight"]["at_s"] > 16.5
    assert 0.0 < one["in_flight"]["vote_error"] < 0.5
    others = {name: each["verdict"] for name, each in data["signals"].items() if name != "gyro_y"}
    assert set(others.values()) == {"none"} and len(others) == 5


def test_the_paragraph_names_channel_time_size_and_the_vote(rig_command: Command):
    code, out, err = rig_command("diagnose", *written("bin", faulty()))
    assert (code, err) == (0, "")
    said = " ".join(out.split())
    assert "a.bin: IMU/1 (gyro) is wrong from 1" in said
    assert "Channel 2 (IMU/1) is wrong on gyro_y, beginning 1" in said
    assert "would not be detected" in said and "In flight the manager cross-channel (threshold 0.05 rad/s" in said
    assert "a bound on one log, not a rate" in said


def test_the_summary_is_that_of_the_command(rig_command: Command):
    words = written("csv", faulty())
    found = api.diagnose("a.csv", "c.toml")
    assert json.loads(json.dumps(found.summary)) == told(rig_command, *words)
    assert "gyro.2 (gyro) is wrong from" in repr(found)


def test_one_of_two_is_not_named(rig_command: Command):
    one = told(rig_command, *written("ulg", faulty(2, 0.4)))["signals"]["gyro_y"]
    assert (one["verdict"], one["channel"]) == ("one_of", None)


def test_the_page_is_small_and_has_the_paragraphs(rig_command: Command):
    words = written("bin", faulty())
    code, out, _ = rig_command("diagnose", *words, "--page", "p.html")
    assert code == 0 and "written  p.html" in out
    text = Path("p.html").read_text()
    assert len(text.encode()) < 5_000_000
    assert "IMU/1 (gyro) is wrong from" in text and "gyro_y: differences" in text
    data = json.loads(text.split('id="figures">')[1].split("</script>")[0])
    assert len(data) == 12
    assert {trace["name"] for trace in data["gyro_y: channels"]["data"]} == {
        "channel 1",
        "channel 2",
        "channel 3",
        "vote",
    }


@pytest.mark.long
def test_injected_faults_are_counted_the_same_each_time(rig_command: Command):
    words = written("bin", flown(Kind(seed=6, rate_hz=10.0, seconds=20.0, count=3)))
    data = told(rig_command, *words, "--inject", "step,freeze")
    rows = data["injected"]
    assert {row["fault"] for row in rows} == {"step", "freeze"}
    assert all(row["wrong"] == 0 and row["tried"] == 3 for row in rows)
    large = {"gyro": 0.5, "accel": 5.0}
    assert all(row["correct"] == 3 for row in rows if row["size"] in (None, large[row["signal"][:-2]]))
    assert all(row["correct"] + row["one_of"] + row["missed"] + row["wrong"] == 3 for row in rows)
    assert told(rig_command, *words, "--inject", "freeze,step") == data
    _, out, _ = rig_command("diagnose", *words, "--inject", "freeze")
    assert "faults tried on copies of this log" in out


def refused(rig_command: Command, *words: str) -> str:
    code, out, err = rig_command("diagnose", *words)
    assert (code, out) == (2, "") and err.startswith("error: ") and err.count("\n") == 1
    return err


def test_what_cannot_be_compared_is_one_line(rig_command: Command):
    Path("one.ulg").write_bytes(gyros(1))
    assert "nothing to compare" in refused(rig_command, "one.ulg")
    Path("cut.ulg").write_bytes(gyros(2)[:12])
    refused(rig_command, "cut.ulg")
    Path("empty.bin").write_bytes(b"")
    assert "empty" in refused(rig_command, "empty.bin")
    Path("two.ulg").write_bytes(gyros(2))
    assert "unknown preset 'px5'" in refused(rig_command, "two.ulg", "--preset", "px5")
    assert "--preset px4, not ardupilot" in refused(rig_command, "two.ulg", "--preset", "ardupilot")
    assert "unknown fault 'steps'" in refused(rig_command, "two.ulg", "--inject", "steps")
    assert "must end with .html" in refused(rig_command, "two.ulg", "--page", "p.txt")
    Path("a.csv").write_text("time_s,gyro.1,gyro.2\n0,1,2\n")
    assert "--config is needed" in refused(rig_command, "a.csv")


def test_few_rows_are_unknown_and_no_error(rig_command: Command):
    Path("few.ulg").write_bytes(gyros(3, rows=12))
    data = told(rig_command, "few.ulg")
    assert {one["verdict"] for one in data["signals"].values()} == {"unknown"}
    assert "11 common rows: too few to compare" in data["quantities"]["gyro"]["text"]


def test_a_unit_that_stops_is_named(rig_command: Command):
    flight = flown(Kind(seed=7, rate_hz=25.0, seconds=40.0, count=3))
    Path("c.toml").write_text(tomli_w.dumps(parquet(Path("a.csv"), flight, "gyro")))
    lines = Path("a.csv").read_text().splitlines()
    at = lines[0].split(",").index("gyro_x.2")
    lost = [",".join("" if i == at else cell for i, cell in enumerate(line.split(","))) for line in lines[600:]]
    Path("a.csv").write_text("\n".join([*lines[:600], *lost]) + "\n")
    one = told(rig_command, "a.csv", "--config", "c.toml")["signals"]["gyro_x"]
    assert (one["verdict"], one["channel"], one["kind"]) == ("channel", 2, "no samples")
    assert one["since_s"] == pytest.approx(23.92, abs=0.1)
