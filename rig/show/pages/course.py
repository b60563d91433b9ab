"""The course of a flight: the states of channels and computers, active faults, and the frames that a report shows."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import manager_kind
from rig.core.frame import INDEX, SIGNALS, Pattern, Source, State, Table
from rig.core.units.quantities import quantity
from rig.flight.failures import became_failed, decisive_s
from rig.scenario.scenario import Scenario
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer.series import threshold
from rig.show.viewer.state_strips import Changes, changed, changes
from rig.verdict.monitored_places import references_of
from rig.verdict.of_log import Scored
from rig.verdict.score_records import FaultScore

# Fields of FLAT that the pictures show.
FIELDS: Final = (
    *(
        "frame",
        "acting",
        "truth",
        "channels",
        "voted",
        "reference",
        "state",
        "level",
        "pattern",
        "decided_by",
        "source",
    ),
    *("discrete_state", "law", "surface", "surface_command", "flight"),
)
ISOLATION: Final = "isolation threshold"
LATEST_S: Final = 30.0  # a later isolation does not belong to the first frame
TOGETHER_S: Final = 2.0  # a fault that begins within this time before a split is shown with it
_LEVELS = {0: "no channel", 1: "1 channel", 2: "2 channels", 3: "3 channels", 4: "4 channels"}


def level_path(name: str) -> str:
    """Return the path of a signal's level."""
    return f"/{name}/level"


class Course:
    """States and events of ``flight`` over time; faults : their number in the scenario."""

    def __init__(self, flight: Table, faults: int) -> None:
        self.flight, self.frames, self._faults = flight, len(flight), range(faults)
        self.acting: NDArray[np.uint8] = flight["acting"]  # (n, bytes) a bit a fault that acts
        self._failed = became_failed(flight["state"])

    @cached_property
    def odd(self) -> dict[str, int]:
        """The first frame with an event, by signal."""
        rows = self.flight
        doubted = np.isin(rows["state"], (State.SUSPECT, State.FAILED)).any(axis=2)
        odd = doubted | (rows["pattern"] != Pattern.NORMAL) | (rows["source"] != Source.VOTED)
        return {name: int(odd[:, s].argmax()) for name, s in INDEX.items() if odd[:, s].any()}

    def failed(self, name: str) -> list[int]:
        """Return the frames in which a channel of a signal became failed."""
        return self._failed[self._failed[:, 1] == INDEX[name], 0].tolist()

    def suspected(self, name: str, frame: int) -> int:
        """Return the first suspect frame of the channel of a signal that became failed in ``frame``."""
        first = frame
        for c in range(SIGNALS[INDEX[name]].channels):
            _, rows, states = self.strips[f"/{name}/channel_{c + 1}"]
            k = int(np.searchsorted(rows, frame))
            if 0 < k < len(rows) and rows[k] == frame and states[k - 1 : k + 1] == ["SUSPECT", "FAILED"]:
                first = min(first, int(rows[k - 1]))
        return first

    @cached_property
    def strips(self) -> dict[str, Changes]:
        """The changes of each state of signals, computers and servos, and of the levels."""
        flight = self.flight
        found = list(changes(flight.rows, None, self._faults))
        for s, signal in enumerate(SIGNALS):
            found += changed(level_path(signal.name), _LEVELS, flight["level"][:, s], None)
        for shown in (computers.SHOWN, servos.SHOWN):
            found += shown.changes(flight, None) if shown.part in flight.parts else ()
        return {change.path: change for change in found}


class Limit(NamedTuple):
    """The largest difference from the voted value that is no miscompare: its name, and its ``value`` in SI."""

    signal: str
    name: str
    value: float

    @property
    def isolates(self) -> bool:
        """True if a channel beyond it is isolated."""
        return self.name == ISOLATION

    @property
    def text(self) -> str:
        """Name and figure: ``isolation threshold 0.63 deg/s``."""
        return f"{self.name} {self.figure}"

    @property
    def figure(self) -> str:
        """Its value in display units: ``0.63 deg/s``."""
        return quantity(self.value, SIGNALS[INDEX[self.signal]].unit)


def limit(resolved: Mapping[str, Any], signal: str) -> Limit:
    """Return the limit of a signal: of its monitor, or of its voted value if the manager has no threshold."""
    monitored = manager_kind(resolved["redundancy"]["manager"]).has_threshold
    return Limit(signal, ISOLATION if monitored else "error limit", threshold(resolved, signal))


class Moment(NamedTuple):
    """The frames of a signal in which it was decided; frames from 0."""

    signal: str
    first: int  # the error exceeds the threshold, the fault or the split begins, or a channel becomes suspect
    isolated: int | None  # the first channel, or the reference, is isolated
    begin: int  # first frame shown
    end: int  # first frame not shown


def affected(scored: Scored, course: Course) -> list[str]:
    """Return the signals with a fault, a suspect or failed channel, a pattern or another source, in order of time."""
    first = dict(course.odd)
    for fault in scored.score.faults:
        for name in signals_of(fault, scored.scenario):
            if fault.onset_frame is not None:
                first[name] = min(first.get(name, course.frames), fault.onset_frame)
    return sorted(first, key=lambda name: (first[name], INDEX[name]))


def signals_of(fault: FaultScore, scenario: Scenario) -> list[str]:
    """Return the signals on which, or on whose reference, a scored fault acts."""
    if fault.signal in INDEX:
        return [fault.signal]
    return [SIGNALS[s].name for s in references_of(scenario.faults[fault.index], scenario.redundancy)]


def moment(scored: Scored, course: Course, name: str) -> Moment | None:
    """Return the moment of a signal: its first split, or its first fault; None: neither exists."""
    rate_hz = scored.scenario.rate_hz
    faults = [fault for fault in scored.score.faults if name in signals_of(fault, scored.scenario)]
    begins = [fault.onset_frame if fault.exceeded_frame is None else fault.exceeded_frame for fault in faults]
    known = [frame for frame in begins if frame is not None]
    patterns = [episode.first_frame for episode in scored.score.episodes if episode.signal == name]
    failures = course.failed(name)
    if patterns:
        known = [frame for frame in known if 0 <= patterns[0] - frame <= TOGETHER_S * rate_hz] + patterns[:1]
    if not known and not failures:
        return None
    first = min(known) if known else course.suspected(name, min(failures))  # no fault on it: its computer has failed
    ends = [*failures, *(fault.failed_frame for fault in faults if fault.failed_frame is not None)]
    isolated = min((frame for frame in ends if first <= frame <= first + LATEST_S * rate_hz), default=None)
    return Moment(name, first, isolated, *decisive_frames(first, isolated, course.frames, rate_hz))


def decisive_frames(first: int, decided: int | None, frames: int, rate_hz: float) -> tuple[int, int]:
    """Return the decisive frames around ``first`` and ``decided``, end excluded; frames : length of the flight."""
    decided_s = None if decided is None else decided / rate_hz
    begin_s, end_s = decisive_s(first / rate_hz, decided_s, (frames - 1) / rate_hz)
    return round(begin_s * rate_hz), round(end_s * rate_hz) + 1
