"""Colours of every report and figure, on white; rig/show/viewer/style.py has the same hues for a dark ground.

Red marks a failure or an error, orange an active fault, yellow a suspect channel; no line has these colours.
Four channels differ by their dashes too.
"""

from __future__ import annotations

from typing import Final

BLUE, RED, GREEN, VIOLET, ORANGE = "#2166ac", "#b2182b", "#3a8a2e", "#8073ac", "#e08214"
MID_BLUE, LIGHT_BLUE, PALE_BLUE, PALE_RED, YELLOW = "#4393c3", "#92c5de", "#d1e5f0", "#fddbc7", "#f4c542"
BROWN, MAGENTA, TEAL = "#8c6239", "#c51b7d", "#35978f"
INK, SOFT, LINE, QUIET, PALE = "#1d2630", "#5b6773", "#d8dde2", "#dfe6ec", "#f5f7f9"  # text to background
WHITE, UNUSED = "#ffffff", "#b4bec8"  # the ground, and a channel that is not used

SERIES: Final = (BLUE, GREEN, VIOLET, BROWN, TEAL, MAGENTA, "#666666")
CHANNELS: Final = SERIES[:4]
DASHES: Final = ("solid", "dash", "dashdot", "dot")  # of the channels
VOTE, TRUTH, REFERENCE, GOOD, BAD = INK, "#8a949e", MAGENTA, BLUE, RED
SHARE_SCALE: Final = [[0.0, RED], [0.5, PALE_RED], [0.75, PALE_BLUE], [1.0, BLUE]]  # of a share from 0 to 1
CSS: Final = {"ink": INK, "soft": SOFT, "line": LINE, "pale": PALE, "good": GOOD, "bad": BAD}


def series_colour(index: int) -> str:
    """Return the colour of the line ``index``, from 0; they repeat."""
    return SERIES[index % len(SERIES)]


def series_dash(index: int) -> str:
    """Return the dashes of the line ``index``, if there are more lines than colours."""
    return DASHES[index // len(SERIES) % len(DASHES)]


def faint(colour: str, opacity: float) -> str:
    """Return a ``colour`` with transparency."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, {opacity:g})"
