"""``rig score``: of a log on disk, as a user runs it, and what it refuses."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from rig.cli.main import app
from rig.core.errors import BadInput, BadLog
from rig.core.frame import DISCRETE_INDEX, Table
from rig.flight.fly import Flight, fly
from rig.flight.loop import fly_rows
from rig.log import recover
from rig.log.of_flight import metadata
from rig.log.writer import LogWriter
from rig.scenario import scenario
from rig.verdict.of_log import score_log
from rig.verdict.score_records import Yardstick
from rig.verdict.scoring import score
from rig.verdict.transients import fly_baseline

SHORT = ["duration_s=6", "faults.0.start_s=3"]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return fly("f16_pitch_rate_hardover", overrides=SHORT, out=tmp_path_factory.mktemp("logs"))


def run(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["score", *arguments])


def test_the_score_of_a_log_is_that_of_its_rows(flight: Flight):
    found = score_log(flight.log, Yardstick())
    assert found.score == score(flight.scenario, Table(flight.rows), fly_baseline(flight.scenario))
    assert found.digest == flight.digest


def test_json_is_one_object_with_the_keys_of_the_page(flight: Flight):
    out = run(str(flight.log), "--json")
    assert out.exit_code == 0, out.output
    found = json.loads(out.stdout)
    keys = {"faults", "false_alarms", "wrong_isolations", "tie_break", "vote_error", "flight", "coverage"}
    assert keys <= set(found)
    (fault,) = found["faults"]
    wanted = {"id", "signal", "channel", "kind", "onset_frame", "exceeded_frame", "failed_frame", "outcome"}
    assert wanted <= set(fault)
    assert (fault["outcome"], fault["onset_frame"], fault["failed_frame"]) == ("detected", 300, 307)
    assert found["flight"]["survived"] and found["flight"]["transients"]["within_limits"]
    assert found["vote_error"]["pitch_rate"]["above_threshold_s"] == 0.0


def test_every_key_of_the_json_is_on_the_page(flight: Flight):
    page = (Path(__file__).parent.parent / "docs" / "reference" / "scores-and-tables.md").read_text()
    found = json.loads(run(str(flight.log), "--json").stdout)

    def keys(node: Any) -> set[str]:
        if isinstance(node, list):
            return set().union(*map(keys, node)) if node else set()
        return set(node).union(*map(keys, node.values())) if isinstance(node, dict) else set()

    of_one = {"vote_error": found["vote_error"]["heading"], "coverage": found["coverage"]["overall"]}
    of_one["signals"] = found["signals"]["heading"]
    assert set(found["wrong_votes_s"]) == set(DISCRETE_INDEX)
    named = keys({**found, **of_one, "wrong_votes_s": 0.0})
    assert {key for key in named if f"`{key}`" not in page} == set()


def test_without_the_baseline_there_are_no_transients(flight: Flight):
    out = run(str(flight.log), "--json", "--no-baseline")
    assert json.loads(out.stdout)["flight"]["transients"] is None


def test_the_yardstick_is_a_setting(flight: Flight):
    out = run(str(flight.log), "--json", "--transient-load-factor", "1e-6", "--transient-window-s", "1")
    found = json.loads(out.stdout)["flight"]["transients"]
    assert found["limits"]["load_factor"] == 1e-6 and not found["within_limits"]
    assert found["windows"][0]["frames"] == 101


def test_for_people_it_says_the_outcome_and_where(flight: Flight):
    out = run(str(flight.log))
    assert out.exit_code == 0
    for said in (
        *("hardover pitch_rate.3", "detected", "3.07 s (frame 307)", "70 ms", "survived"),
        "compared with the fault-free baseline",
    ):
        assert said in out.stdout


def test_a_flight_with_a_manager_of_the_users_own_is_scored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    example = Path(__file__).parent.parent / "docs" / "examples" / "manager" / "mine.py"
    (tmp_path / "own_scored.py").write_text(example.read_text())
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    which = scenario.load(None, [*SHORT, "redundancy.manager=own_scored:Smoothed"])
    found = score(which, Table(fly_rows(which)), fly_baseline(which))
    assert [fault.outcome for fault in found.faults] == ["detected"] and found.episodes == []


def line(path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        score_log(path, Yardstick(), baseline=False)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_log_without_a_verdict_is_refused(flight: Flight, tmp_path: Path):
    path = tmp_path / "open.mcap"
    with LogWriter(path, 100.0, metadata(flight.scenario), []) as writer:
        writer.write(Table(flight.rows[:100], timing=np.zeros(100, [("frame_us", "f8"), ("late_us", "f8")])), [])
    assert "the flight is not finished" in line(path)


def test_a_recovered_log_is_refused(flight: Flight, tmp_path: Path):
    cut, mended = tmp_path / "cut.mcap", tmp_path / "mended.mcap"
    cut.write_bytes(flight.log.read_bytes()[:-60_000])
    with pytest.raises(BadLog, match="truncated"):
        score_log(cut, Yardstick(), baseline=False)
    assert not recover(cut, mended).complete
    assert "the flight is not finished" in line(mended)


def test_a_log_without_a_scenario_is_refused(flight: Flight, tmp_path: Path):
    path = tmp_path / "voted.mcap"
    with LogWriter(path, 100.0, {}, []) as writer:
        writer.write(Table(flight.rows[:10], timing=np.zeros(10, [("frame_us", "f8"), ("late_us", "f8")])), [])
        writer.close({})
    assert "no scenario" in line(path)


def test_what_is_no_log_is_one_line_and_exit_code_2(rig_command: Any, tmp_path: Path):
    (tmp_path / "notes.mcap").write_text("not a log")
    for name, says in (("notes.mcap", "not an MCAP file"), ("nowhere.mcap", "no such file")):
        code, out, err = rig_command("score", name, "--json")
        assert (code, out) == (2, "") and err.startswith("error: ") and err.count("\n") == 1 and says in err


def test_rows_of_another_seed_are_refused(flight: Flight):
    with pytest.raises(BadInput, match="do not reproduce the recorded channels"):
        score(flight.scenario.model_copy(update={"seed": 77}), Table(flight.rows))


def test_a_flight_of_twenty_seconds_is_scored_in_milliseconds():
    which = scenario.load("f16_split_2_2_level", ["duration_s=20"])
    rows = fly_rows(which)
    took = []
    for _ in range(5):
        began = time.process_time()
        score(which, Table(rows))
        took.append(time.process_time() - began)
    assert min(took) < 0.05  # 6 to 11 ms on the busy machine that it was written on
