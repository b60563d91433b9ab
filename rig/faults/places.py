"""Where a fault can sit: channels of a signal, the inertial unit, a reference, a surface's actuator."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

from rig.frame import INDEX, INERTIAL, SURFACES, S
from rig.text import choices

Site = Literal["channel", "inertial", "reference", "surface"]
CHANNEL: Final = "channel"
SURFACE_NAMES: Final = tuple(name.removesuffix("_rad") for name in SURFACES)  # every aircraft has these
# Each place by name, and its row in the table of ranges that the stage is made with: the signals, the quantities of
# the inertial unit, the references in the order of the signals, the surfaces.
PLACES: Final = {
    **INDEX,
    **{f"inertial.{name}": S + i for i, name in enumerate(INERTIAL)},
    **{f"reference.{name}": S + len(INERTIAL) + i for name, i in INDEX.items()},
    **{f"surface.{name}": 2 * S + len(INERTIAL) + i for i, name in enumerate(SURFACE_NAMES)},
}
FIRST: Final[dict[Site, int]] = {
    "channel": 0,
    "inertial": S,
    "reference": S + len(INERTIAL),
    "surface": 2 * S + len(INERTIAL),
}


class Point(NamedTuple):
    """One value that a fault acts on: a place and, for a signal, the channel counted from 1."""

    place: str
    channel: int | None = None


def site(place: str) -> Site:
    """What kind of place it is."""
    head = place.partition(".")[0]
    return head if head in ("inertial", "reference", "surface") else "channel"


def number(place: str) -> int:
    """The index of a place among those of its kind."""
    return PLACES[place] - FIRST[site(place)]


def refuse_unknown(name: str) -> str:
    """``name`` if it is a place; ValueError says what is allowed there."""
    if name in PLACES:
        return name
    of = site(name)
    if of == "surface":
        raise ValueError(f"the aircraft has no such surface, {choices(name, _starting('surface.'))}")
    known = PLACES if of == "channel" else _starting(f"{of}.")
    raise ValueError(f"unknown signal, {choices(name, known, 'docs/faults.md')}")


def _starting(start: str) -> list[str]:
    return [name for name in PLACES if name.startswith(start)]
