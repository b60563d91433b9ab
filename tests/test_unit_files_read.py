"""The files that a unit reads: hashed with its unit file, and the same for a whole command."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

import pytest
from unit_files import needs_a_compiler, unit, written

import rig
from rig.core.errors import BadInput, RigError
from rig.unit.unit_facts import differences, what_it_reads
from rig.unit.unit_file import Unit, read_unit

SHORT = ("duration_s=0.3", "faults=[]")


def with_gains(folder: Path, **keys: Any) -> Unit:
    (folder / "gains.txt").write_text("1")
    return unit(folder, "reads", files=["gains.txt"], **keys)


def of_nothing(folder: Path, **keys: Any) -> Unit:
    """Without a library that works: for what is refused before it starts."""
    (folder / "u.so").write_bytes(b"abc")
    return written(folder, {"name": "u", "path": "u.so", **keys})


def test_each_file_is_hashed_by_its_name(tmp_path: Path):
    (tmp_path / "below").mkdir()
    (tmp_path / "below/g.txt").write_bytes(b"gains")
    tested = of_nothing(tmp_path, files=["below/g.txt", "below/../below/g.txt"], environment={"A": "x ${folder}"})
    digest = hashlib.sha256(b"gains").hexdigest()
    own = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # FIPS 180-2, B.1
    about = tested.about()
    assert about["read_sha256"] == {"u.so": own, "below/g.txt": digest, "below/../below/g.txt": digest}
    assert about["environment"] == {"A": "x ${folder}"} and about["sha256"] == own
    assert (
        what_it_reads(of_nothing(tmp_path, environment={"A": "x"}).about()) == f"files u.so {own[:12]}; environment A=x"
    )


def test_the_build_changes_with_every_thing_that_a_unit_reads_and_with_nothing_else(tmp_path: Path):
    builds = []
    for text, environment in (("1", {}), ("2", {}), ("1", {"A": "x"}), ("1", {"A": "y"}), ("1", {"B": "x"})):
        (tmp_path / "g").write_text(text)
        builds.append(of_nothing(tmp_path, files=["g"], environment=environment).build())
    assert len(set(builds)) == 5
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    (moved / "g").write_text("1")
    assert of_nothing(moved, files=["g"], environment={"B": "x"}, timeout_s=1).build() == builds[-1]
    assert of_nothing(moved).build() == of_nothing(moved).sha256()


WRONG = {
    "none.txt": "files: none.txt: no such file",
    "folder": "files: folder: is a folder, not a file",
    "pipe": "files: pipe: is a pipe, not a file",
    "": "files: '' is not the name of a file",
    "/etc/passwd": "files: /etc/passwd: must be relative to the folder of the unit file",
    "a\0b": "files: 'a\\x00b' is not the name of a file",
    "x" * 300: "cannot be read: File name too long",
}


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_cannot_be_read_is_one_line(tmp_path: Path, name: str):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(BadInput) as error:
        of_nothing(tmp_path, files=[name])
    assert str(error.value).startswith(f"{tmp_path}/unit.toml: ") and WRONG[name] in str(error.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_without_permission_is_one_line(tmp_path: Path):
    (tmp_path / "g").touch(0o000)
    with pytest.raises(BadInput, match="files: g: cannot be read: Permission denied"):
        of_nothing(tmp_path, files=["g"])


def test_a_class_has_no_files(tmp_path: Path):
    keys = {"name": "u", "transport": "python", "manager": "a:b", "files": ["unit.toml"]}
    with pytest.raises(BadInput, match="files: not with the transport python"):
        written(tmp_path, keys)


def test_the_firmware_of_a_box_may_be_named(tmp_path: Path):
    (tmp_path / "image").write_text("1")
    box = written(tmp_path, {"name": "b", "transport": "udp", "address": "127.0.0.1:9", "files": ["image"]})
    assert list(box.hashes()) == ["image"] and box.build() != ""


@needs_a_compiler
def test_a_file_that_changes_before_the_start_is_refused_and_nothing_written(tmp_path: Path):
    tested = with_gains(tmp_path)
    (tmp_path / "gains.txt").write_text("2")
    with pytest.raises(BadInput, match=r"gains\.txt: is not the file that it was when the unit file was read"):
        rig.fly(overrides=SHORT, out=tmp_path / "logs", unit=tested)
    (tmp_path / "gains.txt").unlink()
    with pytest.raises(BadInput, match=r"files: gains\.txt: no such file"):
        rig.fly(overrides=SHORT, out=tmp_path / "logs", unit=tested)
    assert not (tmp_path / "logs").exists()
    assert rig.fly(overrides=SHORT, out=tmp_path / "logs", unit=with_gains(tmp_path)).survived


@needs_a_compiler
def test_a_unit_is_not_started_again_with_another_file(tmp_path: Path):
    (tmp_path / "gains.txt").write_text("1")

    def changed(rows: Any, *_: object) -> None:
        if int(rows["frame"][0]) == 0:
            (tmp_path / "gains.txt").write_text("2")

    late = {"FAULT": "segv", "FAULT_FRAME": "250"}
    tested = unit(tmp_path, "faulty", on_dead="restart", files=["gains.txt"], environment=late)
    with pytest.raises(RigError, match=r"after a restart: .*gains\.txt: is not the file"):
        rig.fly(overrides=("duration_s=3", "faults=[]"), out=tmp_path, unit=tested, watch=changed)


@needs_a_compiler
def test_a_log_keeps_what_the_unit_read(tmp_path: Path, rig_command):
    tested = with_gains(tmp_path, environment={"SHOWN": "a b"})
    log = rig.fly(overrides=SHORT, out=tmp_path, unit=tested).log
    code, out, _ = rig_command("info", log)
    gains = hashlib.sha256(b"1").hexdigest()
    assert code == 0 and f"gains.txt {gains[:12]}" in out and "environment SHOWN=a b" in out
    assert rig_command("report", log)[0] == 0
    page = log.with_suffix(".html").read_text()
    assert f"gains.txt {gains[:12]}" in page and "environment SHOWN=a b" in page


@needs_a_compiler
def test_a_replay_by_another_file_or_environment_names_it_and_goes_on(tmp_path: Path, rig_command):
    tested = with_gains(tmp_path, environment={"SHOWN": "a"})
    log = rig.fly(overrides=SHORT, out=tmp_path, unit=tested).log
    code, out, _ = rig_command("replay", log, "--unit", tmp_path / "unit.toml")
    assert code == 0 and "not as in the flight" not in out
    other = with_gains(tmp_path, environment={"SHOWN": "b"})
    (tmp_path / "gains.txt").write_text("2")
    code, out, _ = rig_command("replay", log, "--unit", other.unit_file)
    assert code == 0 and "identical" in out, "the votes of this unit do not depend on them"
    assert 'unit: reads is not as in the flight: environment.SHOWN was "a", is "b"' in out
    assert "unit: reads is not as in the flight: read_sha256.gains.txt was" in out


def test_a_unit_of_an_earlier_version_is_compared_by_its_build(tmp_path: Path):
    now = of_nothing(tmp_path, environment={}).about()
    then = {"name": "u", "sha256": now["sha256"]}
    assert differences(then, now) == []
    assert differences({**then, "sha256": "0"}, now) == [f'sha256 was "0", is "{now["sha256"]}"']


def test_another_reading_of_the_same_unit_file_takes_the_files_as_they_are(tmp_path: Path):
    (tmp_path / "g").write_text("1")
    first = of_nothing(tmp_path, files=["g"])
    (tmp_path / "g").write_text("2")
    second = read_unit(first.unit_file)
    assert first.build() != second.build()
    second.require_unchanged()
    with pytest.raises(BadInput, match=": g: is not the file"):
        first.require_unchanged()


@needs_a_compiler
def test_a_score_whose_baseline_another_unit_flies_tells_it(tmp_path: Path, rig_command):
    log = rig.fly(overrides=("duration_s=0.5",), out=tmp_path, unit=with_gains(tmp_path)).log
    unit_file = with_gains(tmp_path, environment={"A": "x"}).unit_file
    code, _, err = rig_command("score", log, "--unit", unit_file)
    said = f'{log}: the unit that flies the baseline is not as in the flight: environment.A was not there, is "x"'
    assert code == 0 and err.count(f"note: {said}\n") == 1
