"""Where a fault can sit: channels of a signal or a discrete, the inertial unit, a reference, a surface's actuator."""

from __future__ import annotations

from itertools import chain
from typing import Final, Literal, NamedTuple

from rig.frame import DISCRETE_INDEX, INDEX, INERTIAL, SURFACES
from rig.text import choices

Site = Literal["channel", "inertial", "reference", "surface", "discrete"]
CHANNELLED: Final[tuple[Site, ...]] = ("channel", "discrete")  # where a fault sits on numbered channels
WITH_THRESHOLD: Final[tuple[Site, ...]] = ("channel", "reference")  # where magnitudes may be given in thresholds
SURFACE_NAMES: Final = tuple(name.removesuffix("_rad") for name in SURFACES)  # every aircraft has these
# Each place by name, and its row in the table of ranges that the stage is made with: the signals, the quantities of
# the inertial unit, the references in the order of the signals, the surfaces; behind that table the discretes.
_NAMES: Final[dict[Site, list[str]]] = {
    "channel": [*INDEX],
    "inertial": [f"inertial.{name}" for name in INERTIAL],
    "reference": [f"reference.{name}" for name in INDEX],
    "surface": [f"surface.{name}" for name in SURFACE_NAMES],
    "discrete": [*DISCRETE_INDEX],
}
PLACES: Final = {name: i for i, name in enumerate(chain(*_NAMES.values()))}


class Point(NamedTuple):
    """One value that a fault acts on: a place and, for a signal or a discrete, the channel counted from 1."""

    place: str
    channel: int | None = None


def site(place: str) -> Site:
    """Return what kind of place it is."""
    if place in DISCRETE_INDEX:
        return "discrete"
    head = place.partition(".")[0]
    return head if head in ("inertial", "reference", "surface") else "channel"


def number(place: str) -> int:
    """Return the index of a place among those of its kind."""
    return PLACES[place] - PLACES[_NAMES[site(place)][0]]


def refuse_unknown(name: str) -> str:
    """Return ``name`` if it is a place; ValueError says what is allowed there."""
    if name in PLACES:
        return name
    of = site(name)
    if of == "surface":
        raise ValueError(f"the aircraft has no such surface, {choices(name, _NAMES[of])}")
    known = PLACES if of == "channel" else _NAMES[of]
    raise ValueError(f"unknown signal, {choices(name, known, 'docs/faults.md')}")
