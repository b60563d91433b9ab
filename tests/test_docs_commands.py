"""Every command of README and the tutorials works as written, in order, in a copy of what a clone has.

What a tutorial shows as printed is printed, line by line. Commands that are too long or wait for
a person are only parsed, with their reason in PARSED.
"""

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from rig.cli import main as cli

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
TUTORIALS = (
    "first-flight",
    "own-scenario",
    "computers",
    "own-voter",
    "own-unit",
    "own-aircraft",
    "recorded-data",
    "campaign",
    "own-benchmark",
)
PAGES = [README, *(ROOT / "docs" / "tutorials" / f"{name}.md" for name in (*TUTORIALS, "reliability", "safety-case"))]
# How a command begins: why it is only parsed here, by its --help.
PARSED = {
    "rig aircraft new": "minutes of design, tests/test_design_own_aircraft.py",
    "rig aircraft check": "needs what `rig aircraft new` made, or linearises for 20 s; tests/test_design_margins.py",
    "rig fly my_c172/": "needs what `rig aircraft new` made",
    "rig campaign run reliability": "6633 flights, tests/test_reliability_run.py",
    "rig campaign run fmea": "1344 flights, tests/test_safety_fmea.py",
    "rig reliability cutsets": "6540 flights, tests/test_safety_cutsets.py",
    "rig reliability confirm": "needs what `cutsets` flew, tests/test_safety_cutsets.py",
    "rig reliability tree": "needs flown campaigns, tests/test_safety_tree.py",
    "rig reliability fmea": "needs the campaign `fmea`, tests/test_safety_fmea.py",
    "rig reliability report": "needs all of these, tests/test_safety_fmea.py",
    "rig reliability run": "needs the campaign `reliability`, tests/test_reliability_run.py",
    "rig reliability trials": "needs hours, tests/test_reliability_trials.py",
    "rig search worst-pitch-rate": "300 flights, tests/test_cli_search.py",
    "rig view": "a window or a picture, tests/test_view_*.py",
}
LONG = {"own-benchmark"}  # a benchmark
OTHERS = {  # not commands of ours
    "make fly": "`rig fly`, after setup",
    "make test": "this",
    "cp": "copied by the test",
    "make -C docs/examples/unit": "run by the test",
}


@dataclass(frozen=True)
class Shown:
    """A command of a page and the lines that the page shows of its output."""

    command: str
    printed: tuple[str, ...] = ()


def commands(text: str) -> list[Shown]:
    """The commands of the blocks ``console`` (after ``$``, with output) and ``sh`` (one a line)."""
    found: list[Shown] = []
    for kind, block in re.findall(r"^```(console|sh)\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        for line in block.splitlines():
            if kind == "sh" or line.startswith("$ "):
                found.append(Shown(re.split(r"(?:^|\s)# ", line.removeprefix("$ "))[0].strip()))
            else:
                found[-1] = Shown(found[-1].command, (*found[-1].printed, line))
    return [one for one in found if one.command]


def begins(command: str, table: dict[str, str] | dict[str, list[str]]) -> str | None:
    """The entry of ``table`` that ``command`` begins with."""
    return next((key for key in table if f"{command} ".startswith(key)), None)


def tidy(text: str) -> str:
    return " ".join(text.split())


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What the commands of a page find in a clone, and nothing else."""
    shutil.copytree(ROOT / "docs" / "examples", tmp_path / "docs" / "examples", ignore=shutil.ignore_patterns("build"))
    shutil.copytree(ROOT / "faults", tmp_path / "faults")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    return tmp_path


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[[str], str]:
    """run(command) -> all that it prints; its exit code must be 0."""

    def rig(words: list[str]) -> str:
        monkeypatch.setattr(sys, "argv", ["rig", *words])
        with pytest.raises(SystemExit) as end:
            cli.main()
        said = capsys.readouterr()
        assert not end.value.code, f"rig {' '.join(words)}: {said.out}{said.err}"
        return said.out + said.err

    def any_command(command: str) -> str:
        words, _, into = command.partition(" > ")
        first, *rest = shlex.split(words)
        if first != "rig":
            assert begins(command, OTHERS), command
            if first == "cp" or "-C" in rest:
                subprocess.run([first, *rest], check=True, capture_output=True)
            return ""
        if key := begins(command, PARSED):
            named = [word for word in key.split()[1:] if "/" not in word and not word.startswith("-")]
            helped = rig([*named[:2], "--help"] if named[0] in GROUPS else [named[0], "--help"])
            assert all(option in helped for option in re.findall(r"(?<= )--[a-z-]+", command)), command
            return ""
        printed = rig(rest)
        if into:
            Path(into).write_text(printed)
        return printed

    return any_command


GROUPS = {"aircraft", "campaign", "reliability", "scenario", "unit", "faults"}


@pytest.mark.parametrize(
    "page",
    [pytest.param(page, id=page.stem, marks=[pytest.mark.long] if page.stem in LONG else []) for page in PAGES],
)
@pytest.mark.usefixtures("clone")
def test_every_command_works_as_written(page: Path, run: Callable[[str], str]):
    if "make -C" in page.read_text() and not (shutil.which("make") and shutil.which("cc")):
        pytest.skip("no C compiler")
    shown = commands(page.read_text())
    assert len(shown) > 2
    for one in shown:
        printed = {tidy(line) for line in run(one.command).splitlines()}
        if not begins(one.command, PARSED):
            assert [line for line in one.printed if tidy(line) not in printed] == [], one.command


def test_all_tutorials_are_among_the_pages():
    assert {path.name for path in (ROOT / "docs" / "tutorials").glob("*.md")} == {page.name for page in PAGES[1:]}


def test_every_exception_is_of_a_command_that_a_page_shows():
    shown = [one.command for page in PAGES for one in commands(page.read_text())]
    for table in (PARSED, OTHERS):
        assert [key for key in table if not any(begins(command, {key: ""}) for command in shown)] == []


def test_commands_and_their_output_are_read_from_a_page():
    page = "```console\n$ rig fly # a flight\n  20.00 s\n```\n```toml\n$ no\n```\n```sh\nmake fly\n```\n"
    assert commands(page) == [Shown("rig fly", ("  20.00 s",)), Shown("make fly")]


def test_the_recording_is_what_its_script_writes():
    import example_channels

    assert example_channels.recorded().write_csv() == example_channels.FILE.read_text()
    assert example_channels.FILE.stat().st_size < 100_000
