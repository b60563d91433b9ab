"""The commands as a user runs them: exit codes, one line for bad input, JSON that parses."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SHORT = ["--set", "duration_s=2", "--set", "faults=[]"]
SERVO = ["fly", "--set", 'actuators.model="servo"', "--set"]


def rig(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The command as a process, for what only a process has."""
    command = [sys.executable, "-m", "rig", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["fly", "nowhere.toml"], "nowhere.toml: no such file; nearest bundled: "),
        (["fly", "--set", "duration=3"], "duration: unknown key"),
        (["fly", "--rerun", "sometimes", *SHORT], "rerun"),
        (["fly", "--rerun", "rerun+http://192.0.2.1:9876/proxy", *SHORT], "127.0.0.1"),
        (["scenario", "check", "--set", "faults.0.signal=foo"], "unknown signal"),
        (["aircraft", "show", "zeppelin"], "unknown aircraft 'zeppelin'"),
        (["aircraft", "design", "zeppelin"], "unknown aircraft 'zeppelin'"),
        (["recover", "nowhere.mcap"], "nowhere.mcap"),
        (["cost", "nowhere.toml"], "no such file"),
        (["fly", "no\nwhere\x1b[2J.toml"], "no where\\u001b[2J.toml: no such file"),
        (["fly", "x" * 5000], ": no such file; nearest bundled: "),
        (["diff", "x" * 5000, "y"], "File name too long"),
        (["campaign", "run", "smoke", "--out", "o", "--workers", str(2**64)], "must be at most 1024"),
        (["study", "rate-bias", "--seeds", str(2**64)], "must be at most 1000;"),
        (["study", "rate-bias", "--drawn", str(2**64)], "must be at most 1000000"),
        (
            ["fly", "--set", 'airframe.flight_points=[{name="20000ft_m06",altitude_m=24000.0,mach=0.1}]', *SHORT],
            "no level trim",
        ),
        (
            [*SERVO, 'faults=[{kind="spool_jam",signal="actuator.elevator",channels=[1],start_s=1}]'],
            "spool_jam acts on a part that all channels of actuator.elevator share, give none, got [1]",
        ),
        (
            [*SERVO, 'faults=[{kind="coil_open",signal="actuator.elevator",channels=[5],start_s=1}]'],
            "channels must be different numbers from 1 to 4, got [5]",
        ),
        (
            [*SERVO, 'faults=[{kind="coil_open",signal="actuator.elevatr",channels=[1],start_s=1}]'],
            "no such actuator, allowed: actuator.elevator, actuator.aileron, actuator.rudder, got 'actuator.elevatr'",
        ),
        ([*SERVO, "actuators.spool_rad_s=50"], "allowed: at least 4, which is 80.8 rad/s"),
        (
            [*SERVO, "aircraft=b707", "--set", "flight_point=35000ft_m08", "--set", "faults=[]"],
            "a linear aircraft has no",
        ),
    ],
)
def test_bad_input_is_one_line_exit_code_2_and_nothing_written(rig_command: Any, arguments, says, tmp_path: Path):
    code, out, err = rig_command(*arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and err.startswith("error: ") and says in err
    assert len(err) <= 600 and err.rstrip("\n").isprintable()
    assert list(tmp_path.rglob("*")) == []


def test_a_process_with_bad_input_ends_with_one_line_and_exit_code_2(tmp_path: Path):
    out = rig("fly", "no\nwhere\x1b[2J.toml", cwd=tmp_path)
    assert (out.returncode, out.stdout) == (2, "")
    assert out.stderr.startswith("error: no where\\u001b[2J.toml: no such file") and out.stderr.count("\n") == 1


def test_a_wrong_flag_is_exit_code_2(rig_command: Any):
    assert rig_command("fly", "--sede", "3")[0] == 2


def test_a_flight_in_a_pipe_prints_one_json_object_and_leaves_its_log(tmp_path: Path):
    out = rig("fly", *SHORT, "--json", cwd=tmp_path)
    assert (out.returncode, out.stderr) == (0, "")
    flown = json.loads(out.stdout)
    assert flown["frames"] == 200 and flown["survived"] and flown["failed"] == {}
    assert (tmp_path / flown["log"]).is_file()
    keys = ["log", "frames", "duration_s", "seed", "digest", "survived", "end_reason", "failed", "events", "timing"]
    assert set(keys) <= set(flown)
    assert set(flown["timing"]) >= {"us_per_frame", "realtime_factor"}


def test_a_log_folder_that_cannot_be_made_is_refused_before_the_flight(rig_command: Any, tmp_path: Path):
    (tmp_path / "file").write_text("")
    code, _, err = rig_command("fly", *SHORT, "--out", "file/logs")
    assert code == 2 and err.count("\n") == 1 and "file/logs" in err


def test_a_file_that_is_no_mcap_is_refused(rig_command: Any, tmp_path: Path):
    (tmp_path / "a.mcap").write_text("not a log")
    code, _, err = rig_command("recover", "a.mcap")
    assert code == 2 and err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_the_resolved_scenario_can_be_flown(rig_command: Any, tmp_path: Path):
    (tmp_path / "resolved.toml").write_text(rig_command("scenario", "show", *SHORT)[1])
    one, two = (json.loads(rig_command("fly", *given, "--json")[1]) for given in (SHORT, ["resolved.toml"]))
    assert one["digest"] == two["digest"]


def test_bundled_scenarios_are_listed_with_their_titles(rig_command: Any):
    found = json.loads(rig_command("scenario", "list", "--json")[1])
    assert len(found) > 60 and "F-16" in found["f16_pitch_rate_hardover"]


def test_aircraft_are_listed_with_their_flight_points(rig_command: Any):
    found = json.loads(rig_command("aircraft", "list", "--json")[1])
    assert set(found) == {"f16", "b747", "b737", "b707"} and len(found["f16"]) >= 4
