"""A column of a table, declared once: Parquet, JSON, terminal and page read the declaration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

KEPT: Final = 9  # worth of a column that is never left out
SHARE, COUNT, RATE = "share", "count", "rate"
SECONDS, INSTANT, PLAIN, LEVEL = "seconds", "instant", "plain", "level"
"""Words for ``Column.format``: cli/printing.py has their look on a terminal, show/pages/page.py that on a page."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column.

    name : title; ``key``, with _ for blanks, is the name in Parquet and JSON
    value : how a row gives it: a path of keys and attributes with dots, an index, or a function; default ``key``
    format : a word of those above, or a format of Python's format(); text is shown unchanged
    unit : shown after the title
    empty : shown if there is no value
    worth : up to KEPT; a narrow terminal leaves out the columns that are worth least; 0: shown on pages only
    page : title on a page, if another; None: not on a page
    hint : key of a row's text that a page shows over the cell
    type : type of the values; needed if they are stored, or are text on a page
    hashed : part of the hash of its table; None: only if a row has a value
    added : older files lack the column; it is then empty
    """

    name: str
    value: str | int | Callable[[Any], Any] | None = None
    format: str = ""
    unit: str = ""
    empty: str = ""
    worth: int = KEPT
    page: str | None = ""
    hint: str = ""
    type: Any = None
    hashed: bool | None = True
    added: bool = False

    @property
    def key(self) -> str:
        """Return the name in Parquet and JSON."""
        return self.name.replace(" ", "_")

    @property
    def head(self) -> str:
        """Return the name with its unit."""
        return f"{self.name}, {self.unit}".rstrip(", ")

    @property
    def is_text(self) -> bool:
        """Return True if the column holds text, which a page aligns to the left."""
        return self.type is str

    def of(self, row: Any) -> Any:
        """Return the value of a row; None if a part of its path is None."""
        if callable(self.value):
            return self.value(row)
        if isinstance(self.value, int):
            return row[self.value]
        for part in (self.value or self.key).split("."):
            row = None if row is None else row[part] if isinstance(row, Mapping) else getattr(row, part)
        return row

    def text(self, value: Any, words: Mapping[str, Callable[[Any], str]]) -> str:
        """Return a value as text; ``words``: the function of each word that ``format`` may be."""
        if value is None or isinstance(value, str):
            return self.empty if value is None else value
        return words[self.format](value) if self.format in words else format(value, self.format)


def columns(*titles: str, worth: Mapping[str, int] | None = None) -> list[Column]:
    """Return the columns of rows that are tuples of text; ``worth`` of the optional ones, by title."""
    return [Column(title, i, worth=(worth or {}).get(title, KEPT)) for i, title in enumerate(titles)]
