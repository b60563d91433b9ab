"""The console takes what it prints as text: no markup, no control characters, in lines, cells and error lines."""

import json
import re
import sys
from pathlib import Path

import pytest
from rich.color import ColorSystem
from rich.table import Table

import rig
from rig.cli import main as cli
from rig.core.console import Screen, console, styled

MARKUP = "[/red][bold]x[/bold] :smile:"
ACTS = "\x1b]0;PWNED\x07\x1b[2J\u202e"


@pytest.fixture
def terminal() -> Screen:
    screen = Screen(width=200)
    screen._force_terminal, screen._color_system = True, ColorSystem.STANDARD
    return screen


def printed(screen: Screen, *what: object) -> str:
    with screen.capture() as captured:
        screen.print(*what)
    return captured.get()


def test_markup_is_text_in_lines_headers_and_cells(terminal: Screen):
    assert printed(terminal, MARKUP) == f"{MARKUP}\n"
    table = Table(MARKUP, box=None)
    table.add_row(MARKUP)
    assert printed(terminal, table).count(MARKUP) == 2


def test_control_characters_are_shown_not_sent(terminal: Screen):
    table = Table(ACTS, box=None)
    table.add_row(ACTS)
    for out in (
        printed(terminal, f"title {ACTS}"),
        printed(terminal, table),
        printed(terminal, styled(ACTS, (ACTS, ""))),
    ):
        assert "PWNED" in out and "\\u001b]0;" in out and "\\u202e" in out
        assert not set(re.sub(r"\x1b\[[01]m", "", out)) & set("\x1b\x07\u202e")  # but for our own bold


def test_a_style_is_asked_for_by_name_and_not_by_the_text(terminal: Screen):
    assert printed(terminal, styled("a ", ("[red]", "bold"), " b")) == "a \x1b[1m[red]\x1b[0m b\n"


def test_a_pipe_is_as_wide_as_columns_says(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert console().width == 120 or console().is_terminal
    monkeypatch.setenv("COLUMNS", "77")
    assert console().width == 77


def command(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["rig", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out + said.err


def test_a_title_and_a_folder_are_text_in_every_command_that_shows_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    title = json.dumps(MARKUP + ACTS)
    (tmp_path / "s.toml").write_text(f"title = {title}\nduration_s = 0.1\n")
    fault = 'faults=[{id="[/f]",kind="offset",signal="heading",channels=[1],offset=0.0,start_s=0.0}]'
    fly = ["fly", "s.toml", "--out", "d[/x]", "--set", fault]
    outputs = [command(fly, monkeypatch, capsys)]
    log = str(next(tmp_path.rglob("*.mcap")).relative_to(tmp_path))
    for arguments in (
        ["info", log],
        ["score", log, "--no-baseline"],
        ["scenario", "show", "s.toml"],
        ["scenario", "check", "s.toml"],
        ["watch", log],
        ["diff", log, log],
        ["report", log],
        ["replay", log],
        ["export", log, "--to", "csv"],
    ):
        outputs.append(command(arguments, monkeypatch, capsys))
    assert [code for code, _ in outputs] == [0] * len(outputs)
    for _, out in outputs:
        assert not {c for c in out if c != "\n" and not c.isprintable()}
    for k in (0, 1, 2, 3):
        assert MARKUP in outputs[k][1] and "\\u001b]0;PWNED" in outputs[k][1]
    assert "d[/x]" in outputs[0][1]
    assert rig.read_log(log).metadata["aircraft"] == "f16"


def test_a_column_with_markup_in_its_name_is_voted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{k / 100},{k},{k}" for k in range(20))
    (tmp_path / "in.csv").write_text(f"time_s,[/red].1,[/red].2\n{rows}\n")
    (tmp_path / "c.toml").write_text("[default]\nthreshold = 1.0\n")
    code, out = command(["vote", "in.csv", "--config", "c.toml", "--out", "o[bold].csv"], monkeypatch, capsys)
    assert code == 0 and "[/red].1" in out and "o[bold].csv" in out


def test_campaign_titles_are_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """What ``rig campaign status`` and ``report`` print of a title, without flying a campaign."""
    from rig.cli import show_campaign as show

    found = {
        "title": MARKUP + ACTS,
        "folder": "x",
        "outcomes": {"flown": 1},
        "done": 1,
        "runs": 1,
        "aircraft_lost": 0,
        "logs": 0,
        "table_sha256": "0",
        "identity": "0",
    }
    show.status(found)
    rate = {"value": None, "of": 0}
    head = dict.fromkeys(("detection", "correct_isolation", "wrong_isolation", "survival", "false_alarms"), rate)
    counts = dict.fromkeys(("faults", "not_executed", "undetectable"), 0)
    empty = {"tie_break": [], "servos": [], "requirements": []}
    show.report(
        {"title": MARKUP + ACTS, "headline": {"done": 1, **counts, **head}, "runs": 1, **empty}, tmp_path / "[/x]"
    )
    out = capsys.readouterr().out
    assert out.count(MARKUP) == 2 and "[/x]" in out and "\x1b" not in out
