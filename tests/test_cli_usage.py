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
        (["fly", "--seed", "a\nb\x1b[2J\x9b"], "'--seed'"),
        (["watch", "x", "--speed", "9" * 3000], "'--speed'"),
        (["nosuch"], "nosuch"),
        (["vote"], "INPUT"),
        (["fly", "--nonsense"], "--nonsense"),
    ],
)
def test_a_wrong_command_line_is_one_printable_line(arguments, said, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["rig", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    answer = capsys.readouterr().err
    assert ended.value.code == 2
    assert said in answer
    assert answer.startswith("error: ") and answer.endswith("--help\n")
    assert answer[:-1].isprintable() and len(answer) < 600


def test_a_missing_argument_is_named_in_one_sentence(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["rig", "aircraft", "new"])
    with pytest.raises(SystemExit):
        cli.main()
    assert capsys.readouterr().err == "error: Missing argument 'NAME'; see: rig aircraft new --help\n"


@pytest.mark.parametrize(
    "arguments", [["-v", "aircraft", "list"], ["aircraft", "list", "-v"], ["aircraft", "-v", "list"]]
)
def test_verbose_may_stand_before_or_after_the_command(arguments, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["rig", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert not ended.value.code and "f16" in capsys.readouterr().out


def commands(group, path=()) -> list[tuple[str, ...]]:
    """Every command of ours."""
    inside = getattr(group, "commands", None)
    return [path] if inside is None else [one for name, part in inside.items() for one in commands(part, (*path, name))]


ALL = commands(get_command(cli.app))


@pytest.mark.parametrize("command", ALL, ids=" ".join)
def test_help_has_no_types_of_python_and_names_every_value(command, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "argv", ["rig", *command, "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    said = capsys.readouterr().out
    assert re.search(r"<(str|bool|int|float|path|list)|\b(TEXT|INTEGER|FLOAT|PATH)\b", said) is None
    assert ("--allow-code" in said and "--set names" in said) == ("--allow-code" in said and "KEY=VALUE" in said)
    group: Any = get_command(cli.app)
    for name in command:
        group = group.commands[name]
    unnamed = [p.opts for p in group.params if p.param_type_name == "option" and not p.is_flag and p.metavar is None]
    assert unnamed == []


def test_a_group_without_a_command_shows_its_help(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["rig", "campaign"])
    with pytest.raises(SystemExit):
        cli.main()
    said = capsys.readouterr()
    assert "Usage: rig campaign" in said.out + said.err and "compare" in said.out + said.err


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


def test_jsbsim_without_its_files_is_one_line_that_says_so(monkeypatch, capsys):
    def nowhere(_: Any) -> Any:
        raise OSError("Can't find the default root directory")

    monkeypatch.setattr(jsbsim, "FGFDMExec", nowhere)
    monkeypatch.setattr(sys, "argv", ["rig", "bench"])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    said = "JSBSim: Can't find the default root directory: its package is not installed as a whole"
    assert ended.value.code == 1 and capsys.readouterr().err.splitlines()[-1] == f"failed: {said}"
