"""A command line that is wrong: one line, as for any other bad input."""

import sys

import pytest

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


def test_a_group_without_a_command_shows_its_help(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["rig", "campaign"])
    with pytest.raises(SystemExit):
        cli.main()
    said = capsys.readouterr()
    assert "Usage: rig campaign" in said.out + said.err and "compare" in said.out + said.err
