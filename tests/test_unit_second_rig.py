"""The conformance test of a box at an address: a second rig while a session is open, after its end, after silence."""

from __future__ import annotations

import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from unit_files import COMPILER, SOURCES, needs_a_compiler, unit, written

from rig.bench import unit_second_rig
from rig.bench.unit_check import check, load
from rig.unit.running_unit import running

pytestmark = needs_a_compiler
BUSY = "it refuses another rig as busy, without any change"
END = "the end of a session frees it for another rig"
SILENCE = "a silence of 3 s frees it for another rig"
QUICK = ("#define SILENCE_S 3", "#define SILENCE_S 1")
TAKES_ANY = ("if (session != 0 && !same(from, &rig)", "if (session != 0 && same(from, &rig)")
KEEPS = ("#define SILENCE_S 3", "#define SILENCE_S 1000")
SAYS_NO_MORE = ('"busy with session %"', '"go away, session %"')


@contextmanager
def box(folder: Path, *changes: tuple[str, str]) -> Iterator[str]:
    """Run the example's UDP main, of which some lines are others, at an address."""
    text = (SOURCES / "udp_main.c").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "box.c").write_text(text)
    sources = [str(folder / "box.c"), str(SOURCES / "first_valid.c")]
    command = [str(COMPILER), "-std=gnu99", "-w", f"-I{SOURCES}", "-o", str(folder / "box"), *sources, "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    process = subprocess.Popen([str(folder / "box"), "--listen", address])
    try:
        yield address
    finally:
        process.kill()
        process.wait()


BOXES = {
    "a box as it should be": ((QUICK,), {}),
    "a box that takes any rig": (
        (QUICK, TAKES_ANY),
        {BUSY: "HELLO of another rig was answered READY, must be REFUSED"},
    ),
    "a box that gives no reason": ((QUICK, SAYS_NO_MORE), {BUSY: "must begin with 'busy with session'"}),
    "a box that keeps its session": (
        (KEEPS, ("begin_session(0);\n    }\n}", "}\n}")),
        {END: "it refuses: 'busy with session ", SILENCE: "it refuses: 'busy with session "},
    ),
}


@pytest.mark.parametrize("name", BOXES)
def test_what_a_second_rig_finds_wrong(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str):
    changes, wrong = BOXES[name]
    monkeypatch.setattr(unit_second_rig, "SILENCE_S", 1.0)
    case = load()[0]
    with box(tmp_path, *changes) as address:
        tested = written(tmp_path, {"name": "box", "transport": "udp", "address": address, "start_s": 1.5})
        with running(tested) as unit_there:
            found = dict(unit_second_rig.check(unit_there, case.config, case.inputs))
    assert list(found) == [BUSY, END, SILENCE]
    assert all(wrong.get(name, "") in said and bool(said) == (name in wrong) for name, said in found.items()), found


@pytest.mark.long
def test_the_conformance_test_has_these_lines_for_a_box_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(unit_second_rig, "SILENCE_S", 1.0)
    with box(tmp_path, QUICK) as address:
        written(tmp_path, {"name": "box", "transport": "udp", "address": address})
        found = check(tmp_path / "unit.toml", interface_only=True)
    assert found.passed and {BUSY, END, SILENCE} <= {one.name for one in found.requirements}
    with running(unit(tmp_path, "first_valid")) as library:
        assert list(unit_second_rig.check(library, load()[0].config, load()[0].inputs)) == []
