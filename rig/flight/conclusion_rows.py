"""The conclusion of a flight as data: an outcome, and rows of a label with its texts; printers lay it out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, overload

MOST: Final = 10  # lines of a conclusion on the terminal
SURVIVED, LOST, NOT_SCORED = "SURVIVED", "LOST", "NOT SCORED"  # outcomes


class Row(NamedTuple):
    """One place: its label, what happened there, and why; texts of a line each."""

    label: str
    texts: tuple[str, ...]
    why: tuple[str, ...] = ()  # left out first where lines are few

    def __str__(self) -> str:
        """Return the row as one sentence."""
        return f"{self.label}: {'; '.join((*self.texts, *self.why))}"


@dataclass(frozen=True, slots=True)
class Conclusion(Sequence[str]):
    """The outcome of a flight; as a sequence, its sentences: the outcome first, then one for each row.

    outcome : SURVIVED, LOST or NOT SCORED; summary : the rest of the first line
    rows    : wrong decisions, faults and other events, the most important first
    flight  : the voted values and the aircraft
    """

    outcome: str
    summary: str
    rows: tuple[Row, ...] = ()
    flight: tuple[Row, ...] = ()

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[str]: ...

    def __getitem__(self, index: int | slice) -> str | Sequence[str]:
        """Return one sentence, or several."""
        return self.sentences[index]

    def __len__(self) -> int:
        """Return the number of sentences."""
        return 1 + len(self.rows) + len(self.flight)

    @property
    def sentences(self) -> list[str]:
        """Return every row as a sentence, as pages, notebooks and JSON show them."""
        between = " " if self.outcome == LOST else ": "  # LOST at 21.37 s: why
        return [f"{self.outcome}{between}{self.summary}", *map(str, (*self.rows, *self.flight))]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data: the outcome, the summary and all rows."""
        rows, flight = ([row._asdict() for row in part] for part in (self.rows, self.flight))
        return {"outcome": self.outcome, "summary": self.summary, "rows": rows, "flight": flight}

    def lines(self, most: int = MOST, more: str = "") -> list[tuple[str, str]]:
        """Return label and text of each line below the first, ``most`` lines with it; a continued row has no label.

        more : the command that shows the rows that do not fit
        """
        closing = [*_lines(self.flight)]
        room = most - 1 - len(closing)
        for rows in (self.rows, [row._replace(why=()) for row in self.rows]):
            shown = [*_lines(rows)]
            if len(shown) <= room:
                return [*shown, *closing]
        shown, left = list[tuple[str, str]](), [row._replace(why=()) for row in self.rows]
        while left and len(shown) + len(left[0].texts) < room:
            shown += _lines([left.pop(0)])
        if not shown and left:
            shown += [*_lines([left.pop(0)])][: max(room - 1, 1)]
        rest = [("", f"and {len(left)} more{f': {more}' if more else ''}")] if left else []
        return [*shown, *rest, *closing]


def _lines(rows: Sequence[Row]) -> Iterator[tuple[str, str]]:
    for row in rows:
        for i, text in enumerate((*row.texts, *row.why)):
            yield ("" if i else row.label), text
