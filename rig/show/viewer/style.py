"""Colours, labels and names with the same meaning in every view, on the dark ground of the viewer.

The hues are those of rig/core/palette.py: red for failures, orange for active faults, yellow for suspects.
No line of a channel, of the vote or of the reference has one of these.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

Color = tuple[int, int, int]
Looks = dict[str, tuple[str, Color]]  # member of an enum: label, colour

CHANNEL_COLORS: Final[tuple[Color, ...]] = ((86, 180, 233), (60, 190, 110), (165, 140, 255), (190, 135, 85))
CHANNEL_NAMES: Final = tuple((f"channel {c + 1}", color) for c, color in enumerate(CHANNEL_COLORS))
VOTED: Final[Color] = (255, 255, 255)
TRUTH: Final[Color] = (128, 136, 144)
REFERENCE: Final[Color] = (240, 80, 180)
THRESHOLD: Final[Color] = (70, 130, 140)  # the vote plus and minus one threshold
FAULT: Final[Color] = (110, 66, 10)  # the ground under the vote while a fault is active
FAULT_STRIP: Final[Color] = (200, 115, 0)
FAILED: Final[Color] = (214, 50, 50)
ALL_FAILED: Final[Color] = (140, 20, 30)
OK: Final[Color] = (0, 114, 178)
SUSPECT: Final[Color] = (240, 228, 66)
PALETTE: Final[tuple[Color, ...]] = (*CHANNEL_COLORS, VOTED, REFERENCE, OK, (170, 170, 170))
COLOR_NAMES: Final = ("sky blue", "green", "violet", "brown", "white", "magenta", "blue", "grey")  # of PALETTE
QUIET: Final[Color] = (70, 76, 82)  # states that need no attention
FUSELAGE, FIN, HORIZON_LINE = (230, 230, 230), (230, 159, 0), (120, 126, 132)  # of the aircraft in space
STATE_LOOKS: Final[Looks] = {
    "OK": ("ok", OK),
    "SUSPECT": ("suspect", SUSPECT),
    "FAILED": ("failed", FAILED),
}
ACTING: Final = "ACTING"
ENDED: Final[Color] = (36, 36, 40)  # the rest of a strip after the end of its flight
OVER: Final = "OVER"  # a flight that ended before another
# Flights shown together, from the top down: colour of figure and path, brightness of all lines.
FLIGHT_COLORS: Final[tuple[Color, ...]] = (VOTED, CHANNEL_COLORS[0], REFERENCE, CHANNEL_COLORS[3])
_SHADES: Final = (1.0, 0.55, 0.4, 0.3)


def plain(name: str) -> str:
    """Return a name of a table as words: pitch_rate as pitch rate."""
    return name.replace("_", " ")


def shade(color: Color, below: int) -> Color:
    """Return ``color`` for a flight with ``below`` others over it: each one makes it darker."""
    red, green, blue = (round(value * _SHADES[below]) for value in color)
    return red, green, blue


def attention(enum: type[IntEnum], quiet: IntEnum) -> Looks:
    """Return a look for each member; the ``quiet`` one stays in the background."""
    return {
        member.name: (
            getattr(member, "label", member.name.lower()),
            QUIET if member == quiet else ALL_FAILED if member.name == "LOST" else PALETTE[member.value % len(PALETTE)],
        )
        for member in enum
    }
