"""The commands as a user runs them: exit codes, one line for bad input, JSON that parses."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rig.cli import main as cli

SHORT = ["--set", "duration_s=2", "--set", "faults=[]"]
SERVO = ["fly", "--set", 'actuators.model="servo"', "--set"]


def rig(*arguments: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
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
        (["bench", "nowhere.toml"], "no such file"),
        (["fly", "no\nwhere\x1b[2J.toml"], "no where\\u001b[2J.toml: no such file"),
        (["fly", "x" * 5000], ": no such file; nearest bundled: "),
        (["diff", "x" * 5000, "y"], "File name too long"),
        (["campaign", "run", "smoke", "--out", "o", "--workers", str(2**64)], "less than or equal to 1024"),
        (["study", "rate-bias", "--seeds", str(2**64)], "less than or equal to 1000"),
        (["study", "rate-bias", "--drawn", str(2**64)], "less than or equal to 1000000"),
        (
            ["fly", "--set", 'airframe.flight_points=[{name="20000ft_m06",altitude_m=24000.0,mach=0.1}]', *SHORT],
            "no level trim",
        ),
        (
            [*SERVO, 'faults=[{kind="spool_jam",signal="actuator.elevator",channels=[1],start_s=1}]'],
            "spool_jam sits on what the channels of actuator.elevator share, give none, got [1]",
        ),
        (
            [*SERVO, 'faults=[{kind="coil_open",signal="actuator.elevator",channels=[5],start_s=1}]'],
            "channels are different numbers from 1 to 4, got [5]",
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
def test_bad_input_is_one_line_exit_code_2_and_nothing_written(arguments, says, tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["rig", *arguments])
    with pytest.raises(SystemExit) as end:
        cli.main()
    said = capsys.readouterr()
    assert end.value.code == 2
    assert said.out == ""
    assert said.err.count("\n") == 1 and said.err.startswith("error: ") and says in said.err
    assert len(said.err) <= 600 and said.err.rstrip("\n").isprintable()
    assert list(tmp_path.rglob("*")) == []


def test_a_process_with_bad_input_ends_with_one_line_and_exit_code_2(tmp_path: Path):
    out = rig("fly", "no\nwhere\x1b[2J.toml", cwd=tmp_path)
    assert (out.returncode, out.stdout) == (2, "")
    assert out.stderr.startswith("error: no where\\u001b[2J.toml: no such file") and out.stderr.count("\n") == 1


def test_a_wrong_flag_is_exit_code_2(tmp_path: Path):
    assert rig("fly", "--sede", "3", cwd=tmp_path).returncode == 2


def test_a_flight_in_a_pipe_prints_one_json_object_and_leaves_its_log(tmp_path: Path):
    out = rig("fly", *SHORT, "--json", cwd=tmp_path)
    assert (out.returncode, out.stderr) == (0, "")
    flown = json.loads(out.stdout)
    assert flown["frames"] == 200 and flown["survived"] and flown["failed"] == {}
    assert (tmp_path / flown["log"]).is_file()
    keys = ["log", "frames", "duration_s", "seed", "digest", "survived", "end_reason", "failed", "events", "timing"]
    assert set(keys) <= set(flown)
    assert set(flown["timing"]) >= {"us_per_frame", "realtime_factor"}


def test_a_log_folder_that_cannot_be_made_is_refused_before_the_flight(tmp_path: Path):
    (tmp_path / "file").write_text("")
    out = rig("fly", *SHORT, "--out", "file/logs", cwd=tmp_path)
    assert out.returncode == 2 and out.stderr.count("\n") == 1 and "file/logs" in out.stderr


def test_a_file_that_is_no_mcap_is_refused(tmp_path: Path):
    (tmp_path / "a.mcap").write_text("not a log")
    out = rig("recover", "a.mcap", cwd=tmp_path)
    assert out.returncode == 2 and out.stderr.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_ctrl_c_leaves_a_finished_readable_log(tmp_path: Path):
    import rig.log

    command = [sys.executable, "-m", "rig", "fly", "--json", "--realtime-factor", "1", "--set", "faults=[]"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and sum(p.stat().st_size for p in tmp_path.rglob("*.mcap")) < 200_000:
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGINT)
    stdout, _ = process.communicate(timeout=30)
    flown = json.loads(stdout)
    assert process.returncode == 0 and flown["end_reason"] == "interrupted" and flown["survived"]
    log = rig.log.read_log(tmp_path / flown["log"])
    assert len(log.rows) == flown["frames"] < 6000


def test_the_resolved_scenario_can_be_flown(tmp_path: Path):
    shown = rig("scenario", "show", *SHORT)
    (tmp_path / "resolved.toml").write_text(shown.stdout)
    one = json.loads(rig("fly", *SHORT, "--json", cwd=tmp_path).stdout)
    two = json.loads(rig("fly", "resolved.toml", "--json", cwd=tmp_path).stdout)
    assert one["digest"] == two["digest"]


def test_bundled_scenarios_are_listed_with_their_titles():
    found = json.loads(rig("scenario", "list", "--json").stdout)
    assert len(found) > 60 and "F-16" in found["f16_pitch_rate_hardover"]


def test_aircraft_are_listed_with_their_flight_points():
    found = json.loads(rig("aircraft", "list", "--json").stdout)
    assert set(found) == {"f16", "b747", "b737", "b707"} and len(found["f16"]) >= 4


def test_the_command_starts_without_the_libraries_that_only_some_of_it_needs():
    heavy = "('numpy', 'numba', 'scipy', 'polars', 'rerun')"
    program = f"import sys, rig.cli.main; print([n for n in {heavy} if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]"


def test_a_campaign_starts_without_the_statistics_of_its_report():
    program = "import sys, rig.studies.campaign.run_campaign; print([n for n in ('scipy.stats', 'scipy.ndimage') if n in sys.modules])"  # noqa: E501
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "[]"
