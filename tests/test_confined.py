"""Limits of a process that works for an agent: what it reads and writes, how long it flies; it runs no code."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.core import confined
from rig.core.confined import VARIABLE, environment, is_below, may_read, may_run_code, may_write, scratch_folder
from rig.core.errors import BadInput
from rig.core.files import draft, is_file, is_folder, new_folder, read_bytes, write_text
from rig.core.trust import Trust
from rig.flight.loop import Rig
from rig.scenario.scenario import load
from rig.studies.campaign.study_folder import locked
from rig.unit.unit_file import read_unit

FRAMES = 100


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Three folders, of which this process writes ``agent`` and reads ``given`` too, until the test ends."""
    for name in ("agent", "given", "secret"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x.toml").write_text("duration_s = 1.0\n")
    (variable,) = environment(tmp_path / "agent", [tmp_path / "given"], FRAMES).items()
    monkeypatch.setenv(*variable)
    confined.limits.cache_clear()
    yield tmp_path
    monkeypatch.undo()
    confined.limits.cache_clear()


def test_a_process_without_the_variable_has_no_limits(tmp_path: Path):
    assert VARIABLE not in os.environ
    assert may_read(Path("/etc/passwd")) and may_write(tmp_path / "x") and may_run_code()


def test_files_of_the_folders_are_read_and_no_others_are_there(place: Path):
    for name in ("agent", "given"):
        assert is_file(place / name / "x.toml") and is_folder(place / name)
        assert read_bytes(place / name / "x.toml", 100) == b"duration_s = 1.0\n"
    assert not is_file(place / "secret" / "x.toml") and not is_folder(place / "secret")
    with pytest.raises(BadInput, match=r"secret/x\.toml: is outside the folders that rig mcp may read"):
        read_bytes(place / "secret" / "x.toml", 100)


def test_a_link_and_a_path_with_two_dots_lead_to_where_they_lead(place: Path):
    (place / "agent" / "link").symlink_to(place / "secret")
    (place / "agent" / "file.toml").symlink_to(place / "secret" / "x.toml")
    (place / "secret" / "back").symlink_to(place / "given")
    outside = ["agent/link/x.toml", "agent/file.toml", "agent/../secret/x.toml", "given/a/../../secret/x.toml"]
    assert [name for name in outside if is_file(place / name)] == []
    assert is_file(place / "secret" / "back" / "x.toml")  # it lies in ``given``


@pytest.mark.parametrize("name", ["secret/o", "secret/new/o", "agent/link/o", "agent/../secret/o", "given/o"])
def test_nothing_is_written_outside_the_folder(place: Path, name: str):
    (place / "agent" / "link").symlink_to(place / "secret")
    before = sorted(place.rglob("*"))
    path = place / name
    with pytest.raises(BadInput, match="is outside the folder that rig mcp may write"), draft(path):
        raise AssertionError("entered")
    with pytest.raises(BadInput, match="may write"), new_folder(path):
        raise AssertionError("entered")
    with pytest.raises(BadInput, match="may write"), locked(path, "busy"):
        raise AssertionError("entered")
    assert sorted(place.rglob("*")) == before


def test_a_link_in_the_folder_is_replaced_and_its_target_stays(place: Path):
    (place / "agent" / "o").symlink_to(place / "secret" / "x.toml")
    write_text(place / "agent" / "o", "new")
    assert (place / "secret" / "x.toml").read_text() == "duration_s = 1.0\n"
    assert not (place / "agent" / "o").is_symlink()


def test_bundled_scenarios_and_aircraft_are_read(place: Path):
    assert load("f16_pitch_rate_hardover", ["duration_s=0.1"]).frames == 10


@pytest.mark.parametrize("override", ["aircraft={}/secret/craft", "sensors.pitch_rate.noise_file={}/secret/noise.csv"])
def test_a_setting_that_names_a_file_elsewhere_is_refused_as_a_missing_file(place: Path, override: str):
    """The message is that of a file that is not there: it does not tell whether there is one."""
    (place / "secret" / "craft").mkdir()
    (place / "secret" / "craft" / "aircraft.toml").write_text("")
    (place / "secret" / "noise.csv").write_text("0,0,0,0\n0,0,0,0\n")
    with pytest.raises(BadInput, match=r"unknown aircraft|no such file"):
        Rig(load("f16_pitch_rate_hardover", [override.format(place)]))


def test_no_class_is_run_whatever_permits_it(place: Path):
    for trust in (Trust(), Trust(allow_code=True), Trust(named="mine:X"), Trust().allowing(True)):
        with pytest.raises(BadInput, match=r"redundancy\.manager: 'mine:X' is code, and rig mcp runs no code"):
            trust.require("mine:X")
        trust.require("median")


def test_no_unit_is_run(place: Path):
    with pytest.raises(BadInput, match="a unit under test is code, and rig mcp runs no code"):
        read_unit(place / "agent" / "x.toml")


def test_a_flight_that_is_too_long_is_refused_before_its_first_frame(place: Path):
    assert Rig(load(None, ["duration_s=1", "faults=[]"])).scenario.frames == FRAMES
    with pytest.raises(
        BadInput, match=r"duration_s: 101 frames; rig mcp flies at most 100 \(duration_s times rate_hz\)"
    ):
        Rig(load(None, ["duration_s=1.01", "faults=[]"]))


def test_a_scratch_folder_is_read_and_written_until_it_is_removed(place: Path):
    with scratch_folder() as folder:
        write_text(folder / "o", "text")
        assert is_file(folder / "o") and not is_file(place / "secret" / "x.toml")
    assert not folder.exists() and not may_read(folder) and not may_write(folder / "o")


def test_the_limits_are_those_of_the_processes_that_are_started_too(place: Path):
    code = "import json; from rig.core.confined import *; print(json.dumps([may_run_code(), limits().frames]))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(ran.stdout) == [False, FRAMES]


def test_a_circle_of_links_and_no_name_are_below_no_folder(tmp_path: Path):
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert not is_below(Path("a\0b"), [tmp_path])
    assert is_below(tmp_path / "none", [tmp_path]) and not is_below(tmp_path.parent, [tmp_path])


def test_what_a_call_may_reach_makes_only_temporary_folders_that_it_may_use():
    """Others would be outside its folders; ``rig campaign plan``, whose processes write there, is no tool."""
    rooms = (Path(confined.__file__).parents[1] / room for room in ("bench", "studies", "verdict"))
    sources = [path for room in rooms for path in room.rglob("*.py")]
    assert len(sources) > 50
    assert [path.name for path in sources if "TemporaryDirectory" in path.read_text()] == ["estimate.py"]
