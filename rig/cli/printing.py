"""Printing for people: tables, lines with a label, numbers with an interval."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from textwrap import wrap
from typing import Any, Final

from rich.cells import cell_len
from rich.table import Table
from rich.text import Text

from rig.core.column import COUNT, INSTANT, KEPT, LEVEL, PLAIN, RATE, SECONDS, SHARE, Column
from rig.core.console import console, styled
from rig.core.text import plain

MOST_LINES: Final = 40  # of one kind on the terminal; --json has all
_LABEL: Final = 9  # characters before what a line tells
_PROSE: Final = 32  # a column with longer text is folded at words
_WORD: Final = re.compile(r"\S+")
_PADDING: Final = 2  # characters between two columns


def table(
    rows: Iterable[Any], columns: Sequence[Column], most: int | None = None, style: Callable[[Any], str] | None = None
) -> None:
    """Print ``rows`` under the titles of ``columns``, as many as the screen is wide for; print nothing without rows.

    No head and no number is cut.  Heads are folded at words.  If they still do not fit, the other columns follow
    below, each part with the first column.

    most : number of rows to print; a line states how many more there are
    style : style of a row
    """
    rows = list(rows)
    if not rows:
        return
    screen = console()
    columns = [column for column in columns if column.worth]
    cells = [[_cell(column.of(row), column) for row in rows[:most]] for column in columns]
    heads, widths = _heads(columns, cells, screen.width)
    kept = _fitting(columns, widths, screen.width)
    for part in _parts(kept, [_narrowest(head, shown) for head, shown in zip(heads, cells, strict=True)], screen.width):
        printed = Table(box=None)
        for i in part:
            fixed = widths[i] <= _PROSE and len(part) > 1
            printed.add_column(Text(heads[i]), no_wrap=fixed, overflow="fold", vertical="top")
        for k, row in enumerate(rows[:most]):
            printed.add_row(*(cells[i][k] for i in part), style=style(row) if style else None)
        screen.print(printed)
    if gone := [column.name for i, column in enumerate(columns) if i not in kept]:
        line(f"  hidden columns (width {screen.width}): {', '.join(gone)}; --json shows all")
    if most is not None:
        rest(len(rows), most)


def share(rate: Mapping[str, Any]) -> str:
    """Return a proportion with its interval; ``rate`` has count, of, value, low and high."""
    if rate["value"] is None:
        return "none"
    return f"{rate['count']} of {rate['of']}: {rate['value']:.4f} ({rate['low']:.4f} to {rate['high']:.4f})"


def _count(rate: Mapping[str, Any]) -> str:
    """Return a share as a count alone: another column has its interval."""
    return "none" if rate["value"] is None else f"{rate['count']} of {rate['of']:.0f}"


_WORDS: Final[dict[str, Callable[[Any], str]]] = {
    SHARE: share,
    COUNT: _count,
    RATE: lambda rate: "" if rate["value"] is None else f"{rate['value']:.3g}",
    SECONDS: "{:.3f}".format,
    INSTANT: "{:.2f}".format,
    PLAIN: "{:g}".format,
    LEVEL: lambda level: f"{level:.6g}" if isinstance(level, float) else str(level),
}


def _cell(value: Any, column: Column) -> Text:
    return value if isinstance(value, Text) else styled(column.text(value, _WORDS))


def _heads(columns: Sequence[Column], cells: Sequence[Sequence[Text]], width: int) -> tuple[list[str], list[int]]:
    """Return heads and widths of columns; heads that do not fit are folded at words, in as few lines as it takes."""
    titles = [plain(column.head) for column in columns]
    widest = [max(cell.cell_len for cell in shown) for shown in cells]
    lines = 1
    while True:
        heads = [_in_lines(title, lines) for title in titles]
        widths = [max(least, *map(cell_len, head), 0) for head, least in zip(heads, widest, strict=True)]
        fits = sum(min(each, _PROSE) + _PADDING for each in widths) <= width
        if fits or lines > max(len(title.split()) for title in titles):
            return ["\n".join(head) for head in heads], widths
        lines += 1


def _in_lines(title: str, lines: int) -> list[str]:
    """Return a title in at most ``lines`` lines, as narrow as possible; no word is cut."""
    narrowest = max(map(len, title.split()), default=1)
    folded = (wrap(title, width, break_on_hyphens=False) for width in range(narrowest, len(title) + 1))
    return next((each for each in folded if len(each) <= lines), [title])


def _narrowest(head: str, cells: Sequence[Text]) -> int:
    """Return the least width of a column in which no word is cut; text up to _PROSE stays in one line."""
    widest = max(cell.cell_len for cell in cells)
    inside = widest if widest <= _PROSE else max(cell_len(word) for cell in cells for word in cell.plain.split())
    return max(inside, *map(cell_len, head.splitlines()), 0)


def _parts(kept: Sequence[int], narrowest: Sequence[int], width: int) -> list[list[int]]:
    """Return the columns of each part of a table: one, or as many as it takes, each with the first column."""
    parts, first = [list(kept[:1])], kept[0]
    for i in kept[1:]:
        if sum(narrowest[k] + _PADDING for k in (*parts[-1], i)) > width:
            again = narrowest[first] + narrowest[i] + 2 * _PADDING <= width
            parts.append([first] if again else [])
        parts[-1].append(i)
    return parts


def _fitting(columns: Sequence[Column], widths: Sequence[int], width: int) -> list[int]:
    """Return the columns that fit; those worth least are left out first, of equal ones the last."""
    kept = list(range(len(columns)))
    leaving = sorted((i for i in kept if columns[i].worth < KEPT), key=lambda i: (columns[i].worth, -i))
    for i in leaving:
        if sum(min(widths[k], _PROSE) + _PADDING for k in kept) <= width:
            break
        kept.remove(i)
    return kept


def rest(count: int, most: int, text: str = "  and {} more, with --json") -> None:
    """Print how many of ``count`` are not shown, if there are more than ``most``."""
    if count > most:
        line(text.format(count - most))


def line(*parts: str | tuple[str, str], style: str = "", fold: bool = True, indent: int | None = None) -> None:
    """Print one line; each part is text, or text with its style.  A terminal folds it at words, a pipe does not.

    fold : False for a command that the user copies
    indent : indent of the folded lines; if not given, that of the first line
    """
    screen, text = console(), styled(*parts)
    if not (fold and screen.is_terminal):
        screen.print(text, style=style, soft_wrap=True)
        return
    start = len(text) - len(text.plain.lstrip(" ")) if indent is None else indent
    begin, body = text[:start], text[start:]
    for part in body.divide(_folds(body.plain, screen.width - start)):
        part.rstrip()
        screen.print(begin + part, style=style, soft_wrap=True)
        begin = Text(" " * start)


def _folds(text: str, width: int) -> list[int]:
    """Return where the lines after the first begin, at words, for ``width`` characters; a longer word stays whole."""
    folds = [0]
    for word in _WORD.finditer(text):
        if word.end() - folds[-1] > width and word.start() > folds[-1]:
            folds.append(word.start())
    return folds[1:]


def field(label: str, *parts: str | tuple[str, str], style: str = "", width: int = _LABEL, fold: bool = True) -> None:
    """Print one line that begins with its label."""
    line(f"{label:{width}}", *parts, style=style, fold=fold, indent=width)


def counts(numbers: Mapping[str, Any], names: Iterable[str] | None = None) -> list[str]:
    """Return ``3 late``, ``1 replies lost`` for the counts above zero; ``names``: only these counts."""
    shown = numbers if names is None else list(names)
    above = [name for name in shown if type(numbers[name]) is int and numbers[name] > 0]  # neither a text nor a flag
    return [f"{numbers[name]} {name.replace('_', ' ')}" for name in above]


def rough_duration(seconds: float) -> str:
    """Return a duration for a plan: ``90 s``, ``12 min``, ``3.5 h``."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def file_size(count: int) -> str:
    """Return a number of bytes in MB or GB."""
    return f"{count / 1e6:.1f} MB" if count < 1e9 else f"{count / 1e9:.1f} GB"


def robustness_told(robustness: float | None) -> str:
    """Return a robustness as text; ``none`` if a search has no number."""
    return "none" if robustness is None else f"{robustness:.4g}"


def share_told(of: Mapping[str, Any], on: str) -> str:
    """Return how many of a search's confirming flights or simulations violate, with the interval."""
    low, high = (100.0 * end for end in of["interval"])
    return f"{of['confirmed'][0]} of {of['confirmed'][1]} {on} violate ({low:.3g} to {high:.3g} %)"
