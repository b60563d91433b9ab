"""Cells of the page: a channel's value in the colour of its state, with a mark, numbers and levels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from rich.text import Text

from rig.core.frame import State

# How a channel, its mark and what needs attention look.
STATES: Final = {
    State.OK: ("green", " "),
    State.SUSPECT: ("bold yellow", "?"),
    State.FAILED: ("bold red", "x"),
    State.ABSENT: ("dim", " "),
}


def name(text: str) -> Text:
    """Return the name of a row."""
    return Text(text, no_wrap=True, overflow="ellipsis")


def channel(value: Any, state: Any, write: Callable[[Any], str]) -> Text:
    """Return a channel's value with the mark of its state."""
    style, mark = STATES[State(state)]
    return Text("-" if state == State.ABSENT else write(value) + mark, style=style)


def number(value: float) -> str:
    """Return a number with what the sensors resolve: three decimals below 100, none above 10,000."""
    if not np.isfinite(value):
        return "nan"
    return f"{value:.{0 if abs(value) >= 10_000 else 1 if abs(value) >= 1_000 else 2 if abs(value) >= 100 else 3}f}"


def level(left: int, channels: int) -> Text:
    """Return how many are ``left`` of so many channels."""
    style = "" if left == channels else "bold red" if left == 0 else "yellow"
    return Text(str(left), style=style)
