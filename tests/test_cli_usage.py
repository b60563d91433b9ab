"""A command line that is wrong: one line, as for any other bad input."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import jsbsim
import pytest
from typer.main import get_command

from rig.cli import main as cli


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fly", "--seed", "a\nb\x1b[2J\x9b"], "--seed"),
        (["watch", "x", "--speed", "9" * 3000], "--speed"),
        (["nosuch"], "nosuch"),
        (["vote"], "INPUT"),
        (["fly", "--nonsense"], "--nonsense"),
    ],
)
def test_a_wrong_command_line_is_one_printable_line(rig_command, arguments, said):
    code, _, answer = rig_command(*arguments)
    assert code == 2
    assert said in answer
    assert answer.startswith("error: ") and answer.endswith("--help\n")
    assert answer[:-1].isprintable() and len(answer) < 600


def test_a_missing_argument_is_named_in_one_sentence(rig_command):
    assert rig_command("aircraft", "new")[2] == "error: NAME: missing argument; see: rig aircraft new --help\n"


@pytest.mark.parametrize(
    "arguments", [["-v", "aircraft", "list"], ["aircraft", "list", "-v"], ["aircraft", "-v", "list"]]
)
def test_verbose_may_stand_before_or_after_the_command(rig_command, arguments):
    code, out, _ = rig_command(*arguments)
    assert code == 0 and "f16" in out


def commands(group, path=()) -> list[tuple[str, ...]]:
    """Every command of ours."""
    inside = getattr(group, "commands", None)
    return [path] if inside is None else [one for name, part in inside.items() for one in commands(part, (*path, name))]


def test_help_has_no_types_of_python_and_names_every_value(rig_command, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    for command in commands(get_command(cli.app)):
        said = rig_command(*command, "--help")[1]
        assert re.search(r"<(str|bool|int|float|path|list)|\b(TEXT|INTEGER|FLOAT|PATH)\b", said) is None, command
        assert ("--allow-code" in said and "--set names" in said) == ("--allow-code" in said and "KEY=VALUE" in said)
        group: Any = get_command(cli.app)
        for name in command:
            group = group.commands[name]
        options = [param for param in group.params if param.param_type_name == "option" and not param.is_flag]
        assert [param.opts for param in options if param.metavar is None] == [], command


def test_a_group_without_a_command_shows_its_help(rig_command):
    said = "".join(rig_command("campaign")[1:])
    assert "Usage: rig campaign" in said and "compare" in said


def test_without_a_standard_output_a_command_does_its_work():
    command = 'exec "$0" -m rig signals >&-'
    ran = subprocess.run(["sh", "-c", command, sys.executable], stderr=subprocess.PIPE, text=True, check=False)
    assert (ran.returncode, ran.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="the system has no device that is always full")
@pytest.mark.parametrize("arguments", [["signals"], ["signals", "--json"], ["faults", "list"], ["--help"]])
def test_a_full_standard_output_is_one_line_and_exit_code_1(arguments):
    with Path("/dev/full").open("w") as full:
        ran = subprocess.run(
            [sys.executable, "-m", "rig", *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert (ran.returncode, ran.stderr) == (1, "failed: standard output: cannot be written: No space left on device\n")


def test_jsbsim_without_its_files_is_one_line_that_says_so(rig_command, monkeypatch):
    def nowhere(_: Any) -> Any:
        raise OSError("Can't find the default root directory")

    monkeypatch.setattr(jsbsim, "FGFDMExec", nowhere)
    code, _, err = rig_command("cost")
    said = "JSBSim: Can't find the default root directory: its package is not installed as a whole"
    assert code == 1 and err.splitlines()[-1] == f"failed: {said}"
