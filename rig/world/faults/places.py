"""Places of faults: channels of signals and discretes, inertial unit, references, actuators, computers, their links."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Final, Literal, NamedTuple

from pydantic import ValidationInfo

from rig.core.frame import COMPUTERS, DISCRETE_INDEX, INERTIAL, LINKS, MOVED, SIGNALS, SURFACES, SYSTEMS
from rig.core.text import choices

Site = Literal[
    "channel", "inertial", "reference", "surface", "discrete", "actuator", "hydraulics", "ccdl", "computer", "bus"
]
_PAGE: Final = "docs/reference/faults-and-signals.md"
OF_SERVOS: Final[tuple[Site, ...]] = ("actuator", "hydraulics")  # there with servo actuators alone
OF_LANES: Final[tuple[Site, ...]] = ("ccdl", "computer", "bus")  # with several computers alone
_BEFORE_DOT: Final[tuple[Site, ...]] = ("inertial", "reference", "surface", *OF_SERVOS, *OF_LANES)
_HEADS: Final[dict[str, Site]] = {head: head for head in _BEFORE_DOT}
CHANNELLED: Final[tuple[Site, ...]] = ("channel", "discrete")  # where a fault sits on numbered channels
WITH_THRESHOLD: Final[tuple[Site, ...]] = ("channel", "reference", "ccdl")  # may have magnitudes in thresholds
# One-way links of the lanes, from A to B first, and all that leave a lane, its node.
_WAYS: Final = tuple(f"ccdl.{COMPUTERS[sender]}-{COMPUTERS[receiver]}" for sender, receiver in LINKS)
LINK_NAMES: Final = (*_WAYS, *(f"ccdl.{name}" for name in COMPUTERS))
COMPUTER_NAMES: Final = (*(f"computer.{name}" for name in COMPUTERS), "computer.all")
BUSES: Final = 2  # of electrical power: the first feeds lanes A and C, the second B and D
SURFACE_NAMES: Final = tuple(name.removesuffix("_rad") for name in SURFACES)  # every aircraft has these


class Point(NamedTuple):
    """One value that a fault acts on: a place and, for a signal or a discrete, the channel counted from 1."""

    place: str
    channel: int | None = None


class Places:
    """All places of a flight, or of a recording, whose signals and discretes may have other names.

    names : names of each sort of place
    index : row of each name in the table of ranges of the stage; the discretes follow the ranges
    wraps : (signals,) True for an angle on the circle
    """

    def __init__(
        self,
        signals: Mapping[str, bool],
        discretes: Iterable[str],
        inertial: Iterable[str] = (),
        surfaces: Iterable[str] = (),
        actuators: Iterable[str] = (),
        systems: int = 0,
        links: Iterable[str] = (),
        computers: Iterable[str] = (),
        buses: int = 0,
    ) -> None:
        of_unit = [f"inertial.{name}" for name in inertial]
        self.names: dict[Site, list[str]] = {
            "channel": [*signals],
            "inertial": of_unit,
            "reference": [f"reference.{name}" for name in signals] if of_unit else [],
            "surface": [f"surface.{name}" for name in surfaces],
            "discrete": [*discretes],
            "actuator": [f"actuator.{name}" for name in actuators],
            "hydraulics": [f"hydraulics.{system + 1}" for system in range(systems)],
            "ccdl": [*links],
            "computer": [*computers],
            "bus": [f"bus.{bus + 1}" for bus in range(buses)],
        }
        self.index = {name: i for i, name in enumerate(chain(*self.names.values()))}
        self.wraps = [*signals.values()]

    def site(self, place: str) -> Site:
        """Return the sort of a place."""
        if place in self.names["discrete"]:
            return "discrete"
        if place in self.names["channel"]:
            return "channel"
        return _HEADS.get(place.partition(".")[0], "channel")

    def number(self, place: str) -> int:
        """Return the index of a place among those of its kind."""
        return self.index[place] - self.index[self.names[self.site(place)][0]]

    def require(self, name: str) -> str:
        """Return ``name`` if it is a place; raise ValueError with the allowed places otherwise."""
        if name in self.index:
            return name
        of = self.site(name)
        if of == "ccdl" and self.names[of]:
            raise ValueError(f"no such link between two lanes, {choices(name, self.names[of], _PAGE)}")
        if of in ("computer", "bus") and self.names[of]:
            what = "electrical bus" if of == "bus" else "computer"
            raise ValueError(f"no such {what}, {choices(name, self.names[of], _PAGE)}")
        if of in ("surface", *OF_SERVOS) and self.names[of]:
            what = "hydraulic system" if of == "hydraulics" else of
            raise ValueError(f"the aircraft has no such {what}, {choices(name, self.names[of])}")
        known = self.index if of == "channel" else self.names[of]
        raise ValueError(f"unknown signal, {choices(name, known, _PAGE)}")


FLIGHT: Final = Places(
    {signal.name: signal.wraps for signal in SIGNALS},
    DISCRETE_INDEX,
    INERTIAL,
    SURFACE_NAMES,
    MOVED,
    SYSTEMS,
    LINK_NAMES,
    COMPUTER_NAMES,
    BUSES,
)
site, number = FLIGHT.site, FLIGHT.number


def one_way_links(place: str) -> list[str]:
    """Return the links that a fault on ``place`` acts on: that link, or all that leave the node."""
    return [way for way in _WAYS if way == place or way.startswith(f"{place}-")]


def lanes_of(place: str) -> list[int]:
    """Return the lanes that a place of the lanes is about."""
    at, where = number(place), site(place)
    if where == "bus":
        return [*range(at, len(COMPUTERS), BUSES)]
    if where == "computer":
        return [at] if at < len(COMPUTERS) else [*range(len(COMPUTERS))]
    return [*LINKS[at]] if at < len(LINKS) else [at - len(LINKS)]


def senders(place: str) -> list[int]:
    """Return the lanes whose words a fault on a place of the lanes changes: of a link the one that sends."""
    return lanes_of(place)[:1] if site(place) == "ccdl" else lanes_of(place)


def needed_lanes(place: str) -> list[int]:
    """Return those of them that must be there: of a link both ends, of what several lanes share the first."""
    return lanes_of(place)[:1] if place in ("computer.all", *FLIGHT.names["bus"]) else lanes_of(place)


def places_of(info: ValidationInfo) -> Places:
    """Return the places that settings are read for: the context of the validation, or those of a flight."""
    return info.context or FLIGHT


def refuse_unknown(name: str, info: ValidationInfo) -> str:
    """Return ``name`` if it is a place; raise ValueError with the allowed places otherwise."""
    return places_of(info).require(name)
