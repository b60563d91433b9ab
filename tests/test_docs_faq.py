"""The errors of docs/explanation/faq.md are those of the program."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import rig

DOCS = Path(__file__).parent.parent / "docs"
PAGE = DOCS / "explanation" / "faq.md"
EXAMPLES = DOCS / "examples"
Run = Callable[..., tuple[int, str, str]]
COMMANDS = {  # a word of the error: the command that prints it
    "hardove:": "fly f16_pitch_rate_hardove",
    "manger": "fly --set redundancy.manger=mean",
    "--allow-code": "fly own.toml",
    "--config": f"vote {EXAMPLES}/channels.csv --out out.csv",
    "one channel": f"vote one.csv --config {EXAMPLES}/vote.toml --out out.csv",
    "truncated": "score cut.mcap",
    "libfirst_valid": "fly --unit first_valid.toml",
    "another campaign": f"campaign run {EXAMPLES}/campaign.toml --out C --runs 1 --set duration_s=7",
    "--signal": "reliability plan --target 1e-9 --rates rates/zhang2023.toml",
    "no display": "fly --rerun spawn",
}


def errors() -> list[str]:
    return re.findall(r"^\| `([^`]+)` \|", PAGE.read_text().partition("## Ten errors")[2], re.MULTILINE)


@pytest.fixture
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own.toml").write_text('aircraft = "f16"\nduration_s = 5.0\n[redundancy]\nmanager = "mine:Voter"\n')
    rows = (EXAMPLES / "channels.csv").read_text().splitlines()[:20]
    (tmp_path / "one.csv").write_text("\n".join(",".join(row.split(",")[:2]) for row in rows))
    (tmp_path / "first_valid.toml").write_text((EXAMPLES / "unit" / "first_valid.toml").read_text())
    rates = DOCS.parent / "faults" / "rates" / "zhang2023.toml"
    (tmp_path / "rates").mkdir()
    (tmp_path / "rates" / rates.name).write_text(rates.read_text())
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


def test_twelve_questions_are_answered():
    questions = re.findall(r"^\*\*[^*]+\?\*\*", PAGE.read_text().partition("## Ten errors")[0], re.MULTILINE)
    assert len(questions) == len(set(questions)) == 12


def test_ten_errors_are_explained():
    assert len(errors()) == len(COMMANDS) == 10
    assert all(any(word in error for error in errors()) for word in COMMANDS)


@pytest.mark.usefixtures("inputs")
@pytest.mark.parametrize(
    "word", [pytest.param(word, marks=[pytest.mark.long] if word == "another campaign" else []) for word in COMMANDS]
)
def test_an_error_of_the_page_is_printed_as_it_stands_there(word: str, rig_command: Run, tmp_path: Path):
    if word == "truncated":
        log = rig.fly(overrides=["duration_s=5"], out=tmp_path / "logs").log
        (tmp_path / "cut.mcap").write_bytes(log.read_bytes()[:200_000])
    if word == "another campaign":
        assert rig_command("campaign", "run", f"{EXAMPLES}/campaign.toml", "--out", "C", "--runs", "1")[0] == 0
    code, _, said = rig_command(*COMMANDS[word].split())
    (error,) = (error for error in errors() if word in error)
    assert code == 2 and error in said
