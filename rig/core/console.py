"""The console for people: it prints every string as plain text, from any source."""

from __future__ import annotations

import os
from typing import Any

from rich.console import Console
from rich.text import Text

from rig.core.text import plain

PIPE_WIDTH = 120  # of tables in a pipe, where the variable COLUMNS says nothing; lines are not folded there


class Screen(Console):
    """A console without markup, emoji codes or highlighting; control characters are shown, not sent.

    ``styled`` makes text with styles; a whole line may have one style.
    """

    def __init__(self, *, stderr: bool = False, width: int | None = None) -> None:
        super().__init__(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)

    def render_str(self, text: str, **options: Any) -> Text:
        """Return any string, printed or in a table's cell, as plain text."""
        return super().render_str(plain(text), **options)


def console(stderr: bool = False) -> Screen:
    """Return the console of standard output (or error)."""
    screen = Screen(stderr=stderr)
    return screen if screen.is_terminal or "COLUMNS" in os.environ else Screen(stderr=stderr, width=PIPE_WIDTH)


def styled(*parts: str | tuple[str, str]) -> Text:
    """Return text of parts, each plain or with its style: ``styled(("survived", "green"), ": duration flown")``."""
    return Text.assemble(*(plain(part) if isinstance(part, str) else (plain(part[0]), part[1]) for part in parts))
