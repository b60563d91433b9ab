"""What two commits decide, told apart: tests/tools/decisions.py on flights of a second."""

import re
from pathlib import Path

import numpy as np
import pytest
from tools import decisions

from rig.core.frame import INDEX, Block

SCENARIO = """aircraft = "f16"
duration_s = {duration_s}
[[faults]]
kind = "hardover"
signal = "pitch_rate"
channels = [3]
start_s = {start_s}
"""


def fly(folder: Path, start_s: float = 0.5, duration_s: float = 1.0, every: bool = True) -> Path:
    """A folder with one flight, as `fly` of the tool keeps it."""
    folder.mkdir()
    scenario = folder / "hardover.toml"
    scenario.write_text(SCENARIO.format(start_s=start_s, duration_s=duration_s))
    decisions.fly_one(scenario, folder, every)
    return folder


@pytest.fixture(scope="module")
def early(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fly(tmp_path_factory.mktemp("kept") / "early")


@pytest.fixture
def rows(early: Path) -> Block:
    return decisions.read(early / "hardover.npz")[0]


@pytest.mark.parametrize("every", [False, True])
def test_the_same_flight_is_equal(early: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], every: bool):
    assert not decisions.diff(early, fly(tmp_path / "again"), every)
    said = capsys.readouterr().out
    assert "equal in 1 of 1 scenarios" in said and "hardover" not in said


def test_a_later_failure_is_told_with_frames_times_and_rule(
    early: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert decisions.diff(early, fly(tmp_path / "late", start_s=0.6, every=False), False)
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "hardover"
    assert "  pitch_rate.3 failed: 57 (0.57 s) by comparison -> 67 (0.67 s) by comparison" in said
    assert "  pitch_rate level: 57 (0.57 s) 3 -> 67 (0.67 s) 3" in said
    assert said[-2:] == ["decisions equal in 0 of 1 scenarios", "  1 differ in failed, level"]


def test_another_end_is_told(early: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert decisions.diff(early, fly(tmp_path / "short", duration_s=0.9), True)
    assert "  flight: duration flown, 100 frames -> duration flown, 90 frames" in capsys.readouterr().out


def test_a_scenario_that_is_gone_is_a_difference(early: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert decisions.diff(early, tmp_path, False)
    assert "only in OLD: scenarios hardover" in capsys.readouterr().out


def test_a_field_that_is_gone_is_a_difference(early: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    few = fly(tmp_path / "few", every=False)
    assert decisions.diff(early, few, True) and not decisions.diff(few, early, True)
    assert "surface_command, trend_high, trend_low, truth" in capsys.readouterr().out


def test_without_rows_the_decisions_alone_are_kept(tmp_path: Path):
    kept, _ = decisions.read(fly(tmp_path / "few", duration_s=0.1, every=False) / "hardover.npz")
    assert set(kept.dtype.names or ()) == set(decisions.DECIDED)


def test_one_bit_is_found_in_its_field_and_frame(rows: Block):
    other = rows.copy()
    other["voted"][42, 3] = np.nextafter(other["voted"][42, 3], 99.0)
    other["command"][7:9, 0] = -other["command"][7:9, 0]
    assert decisions.unequal(rows, rows.copy()) == []
    assert decisions.unequal(rows, other) == [
        ("voted", "  voted: 1 of 100 frames, from frame 42 on"),
        ("command", "  command: 2 of 100 frames, from frame 7 on"),
    ]


def test_a_field_that_has_grown_is_compared_in_the_columns_of_both(rows: Block):
    wider = np.zeros(len(rows), [("frame", "i8"), ("inertial", "f8", (rows["inertial"].shape[1] + 2,))])
    wider["inertial"][:, :-2], wider["inertial"][:, -2:] = rows["inertial"], 1.0
    wider["frame"] = rows["frame"]
    assert decisions.unequal(rows, wider) == []
    wider["inertial"][5, 0] += 1.0
    assert [field for field, _ in decisions.unequal(rows, wider)] == ["inertial"]


def test_a_pattern_is_told_with_who_answers_it_and_when_it_is_over(rows: Block):
    split = rows.copy()
    s = INDEX["yaw_rate"]
    split["pattern"][20:30, s], split["decided_by"][20:24, s], split["decided_by"][24:30, s] = 2, 6, 3
    ((what, line),) = decisions.moved(rows, split, 100.0)
    assert what == "pattern"
    assert line == "  yaw_rate pattern: - -> 20 (0.20 s) 2:2 unresolved, 24 (0.24 s) 2:2 reference, 30 (0.30 s) over"


def test_of_many_changes_the_first_are_told(rows: Block):
    restless = rows.copy()
    restless["reference_usable"][:, INDEX["heading"]] = np.arange(len(rows)) % 2
    steady = rows.copy()
    steady["reference_usable"][:, INDEX["heading"]] = 0
    ((_, line),) = decisions.moved(steady, restless, 100.0)
    assert re.fullmatch(r"  heading reference usable: - -> 1 \(.* s\) 1, 2 .*, 3 .*, 4 \(0.04 s\) 0, 95 more", line)


def test_what_stands_from_the_first_frame_on_is_told(rows: Block):
    without = rows.copy()
    without["reference_usable"][:, INDEX["heading"]] = 0
    found = [("reference usable", "  heading reference usable: - -> 0 (0.00 s) 1")]
    assert decisions.moved(without, rows, 100.0) == found


def test_what_a_log_of_before_does_not_have_is_left_out(rows: Block):
    old = rows[[name for name in rows.dtype.names or () if name != "common_mode"]]
    assert decisions.moved(old, rows, 100.0) == [] and decisions.unequal(old, rows) == []


def test_a_readmitted_channel_is_told(rows: Block):
    back = rows.copy()
    back["state"][80:, INDEX["pitch_rate"], 2] = 0
    ((_, line),) = decisions.moved(rows, back, 100.0)
    assert line == "  pitch_rate.3 failed: - -> 80 (0.80 s) readmitted"


def test_the_command_flies_bundled_scenarios_into_a_new_folder_and_compares(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    name, out = "f16_pitch_rate_offset_in_manoeuvre", str(tmp_path / "out")

    def run(*arguments: str) -> int:
        monkeypatch.setattr("sys.argv", ["decisions.py", *arguments])
        return decisions.main()

    assert run("fly", out, "--rows", "--only", name, "--workers", "1") == 0
    assert run("diff", out, out, "--rows") == 0
    said = capsys.readouterr().out
    assert f"{name}: duration flown, 1200 frames" in said
    assert " fields of 1200 frames equal in 1 of 1 scenarios" in said
    with pytest.raises(SystemExit, match="2"):
        run("fly", out, "--only", name)
    assert "exists already" in capsys.readouterr().err
