"""Recorded signals and discretes of any name in the places of the flight's frame, and faults spoken of there."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInput
from rig.faults import Fault, check
from rig.faults.effects import Act
from rig.faults.places import PLACES
from rig.frame import DISCRETE_INDEX, INDEX, SIGNALS, S, Signal
from rig.recordings.injection_file import Fitted, Table, number
from rig.recordings.recording import Recording
from rig.recordings.settings import ANY_NUMBER, RecordedSignal
from rig.settings import LONGEST_S, Settings, build
from rig.util import fault_names

_ON_PLACES = {"pitot_icing": ("static_pressure", "dynamic_pressure"), "vane_icing": tuple(INDEX)}


class _Faults(Settings):
    faults: list[Fault]


@dataclass(frozen=True, slots=True)
class Slots:
    """The place in the frame of each recorded signal and discrete that a fault concerns, by name of ours."""

    signals: dict[str, str]  # recorded name: the flight's
    discretes: dict[str, str]

    def recorded(self, place: str) -> str:
        """Return the recorded name of a place of the frame."""
        return next(name for name, taken in {**self.signals, **self.discretes}.items() if taken == place)

    def descriptors(self, settings: Mapping[str, RecordedSignal]) -> list[Signal]:
        """Return the frame's signals (S,) with the names of the recorded ones and whether those wrap."""
        found = list(SIGNALS)
        for name, place in self.signals.items():
            found[INDEX[place]] = replace(found[INDEX[place]], name=name, wraps=settings[name].wraps)
        return found

    def ranges(self, settings: Mapping[str, RecordedSignal]) -> NDArray[np.float64]:
        """Lowest and highest value of each place but the discretes, as ``faults.Faults`` takes them."""
        found = np.zeros((len(PLACES) - len(DISCRETE_INDEX), 2))
        for name, place in self.signals.items():
            found[INDEX[place]] = settings[name].limits
        return found

    def thresholds(self, settings: Mapping[str, RecordedSignal]) -> NDArray[np.float64]:
        """(S,) thresholds, for magnitudes that are given in them."""
        found = np.full(S, np.nan)
        for name, place in self.signals.items():
            found[INDEX[place]] = settings[name].threshold
        return found


def slots(faults: Sequence[Table], fitted: Fitted, source: str) -> Slots:
    """Places for what ``faults`` name, for names of the flight their own; BadInput: too many."""
    named = [str(fault[key]) for fault in faults for key in ("signal", "source") if key in fault]
    named += [n for fault in faults for n in _ON_PLACES.get(str(fault.get("kind")), ()) if n in fitted.signals]
    signals = _placed((name for name in named if name in fitted.signals), INDEX, "signals", source)
    discretes = _placed((name for name in named if name in fitted.discretes), DISCRETE_INDEX, "discretes", source)
    return Slots(signals, discretes)


def _placed(names: Iterable[str], places: Mapping[str, int], what: str, source: str) -> dict[str, str]:
    wanted = list(dict.fromkeys(names))
    free = [place for place in places if place not in wanted]
    if len(wanted) > len(places):
        raise BadInput(f"{source}: faults on {len(wanted)} {what}; at most {len(places)} in one file")
    return {name: name if name in places else free.pop(0) for name in wanted}


def translated(
    faults: Sequence[Table],
    at: Slots,
    fitted: Fitted,
    settings: Mapping[str, RecordedSignal],
    recording: Recording,
    source: str,
) -> list[Fault]:
    """Return the faults as those of a flight, with ids in recorded names; BadInput, one line, names ``source``."""
    places = {**at.signals, **at.discretes}
    tables = [_moved(fault, places, float(recording.time_s[0])) for fault in faults]
    counts = {place: {**fitted.discretes, **fitted.signals}[name] for name, place in places.items()}
    try:
        found = build(_Faults, {"faults": tables}, source).faults
        for i, fault in enumerate(found):
            _check_range(i, fault, at, settings, source)
        found = _named(found, faults)
        check(found, counts)
    except BadInput as error:
        raise BadInput(_in_recorded_names(str(error), places)) from None
    except ValueError as error:
        raise BadInput(f"{source}: {_in_recorded_names(str(error), places)}") from None
    return found


def _moved(fault: Table, places: Mapping[str, str], first_s: float) -> dict[str, Any]:
    """Return the table with places of the frame, and times since the first row (which the rows then replace)."""
    moved: dict[str, Any] = {
        key: places.get(str(fault[key]), fault[key]) for key in ("signal", "source") if key in fault
    }
    for key in ("start_s", "end_s"):
        if (given := number(fault, key)) is not None:
            moved[key] = min(max(given - first_s, 0.0), LONGEST_S)
    return {**fault, **moved}


def _check_range(i: int, fault: Fault, at: Slots, settings: Mapping[str, RecordedSignal], source: str) -> None:
    for point in fault.points:
        if fault.effect.act == Act.RANGE_END and point.place in INDEX:
            name = at.recorded(point.place)
            if settings[name].limits == ANY_NUMBER:
                raise BadInput(f"{source}: faults.{i}: {name} has no range in CONFIG whose end it could be at")


def _named(found: Sequence[Fault], tables: Sequence[Table]) -> list[Fault]:
    """With the name of each as its id, so that what it draws does not depend on its place in the frame."""
    labels: dict[str, int] = {}
    named: list[Fault] = []
    for fault, table in zip(found, tables, strict=True):
        label = fault_names.label({**dict(fault), **{key: table[key] for key in ("signal",) if key in table}})
        labels[label] = count = labels.get(label, 0) + 1
        own = fault.id is not None or count == 1
        named.append(fault.model_copy(update={"id": label if own else f"{label} ({count})"}))
    return named


def _in_recorded_names(message: str, places: Mapping[str, str]) -> str:
    for name, place in places.items():
        message = re.sub(rf"\b{place}\b", lambda _, name=name: name, message)
    return message
