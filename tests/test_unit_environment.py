"""The environment of a unit: what the unit file declares reaches its process, and neither the guard nor the rig."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from unit_files import HERE, build, compiled, needs_a_compiler, udp, unit, written

import rig
from rig.core.errors import BadInput
from rig.unit.environment import kept
from rig.unit.unit_facts import what_it_reads
from rig.unit.unit_file import Unit, read_unit

SHORT = ("duration_s=0.3", "faults=[]")
SET = "runs in the process of the rig; variables need a process that the rig starts for it"


def printed(tested: Unit, out: Path) -> dict[str, str]:
    """What tests/units/reads.c prints, by name."""
    lines = rig.fly(overrides=SHORT, out=out, unit=tested).printed.splitlines()
    return {name: value for name, _, value in (line.partition("=") for line in lines)}


def of_library(folder: Path, **keys: Any) -> Unit:
    return unit(folder, "reads", **keys)


def of_process(folder: Path, **keys: Any) -> Unit:
    return udp(folder, [], "reads", **keys)


TRANSPORTS = (of_library, of_process)


@needs_a_compiler
@pytest.mark.parametrize("of", TRANSPORTS)
def test_a_variable_of_the_file_reaches_the_unit_and_one_of_the_shell_does_not(tmp_path: Path, monkeypatch, of):
    monkeypatch.setenv("SHOWN", "of the shell")
    monkeypatch.setenv("OF_SHELL", "1")
    text = "ä = $HOME, two\nlines"
    assert printed(of(tmp_path), tmp_path)["SHOWN"] == "none"
    found = rig.fly(overrides=SHORT, out=tmp_path, unit=of(tmp_path, environment={"SHOWN": text})).printed
    assert f"SHOWN={text}\nOF_SHELL=none\n" in found
    assert os.environ["SHOWN"] == "of the shell"


@needs_a_compiler
@pytest.mark.parametrize("of", TRANSPORTS)
def test_the_places_in_a_value_are_those_of_this_flight(tmp_path: Path, of):
    found = printed(of(tmp_path, environment={"SHOWN": "${folder}/a:${scratch}"}), tmp_path)
    folder, _, scratch = found["SHOWN"].partition("/a:")
    assert folder == str(tmp_path.resolve()) and found["FOLDER"] == f"{scratch} 0"


@needs_a_compiler
def test_an_fmu_has_its_variables_and_its_folder(tmp_path: Path):
    pytest.importorskip("fmpy")
    rig_here = {"RIG": str(Path(sys.executable).with_name("rig")), "PYTHON": sys.executable}
    made = shutil.copy(build("first_valid.fmu", **rig_here), tmp_path)
    notes = {"LD_PRELOAD": "${folder}/preload.so", "NOTES": "${folder}/notes"}
    compiled([HERE / "preload.c"], tmp_path / "preload.so")
    keys = {"name": "u", "transport": "fmu", "path": str(made), "start_s": 60, "environment": notes}
    rig.fly(overrides=SHORT, out=tmp_path, unit=written(tmp_path, keys))
    assert "fmu_host.py" in (tmp_path / "notes").read_text()


@needs_a_compiler
@pytest.mark.parametrize("of", TRANSPORTS)
def test_a_preloaded_library_runs_in_the_unit_alone(tmp_path: Path, of):
    compiled([HERE / "preload.c"], tmp_path / "preload.so")
    notes = tmp_path / "notes"
    tested = of(tmp_path, environment={"LD_PRELOAD": "${folder}/preload.so", "NOTES": str(notes)})
    assert rig.fly(overrides=SHORT, out=tmp_path, unit=tested).survived
    (line,) = notes.read_text().splitlines()
    assert "guard.py" not in line and ("host.py" in line or "udp.py" in line)
    assert "preload.so" not in Path("/proc/self/maps").read_text()
    assert "preload.so" in what_it_reads(tested.about()), "it is hashed without being named again"


@needs_a_compiler
def test_the_same_file_flies_the_same_whatever_the_shell_has(tmp_path: Path, monkeypatch):
    digests = set()
    for shell in ("segv", "nan vote"):
        monkeypatch.setenv("FAULT", shell)
        digests.add(
            rig.fly(overrides=("duration_s=1", "faults=[]"), out=tmp_path, unit=unit(tmp_path, "faulty")).digest
        )
    assert len(digests) == 1


def test_of_the_shell_a_unit_has_what_finds_programs_and_nothing_that_steers_them(monkeypatch):
    given = {"PATH": "/bin", "LC_ALL": "C", "LM_LICENSE_FILE": "1@a", "TMPDIR": "/tmp", "LD_LIBRARY_PATH": "/lib"}
    for name, value in {**given, "LD_PRELOAD": "", "VOTER": "mean", "PYTHONPATH": "/x", "MYPATH": "/"}.items():
        monkeypatch.setenv(name, value)
    found = kept()
    assert found.items() >= given.items() and not {"LD_PRELOAD", "VOTER", "PYTHONPATH", "MYPATH"} & found.keys()


WRONG = {
    '"" = "x"': "'' is not the name of a variable",
    '"A=B" = "x"': "'A=B' is not the name of a variable",
    '"1A" = "x"': "'1A' is not the name of a variable",
    '"A B" = "x"': "'A B' is not the name of a variable",
    '"A\\u0000" = "x"': "'A\\x00' is not the name of a variable",
    '"é" = "x"': "'é' is not the name of a variable",
    "A = 1": "environment.A: must be a text, got 1",
    'A = ["x"]': "environment.A: must be a text",
    'A = "\\u0000"': "variable A: must not contain the character NUL",
    'A = "${home}"': "variable A: '${home}' must be ${folder}, of the unit file, or ${scratch}",
    'A = "${folder"': "variable A: '${folder' must be ${folder}",
    'RIG_UNIT_FOLDER = "/"': "variable RIG_UNIT_FOLDER: the rig sets those that begin with RIG_UNIT_",
    'RIG_UNIT_LOOKS = "9"': "variable RIG_UNIT_LOOKS: the rig sets those that begin with RIG_UNIT_",
    f'A = "{"x" * 70000}"': "has 70001 characters, at most 65536 are allowed",
    'LD_PRELOAD = "${folder}/none.so"': "environment: LD_PRELOAD: none.so: no such file",
    'LD_PRELOAD = "/none.so libc.so.6"': "environment: LD_PRELOAD: /none.so: no such file",
    'LD_PRELOAD = "./none.so"': "environment: LD_PRELOAD: ./none.so: must begin with / or ${folder}/",
}


@pytest.mark.parametrize("line", WRONG)
def test_a_wrong_variable_is_one_line(tmp_path: Path, line: str):
    (tmp_path / "u.so").touch()
    path = tmp_path / "unit.toml"
    path.write_text(f'name = "u"\npath = "u.so"\n[environment]\n{line}\n')
    with pytest.raises(BadInput) as error:
        read_unit(path)
    assert str(error.value).startswith(f"{path}: ") and WRONG[line] in str(error.value)


WITHOUT_A_PROCESS = {
    'path = "u.so"\nisolate = false': SET,
    'transport = "python"\nmanager = "a:b"': SET,
    'transport = "udp"\naddress = "127.0.0.1:9"': SET.replace("runs in the process of the rig", "runs already"),
}


@pytest.mark.parametrize("lines", WITHOUT_A_PROCESS)
def test_a_unit_without_a_process_of_the_rig_has_no_environment(tmp_path: Path, lines: str):
    (tmp_path / "u.so").touch()
    path = tmp_path / "unit.toml"
    path.write_text(f'name = "u"\n{lines}\n[environment]\nA = "x"\n')
    with pytest.raises(BadInput, match=re.escape(f"environment: the unit {WITHOUT_A_PROCESS[lines]}")):
        read_unit(path)


def test_a_folder_with_a_blank_cannot_be_preloaded_from(tmp_path: Path):
    folder = tmp_path / "a b"
    folder.mkdir()
    for name in ("u.so", "x.so"):
        (folder / name).touch()
    text = 'name = "u"\npath = "u.so"\n[environment]\nLD_PRELOAD = "${folder}/x.so"\n'
    (folder / "unit.toml").write_text(text)
    with pytest.raises(BadInput, match=r"LD_PRELOAD: .*a b contains a blank or a colon"):
        read_unit(folder / "unit.toml")
