"""The folder of a unit's process: empty when it starts, gone with it, whoever is killed."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from unit_files import needs_a_compiler, udp, unit

import rig
from rig.core.errors import RigError
from rig.unit.guard import remove
from rig.unit.processes import UnitProcess
from rig.unit.unit_file import Unit

SHORT = ("duration_s=1", "faults=[]")
FOLDER = re.compile(r"FOLDER=(\S+) (-?\d+)")


@pytest.fixture(autouse=True)
def temporary(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of temporary files of its own, in which nothing is left behind."""
    folder = tmp_path_factory.mktemp("temporary")
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    monkeypatch.setenv("TMPDIR", str(folder))
    yield folder
    assert [path.name for path in folder.iterdir() if path.name.startswith("rig-unit-")] == []


def until(look: Callable[[], Any]) -> Any:
    for _ in range(600):
        if found := look():
            return found
        time.sleep(0.05)
    raise AssertionError("it did not happen within 30 s")


@needs_a_compiler
def test_each_process_has_an_empty_folder_of_its_own(tmp_path: Path, temporary: Path):
    folders = []
    for tested in (unit(tmp_path, "reads"), udp(tmp_path, [], "reads"), unit(tmp_path, "reads")):
        found = FOLDER.search(rig.fly(overrides=SHORT, out=tmp_path, unit=tested).printed)
        assert found is not None and found[2] == "0" and Path(found[1]).parent == temporary
        folders.append(found[1])
    assert len(set(folders)) == 3 and not any(map(os.path.lexists, folders))


@needs_a_compiler
@pytest.mark.parametrize("way", ["leave", "replace"])
def test_whatever_a_unit_leaves_is_removed_and_nothing_behind_a_link(tmp_path: Path, way: str):
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "kept").write_text("1")
    outside.chmod(0o750)
    tested = unit(tmp_path, "reads", environment={"WAY": way, "OUTSIDE": str(outside)})
    assert rig.fly(overrides=SHORT, out=tmp_path, unit=tested).survived
    assert (outside / "kept").read_text() == "1" and outside.stat().st_mode & 0o777 == 0o750


@needs_a_compiler
def test_a_unit_that_dies_leaves_nothing_and_a_restarted_one_has_a_new_folder(tmp_path: Path):
    dies = {"environment": {"WAY": "abort"}}
    with pytest.raises(RigError, match=r"frame 50: killed by signal 6 \(SIGABRT\)"):
        rig.fly(overrides=SHORT, out=tmp_path, unit=unit(tmp_path, "reads", **dies))
    tested = udp(tmp_path, [["die", 20, 20, str(tmp_path / "died")]], "reads", on_dead="restart")
    found = FOLDER.findall(rig.fly(overrides=SHORT, out=tmp_path, unit=tested).printed)
    assert len(found) == 2 and found[0] != found[1] and [entries for _, entries in found] == ["0", "0"]


@needs_a_compiler
def test_a_unit_that_hangs_and_is_killed_leaves_nothing(tmp_path: Path):
    tested = unit(tmp_path, "reads", environment={"WAY": "hang"}, timeout_s=0.2, on_dead="hold")
    flight = rig.fly(overrides=SHORT, out=tmp_path, unit=tested)
    assert flight.unit is not None and flight.unit["dead_frame"] == 50


FLY = "import sys, rig; rig.fly(overrides=['duration_s=600', 'faults=[]'], out=sys.argv[1], unit=sys.argv[2])"


def flying(tmp_path: Path, temporary: Path, tested: Unit) -> tuple[subprocess.Popen[bytes], Path, int]:
    """A rig in a process of its own, the folder of its unit, and the guard."""
    path = os.pathsep.join(filter(None, [str(Path(rig.__file__).parents[1]), *sys.path]))
    process = subprocess.Popen(
        [sys.executable, "-c", FLY, str(tmp_path / "logs"), tested.unit_file], env={**os.environ, "PYTHONPATH": path}
    )
    folder = until(lambda: next(iter(temporary.glob("rig-unit-*")), None))
    until(lambda: list((tmp_path / "logs").glob("*.mcap")))
    (guard,) = (pid for pid in _children(process.pid) if b"guard.py" in Path(f"/proc/{pid}/cmdline").read_bytes())
    return process, folder, guard


def _children(parent: int) -> list[int]:
    found = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdecimal()]
    return [pid for pid in found if _parent(pid) == parent]


def _parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_bytes().rsplit(b")", 1)[1].split()[1])
    except OSError:
        return 0


@needs_a_compiler
@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="no /proc")
@pytest.mark.parametrize("killed", ["rig", "guard", "unit"])
def test_whoever_is_killed_the_folder_goes(tmp_path: Path, temporary: Path, killed: str):
    process, folder, guard = flying(tmp_path, temporary, unit(tmp_path, "reads"))
    (own,) = _children(guard)
    os.kill({"rig": process.pid, "guard": guard, "unit": own}[killed], signal.SIGKILL)
    code = process.wait(60)
    assert code == (-signal.SIGKILL if killed == "rig" else 1)
    until(lambda: not os.path.lexists(folder))
    until(lambda: _parent(own) == 0)


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path: Path, temporary: Path, monkeypatch):
    monkeypatch.setattr("rig.unit.processes.secrets.token_hex", lambda _: "x" * 300)
    process = UnitProcess("exec", ["true"], folder=tmp_path)
    assert process.how_it_ended(10.0) == "exited with status 1"
    assert re.fullmatch(r"the folder of the unit, .*x{300}, cannot be made: File name too long", process.last_line())
    assert process.stop() == "exited with status 1"
    process.forget()


def test_a_folder_is_removed_also_where_something_has_the_name_that_it_gets(tmp_path: Path):
    folder, other = tmp_path / "a", tmp_path / "a.removed"
    for path in (folder, other):
        path.mkdir()
        (path / "b").touch()
    remove([os.fsencode(folder)])
    assert list(tmp_path.iterdir()) == []
