"""Looks of the states in a timeline: each variable has its own legend row, each state a colour and a hatch."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from rig.core.frame import COMPUTERS, MOVED, DecidedBy, Law, Pattern, Source
from rig.core.palette import (
    BLUE,
    BROWN,
    CHANNELS,
    GREEN,
    INK,
    LIGHT_BLUE,
    MAGENTA,
    MID_BLUE,
    ORANGE,
    QUIET,
    RED,
    SOFT,
    TEAL,
    UNUSED,
    VIOLET,
    WHITE,
    YELLOW,
)

UNUSED_STATE: Final = "not used"  # a channel that is not isolated, of a signal without a channel
_QUIET_STATES: Final = (
    *("ok", "normal", "none", "voted", "autopilot", "4 channels", "engaged", "fresh", "all channels"),
)
_BRIGHT: Final = (YELLOW, ORANGE)  # on either screen
_PALE: Final = (QUIET, LIGHT_BLUE, UNUSED)
_BLACK: Final = "#000000"  # also on a dark screen
_HATCHES: Final = ("/", "\\", "|", "-", "+", ".", "x")
_OTHERS: Final = (VIOLET, TEAL, BROWN, GREEN, MAGENTA, MID_BLUE, BLUE)
FAULT, CHANNEL, LANE, SERVO = "fault", "channel", "lane", "servo channel"


class Look(NamedTuple):
    """How a state is drawn; hatch : "" or one that base.html and plotly have."""

    colour: str
    hatch: str = ""

    @property
    def ink(self) -> str:
        """The colour of a text or a hatch on it."""
        return _BLACK if self.colour in _BRIGHT else INK if self.colour in _PALE else WHITE


def _others(*labels: str) -> dict[str, Look]:
    """Return a look for each of ``labels``, no two alike."""
    return {
        label: Look(*look) for label, look in zip(labels, zip(_OTHERS * 2, _HATCHES * 2, strict=True), strict=False)
    }


_LEVELS: Final = {
    "3 channels": Look(LIGHT_BLUE),
    "2 channels": Look(MID_BLUE, "/"),
    "1 channel": Look(BLUE, "x"),
    "no channel": Look(INK),
    "bypassed": Look(SOFT, "-"),
}
_LEADING: Final = zip(COMPUTERS, map(Look, CHANNELS, ("", "/", "\\", "|")), strict=True)
_PATTERNS: Final = {
    "isolated": Look(LIGHT_BLUE, "."),
    **_others(*(pattern.label for pattern in Pattern if pattern.is_split)),
    "lost": Look(INK),
    "unresolved": Look(SOFT, "x"),
}
_STATES: Final = {"suspect": Look(YELLOW, "."), "failed": Look(RED, "x"), UNUSED_STATE: Look(UNUSED, "-")}
LOOKS: Final[dict[str, dict[str, Look]]] = {
    FAULT: {"acting": Look(ORANGE, "/")},
    CHANNEL: _STATES,
    LANE: {**_STATES, "runs again, not engaged": Look(MID_BLUE, "+"), "off by command": Look(SOFT, "-")},
    "leading lane": {**dict(_LEADING), "back-up": Look(INK)},
    "vote of commands": _PATTERNS,
    "link": {
        "a frame old": Look(LIGHT_BLUE, "|"),
        "missing": Look(YELLOW, "."),
        "outvoted": Look(MAGENTA, "\\"),
        "failed": Look(RED, "x"),
    },
    SERVO: _STATES,
    "moved by": _LEVELS,
    "pattern": _PATTERNS,
    "decided by": _others(*(each.name.lower() for each in DecidedBy if each)),
    "source": _others(*(each.name.lower() for each in Source if each)),
    "level": _LEVELS,
    "control law": _others(*(each.name.lower() for each in Law if each)) | {"backup": Look(INK)},
}


def quiet(label: str) -> bool:
    """Return True if a state needs no attention."""
    return label in _QUIET_STATES


def look(variable: str, label: str) -> Look:
    """Return the look of a state of a variable: quiet grey, red for a failure, or that of LOOKS."""
    if quiet(label):
        return Look(QUIET)
    if label.startswith(("failed", "shut off")):
        return Look(RED, "x")
    return LOOKS.get(variable, {}).get(label, Look(VIOLET, "/"))


def variable(path: str) -> str:
    """Return which variable a row of the timeline shows, by the path of its changes."""
    _, of, *part = path.split("/")
    if part and part[0].startswith("channel_"):
        return SERVO if of in MOVED else CHANNEL
    if part:
        named = {"moved_by": "moved by", "decided_by": "decided by"}
        return named.get(part[0], part[0])
    for begin, name in (("fault_", FAULT), ("lane_", LANE), ("vote_", "vote of commands")):
        if of.startswith(begin):
            return name
    return "link" if "_to_" in of else of.replace("_", " ")


def bar(variable_of: str, label: str) -> dict[str, Any]:
    """Return how plotly draws a state's bars and where its legend has them."""
    drawn = look(variable_of, label)
    pattern = {
        "shape": drawn.hatch,
        "fillmode": "overlay",
        "bgcolor": drawn.colour,
        "fgcolor": drawn.ink,
        "fgopacity": 0.45,
        "size": 8,
        "solidity": 0.12,
    }
    return {
        "name": label,
        "marker": {
            "color": drawn.colour,
            "line": {"color": drawn.colour, "width": 0 if quiet(label) else 1},  # never thinner than that
            **({"pattern": pattern} if drawn.hatch else {}),
        },
        "legendgrouptitle": {"text": variable_of},
        "textfont": {"color": drawn.ink, "size": 11},
    }
