"""Tables, lines and numbers as every command prints them; lists with commas as every command reads them."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from typer import Argument, Option, Typer
from typer.testing import CliRunner

from rig.cli import printing as module
from rig.cli.common import Align, comma_list, takes_options, whole_numbers
from rig.cli.printing import counts, field, line, rest, rough_duration, share, table
from rig.cli.studies import _servo  # pyright: ignore[reportPrivateUsage]
from rig.core.column import SECONDS, SHARE, Column, columns
from rig.core.console import Screen
from rig.core.errors import BadInput
from rig.show.pages.page import DASH, cell
from rig.studies.papers.servo_study import FREQUENCIES_HZ, Compared, Response


class Point(NamedTuple):
    name: str
    speed: dict[str, float | None]


POINTS = [Point("low", {"mach": 0.65432}), Point("[bold]high", {"mach": None})]
SHOWN = (
    Column("point", "name"),
    Column("speed", "speed.mach", ".2f", "Mach", "none"),
    Column("letters", lambda point: len(point.name)),
)


def printed(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return [" ".join(text.split()) for text in capsys.readouterr().out.splitlines()]


def test_a_column_looks_up_formats_and_names_its_unit(capsys: pytest.CaptureFixture[str]):
    table(POINTS, SHOWN)
    assert printed(capsys) == ["point speed, Mach letters", "low 0.65 3", "[bold]high none 10"]


def test_terminal_and_page_read_one_declaration_each_with_its_own_look(capsys: pytest.CaptureFixture[str]):
    rate = {"count": 1, "of": 2, "value": 0.5, "low": 0.1, "high": 0.9}
    shown = (
        *(Column("right share", format=SHARE), Column("delay s", format=SECONDS, page="delay, s")),
        *(Column("here", lambda _: "yes", page=None), Column("there", lambda _: "yes", worth=0)),
    )
    table([{"right_share": rate, "delay_s": None}], shown)
    assert printed(capsys) == ["right share delay s here", "1 of 2: 0.5000 (0.1000 to 0.9000) yes"]
    row = {"right_share": rate, "delay_s": None}
    assert [cell(row, column) for column in shown[:2]] == ["50 % (10 % to 90 %)", DASH]
    assert [column.key for column in shown] == ["right_share", "delay_s", "here", "there"]


def test_rows_beyond_the_most_are_counted_and_no_rows_print_nothing(capsys: pytest.CaptureFixture[str]):
    table([("a", "b"), ("c", "d")], columns("one", "two"), most=1)
    table([], SHOWN)
    rest(3, 3)
    assert printed(capsys) == ["one two", "a b", "and 1 more, with --json"]


def test_lines_are_text_with_their_label_before_them(capsys: pytest.CaptureFixture[str]):
    field("result", ("survived", "green"), ": [red]x\x1b")
    line()
    line("y" * 300)
    assert capsys.readouterr().out == f"result   survived: [red]x\\u001b\n\n{'y' * 300}\n"


WIDE = (
    *(Column("name", 0), Column("less", 1, worth=2), Column("least", 2, worth=1), Column("alike", 3, worth=2)),
    Column("kept", 4),
)
ROW = tuple(letter * 10 for letter in "abcde")


@pytest.mark.parametrize(
    ("width", "shown", "gone"),
    [
        (60, ["name", "less", "least", "alike", "kept"], ""),
        (59, ["name", "less", "alike", "kept"], "least"),
        (47, ["name", "less", "kept"], "least, alike"),
        (30, ["name", "kept"], "less, least, alike"),
    ],
)
def test_a_narrow_table_is_without_the_columns_that_are_worth_least(width, shown, gone, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    table([ROW], WIDE)
    head, *rest = capsys.readouterr().out.splitlines()
    assert head.split() == shown and max(map(len, (head, rest[0]))) <= max(width, 24)
    assert ("".join(rest[-1:]).strip() == f"hidden columns (width {width}): {gone}; --json shows all") == bool(gone)


MANY = [Column(f"delay at {n} Hz", n, ".3f", "ms") for n in range(15)]


@pytest.mark.parametrize("width", [120, 80, 40, 20])
def test_no_heading_and_no_number_is_cut_however_many_columns_there_are(width, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(width))
    table([{n: -1000.0 - n for n in range(15)}], MANY)
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= width
    words = said.split()
    for n in range(1, 15):
        assert words.count(f"{-1000.0 - n:.3f}") == 1 and words.count(str(n)) == 1
    assert words.count("delay") == words.count("Hz,") == words.count("ms") >= 15


def test_each_part_of_a_table_begins_with_its_first_column(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "30")
    table([ROW], columns("name", "a", "b", "c", "d"))
    lines = [text.split() for text in capsys.readouterr().out.splitlines()]
    assert lines[0::2] == [["name", "a"], ["name", "b"], ["name", "c"], ["name", "d"]]
    assert lines[1] == [ROW[0], ROW[1]] and lines[7] == [ROW[0], ROW[4]]


def test_the_table_of_servos_shows_every_heading_at_120_columns(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "120")
    row, none = Compared(100.0, 1.88e-3, 0.0194, 0.0012, 0.0178, (1.005,) * 4, (-0.00042,) * 4), np.empty(0)
    _servo([row], Response("f16", "elevator", 100.0, 0.01, none, none, none, none), FREQUENCIES_HZ)
    words = capsys.readouterr().out.split()
    assert words.count("1.005") == len(FREQUENCIES_HZ) and "rate," in words and "JSBSim's," in words


def test_long_text_is_folded_at_words_and_loses_nothing(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "50")
    table([("short", "0.227 deg/s " * 8)], columns("a", "b"))
    said = capsys.readouterr().out
    assert said.count("0.227") == 8 and said.count("deg/s") == 8 and max(map(len, said.splitlines())) <= 50


class Terminal(Screen):
    """A terminal of 40 columns."""

    def __init__(self) -> None:
        super().__init__(width=40)
        self._force_terminal, self._color_system = True, None


def test_on_a_terminal_lines_are_folded_at_words_but_commands_are_not(monkeypatch, capsys):
    monkeypatch.setattr(module, "console", Terminal)
    field("peaks", "load factor 0.99 to 1.00 g, altitude off by 0.2 m")
    line("  a sentence with two spaces before it, folded under itself")
    field("next", f"rig score {'x' * 40} --allow-code", fold=False)
    field("log", "y" * 60)
    assert capsys.readouterr().out.splitlines() == [
        "peaks    load factor 0.99 to 1.00 g,",
        "         altitude off by 0.2 m",
        "  a sentence with two spaces before it,",
        "  folded under itself",
        f"next     rig score {'x' * 40} --allow-code",
        f"log      {'y' * 60}",
    ]


def test_numbers_are_written_for_a_reader():
    rate = {"count": 3, "of": 4, "value": 0.75, "low": 0.19412, "high": 0.99369}
    assert share(rate) == "3 of 4: 0.7500 (0.1941 to 0.9937)" and share({**rate, "value": None}) == "none"
    assert [rough_duration(seconds) for seconds in (119.0, 120.0, 7200.0)] == ["119 s", "2 min", "2.0 h"]
    assert counts({"late": 2, "not_finite": 0, "dead": True, "name": "x", "replies_lost": 1}) == [
        "2 late",
        "1 replies lost",
    ]


def test_a_list_with_commas_is_read_once_and_in_order():
    assert whole_numbers("--levels", "4, 2,4", 2, 4) == [2, 4]
    assert comma_list("--threshold", "0.2,0.1", "numbers", float, lambda value: value > 0.0) == [0.2, 0.1]


@pytest.mark.parametrize("text", ["", "5", "2,", "2,x", "²", "2" * 5000, "-2", "1_0"])
def test_a_list_with_anything_else_is_refused_in_one_line(text: str):
    rule = r"--levels: must be whole numbers from 2 to 4, separated by commas, got ."
    with pytest.raises(BadInput, match=rule) as refused:
        whole_numbers("--levels", text, 2, 4)
    assert len(str(refused.value)) < 600


def test_a_stretch_to_align_by_needs_align_and_is_finite():
    with pytest.raises(BadInput, match="need --align"):
        Align(False, None, None, True).options()
    with pytest.raises(BadInput, match="--align-to: must be a finite number, got inf"):
        Align(True, None, float("inf"), False).options()
    assert Align(False, None, None, False).options() is None


@dataclass(frozen=True, kw_only=True)
class Group:
    size: Annotated[int, Option(metavar="N")] = 3


@dataclass(frozen=True, kw_only=True)
class Options:
    name: Annotated[str, Argument()]
    group: Group
    quick: Annotated[bool, Option("--quick")] = False


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["f16"], Options(name="f16", group=Group())),
        (["--quick", "f16", "--size", "5"], Options(name="f16", group=Group(size=5), quick=True)),
    ],
)
def test_a_dataclass_of_options_is_filled_from_the_command_line_with_its_groups(words: list[str], expected: Options):
    received: list[Options] = []

    def command(options: Options) -> None:
        received.append(options)

    app = Typer()
    app.command()(takes_options(command))
    assert CliRunner().invoke(app, words).exit_code == 0
    assert received == [expected]


def test_no_command_hides_a_line_break_in_a_line():
    """A control character of a line is escaped, and would be read as text."""
    sources = sorted((Path(__file__).parents[1] / "rig" / "cli").glob("*.py"))
    assert len(sources) > 15
    assert [path.name for path in sources if re.search(r"\bline\(f?\"[^\"]*\\n", path.read_text())] == []
