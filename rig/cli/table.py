"""How every command prints for people: one printer of tables, lines with a label, numbers with an interval."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from rich.table import Table
from rich.text import Text

from rig.util.console import console, styled

MOST_LINES: Final = 40  # of one kind on the terminal; --json has all
_LABEL: Final = 9  # characters before what a line tells


class Column(NamedTuple):
    """A column of a table.

    value : a row's attribute, key or index, with dots for one inside another; or a function of the row
    format : of numbers, as Python's format() takes it; text is shown as it is
    unit : shown after the title
    empty : shown where there is no value
    """

    title: str
    value: str | int | Callable[[Any], Any]
    format: str = ""
    unit: str = ""
    empty: str = ""

    def cell(self, row: Any) -> str | Text:
        """Return what the column shows of a row."""
        value = self.value(row) if callable(self.value) else _lookup(row, self.value)
        if value is None:
            return self.empty
        return value if isinstance(value, str | Text) else format(value, self.format)


def _lookup(row: Any, name: str | int) -> Any:
    """Return the item ``name`` of a row: an index, or names of keys and attributes with dots between."""
    if isinstance(name, int):
        return row[name]
    for part in name.split("."):
        row = row[part] if isinstance(row, Mapping) else getattr(row, part)
    return row


def columns(*titles: str) -> list[Column]:
    """Return the columns of rows that are tuples of text."""
    return [Column(title, i) for i, title in enumerate(titles)]


def table(
    rows: Iterable[Any], columns: Sequence[Column], most: int | None = None, style: Callable[[Any], str] | None = None
) -> None:
    """Print ``rows`` under the titles of ``columns``; nothing where there are none.

    most : rows that are printed; a line tells how many more there are
    style : of a row
    """
    rows = list(rows)
    if not rows:
        return
    printed = Table(*(f"{column.title}, {column.unit}".rstrip(", ") for column in columns), box=None)
    for row in rows[:most]:
        printed.add_row(*(column.cell(row) for column in columns), style=style(row) if style else None)
    console().print(printed)
    if most is not None:
        rest(len(rows), most)


def rest(count: int, most: int, text: str = "  and {} more, with --json") -> None:
    """Print how many of ``count`` are not shown, where more than ``most`` there are."""
    if count > most:
        line(text.format(count - most))


def line(*parts: str | tuple[str, str], style: str = "") -> None:
    """Print one line, not folded; each part is text, or text with its style."""
    console().print(styled(*parts), style=style, soft_wrap=True)


def field(label: str, *parts: str | tuple[str, str], style: str = "", width: int = _LABEL) -> None:
    """Print one line that begins with its label."""
    line(f"{label:{width}}", *parts, style=style)


def counts(numbers: Mapping[str, Any], names: Iterable[str] | None = None) -> list[str]:
    """Return ``3 late``, ``1 replies lost`` for the counts that are above zero, those of ``names`` alone if given."""
    shown = numbers if names is None else list(names)
    return [f"{numbers[name]} {name.replace('_', ' ')}" for name in shown if _is_count(numbers[name])]


def _is_count(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value > 0


def share(rate: Mapping[str, Any]) -> str:
    """Return a proportion with its interval; ``rate`` has count, of, value, low and high."""
    if rate["value"] is None:
        return "none"
    return f"{rate['count']} of {rate['of']}: {rate['value']:.4f} ({rate['low']:.4f} to {rate['high']:.4f})"


def rough_duration(seconds: float) -> str:
    """Return a duration for a plan: ``90 s``, ``12 min``, ``3.5 h``."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def file_size(count: int) -> str:
    """Return a number of bytes in MB or GB."""
    return f"{count / 1e6:.1f} MB" if count < 1e9 else f"{count / 1e9:.1f} GB"
