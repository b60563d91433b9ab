"""The monitors of servo actuators replayed from a log: the same to the bit, or what other limits would have said."""

import json
from pathlib import Path
from typing import Any

import pytest
from test_verdict_actuators import HARDOVER, ONSET, given
from typer.testing import CliRunner

from rig.bench.replay.verify import verify
from rig.bench.replay.what_if import changed, what_if
from rig.cli.main import app
from rig.core.errors import BadInput
from rig.core.frame import ActuatorMonitor
from rig.flight.fly import fly
from rig.log import read_log
from rig.log.recordings.flown_log import Recorded, recorded
from rig.log.writer import LogWriter

JAM = 'kind="spool_jam", signal="actuator.elevator"'
LVDT = 'kind="lvdt", signal="actuator.aileron", channels=[3], offset=0.09'
SEVERE = ('turbulence="severe"',)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three faults in severe turbulence, by current, spool, ram and position."""
    overrides = given((JAM, HARDOVER.replace("elevator", "rudder"), LVDT), SEVERE, seconds=4.0)
    return fly(None, overrides=overrides, out=tmp_path_factory.mktemp("logs")).log


@pytest.fixture(scope="module")
def recording(path: Path) -> Recorded:
    return recorded(path)


def test_the_monitors_say_the_same_of_the_recorded_rows_to_the_bit(recording: Recorded):
    parts = read_log(recording.path).parts
    assert parts is not None
    assert len(set(parts["servo"]["failed_by"][-1].ravel())) >= 4  # no monitor, current, position, spool or ram
    found = verify(recording)
    fields = {field.name for field in found.comparison.fields}
    assert found.comparison.identical and not found.decisions.moved
    assert {f"actuator.{name}.failed_by_4" for name in ("elevator", "aileron", "rudder")} <= fields


def test_the_flight_flown_again_has_the_same_rows_of_the_servos(recording: Recorded):
    found = verify(recording, fly=True).comparison
    assert found.identical and "actuator.rudder.lvdt_2" in {field.name for field in found.fields}


@pytest.mark.parametrize("field", ["failed_by", "valve", "valve_differs"])
def test_a_decision_that_was_changed_in_the_log_is_found(recording: Recorded, field: str, tmp_path: Path):
    log, path = read_log(recording.path), tmp_path / "changed.mcap"
    assert log.parts is not None
    log.parts["servo"][field][50, 0, 0] = 1
    with LogWriter(path, log.rate_hz, log.metadata, log.attachments.items(), parts=("servo",)) as writer:
        writer.write(log.table)
    (unequal,) = [one for one in verify(recorded(path)).comparison.fields if one.verdict != "equal"]
    assert (unequal.name, unequal.frames, unequal.first_frame) == (f"actuator.elevator.{field}_1", 1, 50)


def test_a_shorter_persistence_finds_a_runaway_coil_so_much_sooner(recording: Recorded, tmp_path: Path):
    """Its current is wrong from the onset on: five frames were waited for in flight, now three."""
    text = "actuators.current.persistence_s=0.03"
    answer = what_if(recording, changed(recording, None, [text]), tmp_path / "new.mcap", [text])
    (moved,) = [one for one in answer.moved.failures if one.signal == "actuator.rudder"]
    assert (moved.channel, moved.old_frame, moved.new_frame) == (2, ONSET + 4, ONSET + 2)
    decided = [(one.first_frame, one.last_frame, one.old, one.new) for one in answer.moved.moved
               if one.signal == "actuator.rudder" and one.decision == "failed_by"]  # fmt: skip
    assert decided == [(ONSET + 2, ONSET + 3, "none", "current")]


def test_the_log_of_a_what_if_has_the_servos_as_they_would_have_been(recording: Recorded, tmp_path: Path):
    text = "actuators.monitors=false"
    answer = what_if(recording, changed(recording, None, [text]), tmp_path / "new.mcap", [text])
    new, old = read_log(answer.path), read_log(recording.path)
    assert new.parts is not None and old.parts is not None
    assert not new.parts["servo"]["failed_by"].any() and not new.parts["servo"]["valve"].any()
    assert new.parts["servo"]["current"].tobytes() == old.parts["servo"]["current"].tobytes()
    assert not [event for event in new.events if event.name == "actuator channel failed"]
    assert verify(recorded(answer.path)).comparison.identical


@pytest.mark.parametrize("key", ["spool_rad_s=600", "continuity.coverage=0.5", "lvdt_noise_std=0.001", 'model="lag"'])
def test_what_the_monitors_watch_cannot_be_changed_without_flying(recording: Recorded, key: str):
    with pytest.raises(BadInput, match=r"only redundancy\.\* and the monitors in actuators\.\* can be changed"):
        changed(recording, None, [f"actuators.{key}"])


def test_a_flight_without_servos_has_no_monitors_to_change(tmp_path: Path):
    plain = recorded(fly(None, overrides=["duration_s=0.2"], out=tmp_path).log)
    with pytest.raises(BadInput, match="the flight has no servo actuators"):
        changed(plain, None, ["actuators.current.threshold=0.2"])


def test_the_command_prints_what_moved(path: Path, tmp_path: Path):
    def run(*arguments: Any) -> Any:
        return CliRunner().invoke(app, ["replay", str(path), *map(str, arguments)])

    same = run("--json")
    assert same.exit_code == 0 and json.loads(same.stdout)["identical"]
    moved = run("--set", "actuators.current.persistence_s=0.03", "--out", tmp_path / "new.mcap")
    assert moved.exit_code == 0 and "actuator.rudder.2" in moved.stdout
    parts = read_log(tmp_path / "new.mcap").parts
    assert parts is not None and (parts["servo"]["failed_by"][-1, 2, 1]) == ActuatorMonitor.CURRENT
