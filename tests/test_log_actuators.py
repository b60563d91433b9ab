"""A log with servo actuators: exported, compared, described, cut and recovered."""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from test_verdict_actuators import HARDOVER, given
from typer.testing import CliRunner

from rig.bench.replay.before_after import diff, side
from rig.bench.replay.verify import verify
from rig.cli.main import app
from rig.core.errors import BadInput
from rig.core.frame import ActuatorMonitor
from rig.flight.fly import fly
from rig.log import Log, read_log, recover
from rig.log.columns import PART_COLUMNS, unit_of
from rig.log.export import export
from rig.log.info import info
from rig.log.recordings.flown_log import recorded

OF_SERVOS = [column for column in PART_COLUMNS if column.part == "servo"]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fly(None, overrides=given((HARDOVER,), seconds=3.0), out=tmp_path_factory.mktemp("logs")).log


@pytest.mark.parametrize("to", ["csv", "parquet", "npz"])
def test_a_table_has_the_columns_of_the_servos(log: Path, tmp_path: Path, to: str):
    out, whole = tmp_path / f"x.{to}", read_log(log)
    names = export(whole, to, out, ["actuator.elevator"]).columns
    assert {"actuator.elevator.asked.1", "actuator.elevator.ram", "actuator.elevator.pressure.2"} <= set(names)
    assert not [name for name in names if "rudder" in name] and len(names) == 1 + len(OF_SERVOS) // 3
    assert whole.parts is not None
    expected = whole.parts["servo"]["lvdt"][:, 0, 2]
    if to == "npz":
        table = np.load(out)
        assert table["actuator.elevator.lvdt.3"].tobytes() == expected.tobytes()
        assert table["actuator.elevator.failed_by.2"][-1] == ActuatorMonitor.CURRENT
        return
    frame = pl.read_csv(out) if to == "csv" else pl.read_parquet(out)
    assert frame["actuator.elevator.lvdt.3"].to_numpy().astype("f4").tobytes() == expected.tobytes()
    assert frame["actuator.elevator.failed_by.2"][-1] == "current"


def test_all_owners_are_exported_and_a_vote_reads_none_of_the_servos(log: Path, tmp_path: Path):
    whole = read_log(log)
    of_all, of_vote = (export(whole, "csv", tmp_path / f"{v}.csv", for_vote=v).columns for v in (False, True))
    assert len([name for name in of_all if name.startswith("actuator.")]) == len(OF_SERVOS)
    assert not [name for name in of_vote if name.startswith("actuator.")]
    assert whole.to_polars("actuator.rudder").width == 1 + len(OF_SERVOS) // 3


def test_owners_that_are_not_there_are_refused_with_the_nearest(log: Path, tmp_path: Path):
    with pytest.raises(BadInput, match=r"nearest: actuator\.elevator"):
        export(read_log(log), "csv", tmp_path / "x.csv", ["actuator.elevatr"])
    plain = read_log(fly(None, overrides=["duration_s=0.2"], out=tmp_path).log)
    with pytest.raises(BadInput, match=r"actuator\.elevator: the flight had no servo actuators"):
        export(plain, "csv", tmp_path / "x.csv", ["actuator.elevator"])
    assert not (tmp_path / "x.csv").exists()


def test_the_numbers_have_their_units():
    assert unit_of("actuator.elevator.lvdt_2") == "rad" and unit_of("actuator.rudder.current_1") == ""


def test_a_layout_of_foxglove_is_written(log: Path, tmp_path: Path):
    result = CliRunner().invoke(app, ["export", str(log), "--layout", "foxglove", "--out", str(tmp_path / "x.json")])
    assert result.exit_code == 0 and (tmp_path / "x.json").stat().st_size > 0


def test_logs_are_compared_by_the_servos_too(log: Path, tmp_path: Path):
    other = fly(None, overrides=given((HARDOVER,), ("actuators.lvdt_noise_std=0.001",), 3.0), out=tmp_path).log
    assert diff(side(log), side(log)).identical
    named = {one.name: one.verdict for one in diff(side(log), side(other)).fields}
    assert named["actuator.elevator.lvdt_1"] == "different" and named["actuator.elevator.pressure_1"] == "equal"
    plain = fly(None, overrides=["duration_s=0.2"], out=tmp_path).log
    missing = {one.name for one in diff(side(log), side(plain)).fields if one.verdict == "missing in B"}
    assert missing == {column.path for column in OF_SERVOS}


def test_what_a_log_says_of_itself_counts_the_messages_of_the_servos(log: Path):
    assert info(log)["topics"]["/actuator/rudder"] == 300


def test_a_cut_log_gives_its_servos_back_whole(log: Path, tmp_path: Path):
    data, whole = log.read_bytes(), read_log(log)
    (tmp_path / "cut.mcap").write_bytes(data[: int(len(data) * 0.7)])
    saved = recover(tmp_path / "cut.mcap", tmp_path / "b.mcap")
    assert 0 < saved.frames < 300 and _is_part(read_log(tmp_path / "b.mcap"), whole)
    assert verify(recorded(tmp_path / "b.mcap")).comparison.identical


@pytest.mark.long
def test_a_flight_that_is_killed_leaves_its_servos_whole_up_to_a_second(tmp_path: Path):
    sets = [part for text in given((HARDOVER,), seconds=120.0) for part in ("--set", text)]
    command = [sys.executable, "-m", "rig", "fly", *sets, "--realtime-factor", "4", "--out", str(tmp_path / "logs")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 120.0
        while not any(path.stat().st_size > 400_000 for path in (tmp_path / "logs").glob("*.mcap")):
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
    finally:
        process.kill()
        process.wait()
    (cut,) = (tmp_path / "logs").glob("*.mcap")
    saved = recover(cut, tmp_path / "b.mcap")
    seconds = saved.frames / 100.0
    again = read_log(fly(None, overrides=given((HARDOVER,), seconds=seconds), out=tmp_path).log)
    assert seconds >= 1.0 and _is_part(read_log(tmp_path / "b.mcap"), again)


def _is_part(part: Log, whole: Log) -> bool:
    """Whether ``part`` is the beginning of ``whole``, to the bit."""
    assert part.parts is not None and whole.parts is not None
    n = len(part.rows)
    same = part.parts.tobytes() == whole.parts[:n].tobytes()
    return same and len(part.parts) == n and part.rows["channels"].tobytes() == whole.rows["channels"][:n].tobytes()
