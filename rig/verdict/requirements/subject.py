"""The subject of requirements: a flight or a recording, with its signals, thresholds, faults and limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from rig.core.frame import CHANNELS, DISCRETES, FLIGHT_INDEX, SIGNALS
from rig.core.text import choices, quoted
from rig.core.units.quantities import unit_of_name
from rig.scenario.scenario import Scenario
from rig.verdict.monitored_places import channels_of, settings_of
from rig.verdict.requirements.formula import CHANNEL_ERROR, OF_CHANNELS, OTHERS, YES_NO, Name, split, unknown_family
from rig.verdict.requirements.requirement import Requirement
from rig.world.faults.places import SURFACE_NAMES
from rig.world.plant.airframe import Limits

OF_RECORDINGS: Final = frozenset(("voted", "channel", "reference", "threshold", "level", "count", "failed"))
WITH_TRUTH: Final = frozenset((*OF_RECORDINGS, "truth", "error", CHANNEL_ERROR))
EVERYTHING: Final = frozenset((*WITH_TRUTH, "healthy", "surface", "flight", *OTHERS))

_SETTINGS: Final = ("fitted", "threshold", "persistence")  # of config.PARAMS
_SAMPLED: Final = ("channel", CHANNEL_ERROR)
_NOT_OF_DISCRETES: Final = ("reference", "error", "threshold", *_SAMPLED)


class Watched(NamedTuple):
    """One signal of a subject."""

    name: str
    unit: str
    wraps: bool
    channels: int
    threshold: float  # of four channels
    persistence: int  # frames


@dataclass(frozen=True, slots=True)
class Subject:
    """A flight or a recording."""

    rate_hz: float
    frames: int  # of a whole flight
    signals: tuple[Watched, ...]
    discretes: tuple[Watched, ...] = ()
    faults: tuple[tuple[tuple[str, int], ...], ...] = ()  # of each: the channels that it acts on, from 1
    limits: Limits | None = None
    offers: frozenset[str] = OF_RECORDINGS  # families of quantities
    called: str = "the recording"
    faulted: tuple[str, ...] = field(default=())  # signals with faults


class Quantity(NamedTuple):
    """A number or a yes or no of each frame."""

    name: str
    parts: Name
    unit: str
    signal: int = -1  # place among the signals, or
    discrete: int = -1  # among the discretes; -1: neither
    element: int = -1  # of the flight condition or the surfaces

    @property
    def measured(self) -> bool:
        """Return whether its unit is that of its signal."""
        return self.signal >= 0 and self.parts.family in (
            *("truth", "voted", "reference", "error", CHANNEL_ERROR, "threshold", "channel"),
        )


def of_flight(scenario: Scenario) -> Subject:
    """Return a flight as a subject."""
    params, of_discretes = settings_of(scenario)
    suite, settings = scenario.sensors, zip(*(params[name].tolist() for name in _SETTINGS), strict=True)
    signals = [Watched(s.name, s.unit, s.wraps, *each) for s, each in zip(SIGNALS, settings, strict=True)]
    discretes = [
        Watched(d.name, "", False, getattr(suite, d.name).channels, 1.0, persistence)
        for d, persistence in zip(DISCRETES, of_discretes["persistence"].tolist(), strict=True)
    ]
    faults = tuple(tuple(channels_of(fault)) for fault in scenario.faults)
    names = [watched.name for watched in signals]
    faulted = dict.fromkeys(name for on in faults for name, _ in on if name in names)
    return Subject(
        rate_hz=scenario.rate_hz,
        frames=scenario.frames,
        signals=tuple(signals),
        discretes=tuple(discretes),
        faults=faults,
        limits=scenario.airframe.limits,
        offers=EVERYTHING,
        called="the flight",
        faulted=tuple(faulted),
    )


def of_recording(signals: Sequence[Watched], discretes: Sequence[Watched], rate_hz: float, frames: int) -> Subject:
    """Return a recording as a subject: it has what was sampled and what was voted."""
    return Subject(rate_hz, frames, tuple(signals), tuple(discretes), faulted=tuple(each.name for each in signals))


def signals_of(requirement: Requirement, subject: Subject) -> list[str]:
    """Return the signals that a requirement names, or those with faults."""
    given = requirement.signals
    return [w.name for w in subject.signals] if given == "*" else list(subject.faulted if given is None else given)


def lookup(name: str, subject: Subject) -> Quantity | None:
    """Return a quantity of the subject by its name; None where it has none of that name."""
    parts = split(name)
    if parts is None or parts.family not in subject.offers:
        return None
    if parts.family == "flight":
        return Quantity(name, parts, unit_of_name(parts.of), element=FLIGHT_INDEX[parts.of])
    if parts.family == "surface":
        if parts.of not in SURFACE_NAMES:
            return None
        unit = "" if parts.of == "throttle" else "rad"
        return Quantity(name, parts, unit, element=SURFACE_NAMES.index(parts.of))
    if not parts.of:
        return Quantity(name, parts, "")
    return _of_signal(name, parts, subject)


def _of_signal(name: str, parts: Name, subject: Subject) -> Quantity | None:
    for field_name, listed in (("signal", subject.signals), ("discrete", subject.discretes)):
        place = next((i for i, watched in enumerate(listed) if watched.name == parts.of), None)
        if place is None:
            continue
        watched = listed[place]
        if field_name == "discrete" and parts.family in _NOT_OF_DISCRETES:
            return None
        most = watched.channels if parts.family in _SAMPLED else CHANNELS
        if parts.family in (*OF_CHANNELS, CHANNEL_ERROR) and not 1 <= parts.channel <= most:
            return None
        unit = "" if parts.family in ("level", "count", "failed", "healthy") else watched.unit
        made: dict[str, Any] = {field_name: place}
        return Quantity(name, parts, unit, **made)
    return None


def holds(name: str, subject: Subject) -> bool:
    """Return True if a name is a yes or no of the subject."""
    quantity = lookup(name, subject)
    if quantity is None:
        return False
    return quantity.parts.family in YES_NO or (quantity.discrete >= 0 and quantity.parts.family in ("truth", "voted"))


def unknown_of(name: str, subject: Subject) -> str:
    """Return the error text for a name that the subject does not have."""
    parts = split(name)
    if parts is None:
        return unknown_family(name)
    if parts.family not in subject.offers:
        return f"{quoted(name)}: {subject.called} has no {parts.family}; it has {', '.join(sorted(subject.offers))}"
    if parts.family == "surface":
        return f"unknown surface {quoted(parts.of)}, {choices(parts.of, SURFACE_NAMES)}"
    listed = {watched.name: watched for watched in (*subject.signals, *subject.discretes)}
    if parts.of in listed and parts.family in (*OF_CHANNELS, CHANNEL_ERROR):
        fitted = listed[parts.of].channels if parts.family in _SAMPLED else CHANNELS
        return f"{quoted(name)}: {parts.of} has channels 1 to {fitted}"
    if parts.of in listed:
        return f"{quoted(name)}: a discrete has no {parts.family}"
    accepted = [*listed, *(FLIGHT_INDEX if parts.family == "truth" and "flight" in subject.offers else ())]
    return f"{quoted(name)}: {subject.called} has no signal {quoted(parts.of)}, {choices(parts.of, accepted)}"
