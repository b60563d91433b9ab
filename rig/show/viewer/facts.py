"""Facts of a scenario that the viewer needs beside its frames: thresholds, names of faults, a title.

A stream takes them from the scenario in flight, a log from the recorded scenario.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite, nan
from typing import Any, Final, NamedTuple

from rig.core import fault_names
from rig.core.errors import BadLog
from rig.core.frame import INDEX, MOST_FAULTS, SIGNALS
from rig.log import scenario_of, unit_of
from rig.show.viewer.series import threshold

Span = tuple[float, float] | None  # seconds, or the ends of an axis


@dataclass(frozen=True, slots=True)
class FaultFact:
    """A fault of the scenario.

    place    : the signals that it acts on, joined by "+", or another place as the scenario names it
    channels : numbered from 1; empty if it acts on no channel or on all of them
    lanes    : from 0, computers with the fault, or with messages that it changes; each owns its channel
    start_s  : its begin; NaN if that depends on the flight
    """

    label: str
    place: str
    channels: tuple[int, ...] = ()
    start_s: float = nan
    lanes: tuple[int, ...] = ()

    @property
    def places(self) -> list[str]:
        """The places one by one."""
        return self.place.split("+")

    def acts_on(self, signal: str, channel: int) -> bool:
        """Return True if it acts on ``channel``, numbered from 1, of ``signal``, or on the computer that owns it."""
        on_place = signal in self.places and (not self.channels or channel in self.channels)
        return on_place or channel - 1 in self.lanes


@dataclass(frozen=True, slots=True)
class Seen:
    """Results of a whole flight, for which the layout is made; a stream has none.

    survived   : None if the flight has no end
    isolated_s : time of isolation of the decisive fault; None: not isolated
    zoom_s     : from half a second before the decisive fault to one second after the isolation; None: no active fault
    main       : the signal of that fault; empty: none
    coils_s    : as zoom_s, around the first servo channel that was shut off; None: none
    lanes_s    : as zoom_s, around the first computer or link that failed; None: none
    noted      : signals with a fault or a channel that was not ok, by their names
    ranges     : lowest and highest value of each drawn quantity, by name, in display units
    """

    survived: bool | None = None
    end_s: float = 0.0
    isolated_s: float | None = None
    zoom_s: Span = None
    coils_s: Span = None
    lanes_s: Span = None
    main: str = ""
    noted: tuple[str, ...] = ()
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Facts:
    """``thresholds`` in the unit of their signal, by name; a signal without an entry has no band."""

    title: str = ""
    thresholds: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[FaultFact, ...] = ()
    unit: str = ""  # under test, by its name; empty: the built-in manager
    paced: bool = False  # by the clock
    servos: bool = False  # move the surfaces
    computers: int = 1
    seen: Seen | None = None  # of a flight that is over

    def threshold(self, index: int) -> float:
        """Return the threshold of signal ``index``; NaN when the scenario has none."""
        return self.thresholds.get(SIGNALS[index].name, nan)

    def faults_on(self, signal: str) -> list[int]:
        """Return the faults on ``signal``, as numbers from 0."""
        return [i for i, fault in enumerate(self.faults) if signal in fault.places]

    @property
    def first_faulted(self) -> str | None:
        """The signal of the first fault that acts on a signal."""
        places = (place for fault in self.faults for place in fault.places)
        return next((place for place in places if place in INDEX), None)

    @property
    def first_start_s(self) -> float | None:
        """Return the earliest begin of a fault with a time in the scenario."""
        return min((fault.start_s for fault in self.faults if isfinite(fault.start_s)), default=None)


# For a log without a readable scenario: its faults have numbers as names.
UNKNOWN: Final = Facts(faults=tuple(FaultFact(f"fault {i + 1}", "") for i in range(MOST_FAULTS)))

TAGS: Final = "ABCD"  # letters of flights that are shown together, in their order


class Shown(NamedTuple):
    """One of the flights that are shown together.

    below : number of flights drawn over it; the viewer draws in the order of ``root``, the last on top
    """

    below: int = 0
    root: str = ""  # before its paths
    tag: str = ""  # its letter
    facts: Facts = UNKNOWN

    @property
    def prefix(self) -> str:
        """Prefix of a name in a legend or a strip."""
        return f"{self.tag} " if self.tag else ""


def together(facts: Sequence[Facts]) -> list[Shown]:
    """Return flights that are shown together as A, B, .., the last on top; a single one has no letter."""
    if len(facts) == 1:
        return [Shown(facts=facts[0])]
    return [Shown(len(facts) - 1 - i, f"/{TAGS[i]}", TAGS[i], each) for i, each in enumerate(facts)]


def drawn_range(shown: Sequence[Shown], name: str) -> Span:
    """Return the axis that holds the values of all ended flights by this name; None: there is none."""
    ranges = [seen.ranges[name] for flight in shown if (seen := flight.facts.seen) and name in seen.ranges]
    return (min(low for low, _ in ranges), max(high for _, high in ranges)) if ranges else None


class Layout(NamedTuple):
    """The layout with which the viewer opens; see blueprint.blueprint."""

    shown: Sequence[Shown] = (Shown(),)
    tab: str = "overview"
    map_tiles: bool = False


def of_resolved(scenario: Mapping[str, Any]) -> Facts:
    """Return the facts of a scenario as plain data, with its defaults; KeyError: one is missing."""
    computers = scenario.get("computers", {}).get("count", 1)
    return Facts(
        scenario.get("title") or scenario["aircraft"],
        {signal.name: threshold(scenario, signal.name) for signal in SIGNALS},
        tuple(_fault(fault, computers > 1) for fault in scenario["faults"]),
        servos=scenario.get("actuators", {}).get("model") == "servo",
        computers=computers,
    )


def _fault(fault: Mapping[str, Any], several: bool) -> FaultFact:
    """Return a fault of a scenario, with its lanes if there are ``several`` computers."""
    start, place = fault.get("start_s"), fault_names.place(fault)
    return FaultFact(
        fault_names.label(fault),
        place,
        tuple(fault.get("channels") or ()),
        float(start) if isinstance(start, (int, float)) else nan,
        _lanes(place) if several else (),
    )


def _lanes(place: str) -> tuple[int, ...]:
    from rig.world.faults.places import OF_LANES, senders, site  # whose kernels take half a second to be imported

    return tuple(senders(place)) if site(place) in OF_LANES else ()


def of_log(metadata: Mapping[str, str]) -> Facts:
    """Return the facts of the scenario in a log's metadata; UNKNOWN if it cannot be read.

    The scenario stays plain data: the import of its checks takes half a second, and it passed them before the flight.
    """
    try:
        return replace(of_resolved(scenario_of(metadata, "log")), unit=str(unit_of(metadata).get("name", "")))
    except (AttributeError, BadLog, KeyError, TypeError, ValueError, RecursionError):
        return UNKNOWN
