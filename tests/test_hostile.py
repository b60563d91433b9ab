"""A hundred hostile inputs of tests/tools/hostile.py, of all kinds; its checks notice what they should."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from hostile_cases.case import Case, Draw
from hostile_cases.cases import KINDS
from hostile_cases.checks import LONGEST_LINE, MEMORY, Outcome, failures
from hostile_cases.leaves import leaves, removed, renamed, replaced
from hostile_cases.values import MARK

TOOL = Path(__file__).parent / "tools" / "hostile.py"
CASE = Case("file", 0, ("info", "x"), "nothing")


@pytest.mark.long
def test_a_hundred_hostile_inputs_are_answered_in_one_line(tmp_path: Path):
    report = tmp_path / "found.json"
    command = [sys.executable, str(TOOL), "--cases", str(9 * len(KINDS)), "--json", str(report)]
    with tempfile.TemporaryDirectory(prefix="rig") as short:  # a socket's path is short
        environment = {**os.environ, "TMPDIR": short}
        out = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=900, check=False)
    assert report.exists(), out.stderr
    found = json.loads(report.read_text())
    assert [case for case in found if case["failed"]] == []
    assert out.returncode == 0, out.stderr
    counts = {kind: sum(case["name"].startswith(f"{kind}/") for case in found) for kind in KINDS}
    assert set(counts.values()) == {9}
    assert {0, 2} <= {case["exit_code"] for case in found}  # some are refused, some are sound after all


@pytest.fixture
def box(tmp_path: Path) -> Path:
    """What a case leaves that was refused in one line."""
    (tmp_path / "work").mkdir()
    (tmp_path / "before.json").write_text("{}")
    (tmp_path / "precious").write_text("precious")
    (tmp_path / "out").write_text("")
    (tmp_path / "err").write_text("error: x: no such file\n")
    return tmp_path


def ended(box: Path, code: int = 2, rss: int = 0, stopped: str = "") -> set[str]:
    return set(failures(CASE, box, Outcome(code, 1.0, rss, stopped)))


def test_a_refusal_in_one_line_that_leaves_nothing_holds(box: Path):
    assert ended(box) == set()


@pytest.mark.parametrize(
    ("said", "category"),
    [
        ("Traceback (most recent call last):\n  File\nKeyError: 5\n", "traceback"),
        ("error: one\nand another\n", "answer"),
        (f"error: {'x' * LONGEST_LINE}\n", "answer"),
        ("", "answer"),
        ("error: \x1b[2J\n", "control"),
        ("error: \x9b2J\n", "control"),
        ("error: a\rb\n", "control"),
    ],
)
def test_an_answer_that_is_not_one_printable_line_is_noticed(box: Path, said: str, category: str):
    (box / "err").write_text(said)
    assert ended(box) == {category}


def test_how_a_process_ended_is_noticed(box: Path):
    assert ended(box, code=-11) == {"other"}
    assert ended(box, code=3) == {"other"}
    assert ended(box, rss=MEMORY + 1) == {"memory"}
    assert ended(box, code=-9, stopped="hang") == {"hang"}
    (box / "err").write_text("")
    assert ended(box, code=1) >= {"other"}


def test_what_a_refused_command_leaves_is_noticed(box: Path):
    (box / "work" / "o.csv.part").touch()
    assert ended(box) == {"files"}
    assert ended(box, code=1) == set()


def test_a_file_outside_that_was_changed_and_code_that_ran_are_noticed(box: Path):
    (box / "precious").write_text("")
    (box / "work" / MARK).touch()
    assert ended(box, code=0) == {"files", "code"}


def test_a_leaf_is_replaced_left_out_or_given_a_neighbour():
    data = {"a": {"b": 1, "c": [{"d": 2}, {"e": 3}], "f": [4, 5]}}
    assert leaves(data) == [
        ("a",),
        ("a", "b"),
        ("a", "c"),
        ("a", "c", 0),
        ("a", "c", 0, "d"),
        ("a", "c", 1),
        ("a", "c", 1, "e"),
        ("a", "f"),
        ("a", "f", 0),
    ]
    assert "b = nan\n" in replaced(data, ("a", "b"), "nan")
    assert "d" not in removed(data, ("a", "c", 0, "d"))
    assert '"[/red]" = 1\n' in renamed(data, ("a", "b"), '"[/red]"')


def test_the_same_seed_and_number_make_the_same_choices_and_every_leaf_has_its_turn():
    things = list(range(30))
    turns = [Draw("file", 5, number).turn(things) for number in range(30)]
    assert sorted(turns) == things != turns
    assert [Draw("file", 5, number).turn(things) for number in range(30)] == turns
    assert Draw("file", 5, 1).rng.random() == Draw("file", 5, 1).rng.random() != Draw("file", 6, 1).rng.random()


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_case_that_hangs_is_ended(tmp_path: Path):
    from hostile_cases.supervise import run

    case = Case("file", 0, (), "sleeps", call=lambda: time.sleep(60) or 0)
    results = list(run([case], tmp_path, limit_s=1.0))
    assert [set(result.failed) for result in results] == [{"hang"}]
