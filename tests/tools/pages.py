"""Run the code of the pages and put what it prints, and the pictures that it draws, into them.

python tests/tools/pages.py [PAGE ...]    # rewrite the outputs of these pages; without PAGE: of all (make pages)
    --check   compare and change nothing; exit code 1 if a page differs
    --fill    add the output of commands that show none
    --fast    leave out the pages that take long, LONG below

The code of a page runs in page order in one temporary folder, which holds copies of docs/examples and faults:

- ``console``: commands after ``$``, each with what it prints below it. A line ``...`` stands for lines that are left
  out; a rewrite keeps it. A command without output below it is run and not compared. ``; echo $?`` shows an exit code.
- ``sh``: commands, one a line. A command must end with 0, and continues on the next line after a backslash.
- ``python``: runs in one namespace of the page. Its output may follow in a block ``text``.
- any language with ``title="FILE"``: is written to that file.
- ``toml``: must be TOML.
- A comment ``<!-- python`` or ``<!-- sh`` ... ``-->`` runs and is not shown.

A picture ``![words](../pictures/NAME.svg)`` is made by code of the page that writes ``NAME.svg`` into its folder, for
example ``figure.savefig("NAME.svg")``. Its title is the alternative text up to the first colon.
Commands that cannot run in a test are in EXCEPTIONS: their options must exist.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, Final
from unittest import mock

import outside
import page_pictures
from page_outputs import matches, normal, rewritten

ROOT: Final = Path(__file__).parents[2]
# How a command begins, or the page, a colon and how a command of it begins: why it is not run. Its options must exist.
EXCEPTIONS: Final = {
    "make fly": "`rig fly`, after the setup",
    "make test": "the test suite itself",
    "OPTIONS=": "builds the firmware, tests/tools/outside.py",
    "PYTHONPATH=AeroBenchVVPython/code rig search": "needs code of others, tests/test_search_plant_examples.py",
    "rig aircraft check": "needs what `rig aircraft new` made, or linearises for 20 s; tests/test_design_margins.py",
    "rig aircraft new": "minutes of design, tests/test_design_own_aircraft.py",
    "rig campaign run fmea": "1344 flights, tests/test_safety_fmea.py",
    "rig campaign run reliability": "6633 flights, tests/test_reliability_run.py",
    "rig campaign compare MANAGER": "needs the campaigns of `stock-autopilot`",
    "rig campaign run stock-autopilot": "100 flights; three of it: tests/test_stock_autopilot.py",
    "rig fly WORST/": "needs what `rig search` wrote",
    "rig fly my_c172/": "needs what `rig aircraft new` made",
    "rig reliability confirm": "needs what `cutsets` flew, tests/test_safety_cutsets.py",
    "rig reliability fmea": "needs the campaign `fmea`, tests/test_safety_fmea.py",
    "rig reliability report": "needs hours of flights, tests/test_safety_fmea.py",
    "rig reliability run": "needs the campaign `reliability`, tests/test_reliability_run.py",
    "rig reliability tree R": "needs flown campaigns, tests/test_safety_tree.py",
    "docs/how-to/probability-per-flight-hour.md: rig reliability cutsets": "6540 flights, tests/test_safety_cutsets.py",
    "docs/how-to/probability-per-flight-hour.md: rig reliability tree": "needs the cut sets",
    "rig reliability trials": "needs hours, tests/test_reliability_trials.py",
    "rig search worst-pitch-rate": "300 flights, tests/test_cli_search.py",
    "rig view": "a window or a picture, tests/test_view_*.py",
}
# Pages with files of others, and the folder that has them.
DATA: Final = {"docs/how-to/which-sensor-was-wrong.md": ROOT / "../shared/data/px4_logs"}
# Pages whose code is not run, and why.
NOT_RUN: Final[dict[str, str]] = {
    **({} if outside.betaflight() else {"docs/how-to/stock-autopilots.md": "needs the firmware: make test-all"}),
    **{page: "needs logs that are not here" for page, folder in DATA.items() if not folder.is_dir()},
}
# Pages that take more than 2 s of processor time, and why: their tests are marked long. README.md never is.
LONG: Final = {
    "docs/tutorials/first-campaign.md": "two campaigns",
    "docs/tutorials/first-flight.md": "flights, a report and logs replayed",
    "docs/tutorials/own-voter.md": "compiles managers",
    "docs/tutorials/safety-case.md": "1308 flights",
    "docs/how-to/compare-managers.md": "a benchmark, four minutes",
    "docs/how-to/campaigns-and-worst-case.md": "campaigns",
    "docs/how-to/computers-and-servos.md": "flights of several computers",
    "docs/how-to/fly-your-software.md": "compiles units and tests their interfaces",
    "docs/how-to/probability-per-flight-hour.md": "open-loop trials",
    "docs/how-to/replay-and-export.md": "flies and votes again",
    "docs/how-to/search-any-plant.md": "two searches, 34 s",
    "docs/how-to/stock-autopilots.md": "compiles the unit and flies minutes",
    "docs/how-to/which-sensor-was-wrong.md": "recorded flights of minutes",
}
PROGRAMS: Final = ("cat", "cc", "cp", "grep", "head", "ls", "make", "mkdir", "mv", "python", "sort", "tail")
_FENCE: Final = re.compile(r"^(?P<indent> *)(?P<ticks>```+)(?P<kind>[\w+-]*)(?P<more>.*)$")
_HIDDEN: Final = re.compile(r"^<!-- (?P<kind>python|sh)(?P<more>)$")
_TITLE: Final = re.compile(r'title="([^"]+)"')
_CODE: Final = re.compile(r'\s*(?:;|\|\|) echo "?(?P<before>[^"$]*)\$\?"?$')


class PageError(Exception):
    """The code of a page fails: page, line, command and reason."""


@dataclass
class Step:
    """Something that a page runs: a command, Python code, or a file that is written.

    line : of the page, from 1; shown : what the page shows as printed, in its lines first to last; None: nothing
    """

    kind: str
    code: str
    line: int
    shown: list[str] | None = None
    first: int = 0
    last: int = 0
    indent: str = ""


@dataclass
class Block:
    """A block of code of a page; line: of its first line of code, from 1."""

    kind: str
    more: str
    line: int
    lines: list[str]
    indent: str = ""


def names() -> list[str]:
    """Return the pages: README and all below docs/."""
    return ["README.md", *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").rglob("*.md"))]


def blocks(text: str) -> Iterator[Block]:
    """Yield the blocks of code of a page, also those in comments."""
    lines, at = text.splitlines(), 0
    while at < len(lines):
        opened = _FENCE.match(lines[at]) or _HIDDEN.match(lines[at])
        at += 1
        if not opened:
            continue
        found = opened.groupdict()
        end, indent, begin = (found.get("ticks") or "-->"), found.get("indent") or "", at
        while at < len(lines) and lines[at].strip() != end:
            at += 1
        inside = [line.removeprefix(indent) for line in lines[begin:at]]
        yield Block(found["kind"], found["more"], begin + 1, inside, indent)
        at += 1


def steps(text: str) -> list[Step]:
    """Return what a page runs, in order."""
    found: list[Step] = []
    previous: Block | None = None
    lines = text.splitlines()
    for block in blocks(text):
        code, title = "\n".join(block.lines) + "\n", _TITLE.search(block.more)
        if title:
            found.append(Step(f"file {title[1]}", code, block.line))
        elif block.kind in {"console", "sh"}:
            found.extend(_commands(block))
        elif block.kind in {"python", "toml"}:
            found.append(Step(block.kind, code, block.line))
        elif block.kind == "text" and previous and previous.kind == "python" and found:
            between = lines[previous.line + len(previous.lines) : block.line - 2]
            if not "".join(between).strip():
                found[-1].shown, found[-1].indent = block.lines, block.indent
                found[-1].first, found[-1].last = block.line - 1, block.line - 1 + len(block.lines)
        previous = block
    return found


def _commands(block: Block) -> Iterator[Step]:
    """Yield the commands of a block, each with its output."""
    step, continued = None, False
    for at, line in enumerate(block.lines, block.line - 1):
        starts = line.startswith("$ ") if block.kind == "console" else bool(line.split("#")[0].strip())
        if continued and step:
            step.code += " " + line.strip()
        elif starts:
            if step:
                yield _without_comment(step)
            step = Step("command", line.removeprefix("$ "), at + 1, [], at + 1, at + 1, block.indent)
        elif step and step.shown is not None and block.kind == "console":
            step.shown.append(line)
            step.last = at + 1
        if step and (continued or starts):
            continued = step.code.endswith("\\")
            step.code = step.code.removesuffix("\\").rstrip()
            step.first = step.last = at + 1
    if step:
        yield _without_comment(step)


def _without_comment(step: Step) -> Step:
    step.code = re.split(r"\s# ", step.code)[0].strip()
    while step.shown and not step.shown[-1].strip():
        step.shown.pop()
        step.last -= 1
    return step


def excepted(command: str, page: str) -> str | None:
    """Return the row of EXCEPTIONS that a command of a page begins with."""
    return next(
        (key for key in EXCEPTIONS if f"{command} ".startswith(key) or f"{page}: {command} ".startswith(key)), None
    )


def parse(command: str) -> None:
    """ValueError: the command does not exist, or lacks one of the options."""
    import typer

    from rig.cli.main import app

    words = shlex.split(command)
    if words[0] != "rig":
        return
    node: Any = typer.main.get_command(app)
    rest = words[1:]
    while hasattr(node, "commands"):
        if not rest or rest[0] not in node.commands:
            raise ValueError(f"no command {' '.join(words[: len(words) - len(rest) + 1])}")
        node, rest = node.commands[rest[0]], rest[1:]
    options = {name for parameter in node.params for name in (*parameter.opts, *parameter.secondary_opts)}
    if missing := [one for one in rest if re.match(r"--?[a-z]", one) and one.split("=")[0] not in options]:
        raise ValueError(f"no option {missing[0]}")


def command(line: str) -> str:
    """Run a command in the current folder and return all that it prints; ValueError: it does not end with 0."""
    asked = _CODE.search(line)
    bare = _CODE.sub("", line)
    if bare.startswith("rig ") and not re.search(r"[|<;&`]|\$\(|>>|2>", re.sub(r"'[^']*'|\"[^\"]*\"", "", bare)):
        code, printed = _rig(bare)
    elif bare.split()[0] in (*PROGRAMS, "rig"):
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        ran = subprocess.run(
            ["bash", "-c", bare],
            env={**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        code, printed = ran.returncode, ran.stdout
    else:
        raise ValueError(f"not run: add {bare.split()[0]!r} to PROGRAMS or to EXCEPTIONS of tests/tools/pages.py")
    if asked and (code or ";" in asked[0]):
        return f"{printed}{asked['before']}{code}\n"
    if code:
        raise ValueError(f"exit code {code}: {printed}")
    return printed


def _rig(line: str) -> tuple[int, str]:
    """Run a command of rig in this process; return its exit code and what it prints."""
    from rig.cli import main
    from rig.core.notes import note

    words, _, into = line.partition(" > ")
    printed, code = StringIO(), 0
    written = StringIO() if into else printed
    note.cache_clear()  # a process prints a note once
    with mock.patch.object(sys, "argv", shlex.split(words)), redirect_stdout(written), redirect_stderr(printed):
        try:
            main.main()
        except SystemExit as end:
            code = int(end.code or 0)
    if into:
        Path(into.strip()).write_text(written.getvalue(), encoding="utf-8")
    return code, printed.getvalue()


@contextmanager
def folder() -> Iterator[Path]:
    """Work in a folder with what the commands of a page find in a clone; forget modules that came from there."""
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        place = Path(name).resolve()
        _forget(ROOT / "docs" / "examples", place.parent)
        for kept in ("docs/examples", "faults"):
            shutil.copytree(ROOT / kept, place / kept, ignore=shutil.ignore_patterns("build", "__pycache__"))
        stack.enter_context(chdir(place))
        stack.enter_context(mock.patch.object(sys, "path", [str(place), *sys.path]))
        stack.enter_context(mock.patch.dict(os.environ))
        os.environ.pop("COLUMNS", None)
        os.environ["FIRMWARE"] = str(outside.betaflight() or "")  # of docs/examples/autopilot/Makefile
        yield place
        _forget(place)


def _forget(*places: Path) -> None:
    """Forget modules that came from files below ``places``, but for those of the project and of its environment."""
    for module, loaded in list(sys.modules.items()):
        file = Path(getattr(loaded, "__file__", None) or "/")
        examples = file.is_relative_to(ROOT / "docs")
        if any(map(file.is_relative_to, places)) and (examples or not file.is_relative_to(ROOT)):
            del sys.modules[module]


def do(step: Step, page: str, space: dict[str, Any]) -> str | None:
    """Run a step in the current folder; return what it prints, None if it is not run."""
    if step.kind.startswith("file "):
        path = Path(step.kind.removeprefix("file "))
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(step.code, encoding="utf-8")
        return None
    if step.kind == "toml":
        tomllib.loads(step.code)
        return None
    if step.kind == "python":
        printed = StringIO()
        with redirect_stdout(printed), redirect_stderr(printed):
            exec(compile("\n" * (step.line - 1) + step.code, page, "exec"), space)  # the code of our own page
        return printed.getvalue()
    if excepted(step.code, page):
        parse(step.code)
        return None
    return command(step.code)


def run(page: str, *, fill: bool = False, text: str | None = None) -> tuple[str, dict[Path, str], list[str]]:
    """Run a page; return its text as it must be, the pictures by their files, and each difference in words."""
    text = (ROOT / page).read_text(encoding="utf-8") if text is None else text
    lines, wrong, space = text.splitlines(), list[str](), dict[str, Any]({"__name__": "page"})
    changes: list[tuple[int, int, list[str]]] = []
    with folder() as place, page_pictures.style(".plot(" in text or "savefig" in text):
        for file in DATA[page].iterdir() if page in DATA else ():
            (place / file.name).symlink_to(file.resolve())
        for step in steps(text):
            where = f"{page}:{step.line}: {step.code.splitlines()[0] if step.code.strip() else step.kind}"
            try:
                printed = do(step, page, space)
            except Exception as error:
                raise PageError(f"{where}: {type(error).__name__}: {error}") from error
            if printed is None or step.shown is None or not (step.shown or fill):
                continue
            real = normal(printed, place)
            if not matches(step.shown, real):
                new = rewritten(step.shown, real)
                wrong.append(f"{where}: prints\n" + "\n".join(_difference(step.shown, new)))
                changes.append((step.first, step.last, [(step.indent + line).rstrip() for line in new]))
        pictures = page_pictures.drawn(text, ROOT / page, place)
    for first, last, new in reversed(changes):
        lines[first:last] = new
    wrong += [f"{page}: {path.name} is drawn differently" for path in pictures if not _same(path, pictures[path])]
    return "\n".join(lines) + "\n", pictures, wrong


def _difference(shown: Sequence[str], new: Sequence[str]) -> Iterator[str]:
    import difflib

    for line in difflib.ndiff(shown, new):
        if not line.startswith("?"):
            yield f"    {line}"


def _same(path: Path, text: str) -> bool:
    return path.exists() and path.read_text(encoding="utf-8") == text


def write(page: str, text: str, pictures: dict[Path, str]) -> None:
    """Write a page and its pictures."""
    (ROOT / page).write_text(text, encoding="utf-8")
    for path, picture in pictures.items():
        path.parent.mkdir(exist_ok=True)
        path.write_text(picture, encoding="utf-8")


def main(arguments: Sequence[str]) -> int:
    """Run pages and rewrite them; return 1 if code of one fails, or with --check if one differs."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("pages", nargs="*", type=lambda name: str(Path(name).resolve().relative_to(ROOT)))
    for name in ("--check", "--fill", "--fast"):
        options.add_argument(name, action="store_true")
    asked, bad = options.parse_args(arguments), 0
    for page in asked.pages or names():
        if page in NOT_RUN or (asked.fast and page in LONG):
            continue
        try:
            text, pictures, wrong = run(page, fill=asked.fill)
        except PageError as error:
            print(error, flush=True)
            bad += 1
            continue
        for one in wrong:
            print(one, flush=True)
        bad += bool(wrong and asked.check)
        if wrong and not asked.check:
            write(page, text, pictures)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
