"""The story of a flight: its headline, its decisive seconds, and the ranges that its plots are made for.

The headline has the outcome, the channels that failed, the time after the onset, and the rule.  It is computed block
by block, so that a stream has it as early as a log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import Final, NamedTuple

import numpy as np

from rig.core.frame import CHANNELS, COMPUTERS, INDEX, SIGNALS, Block, End, State, Table
from rig.core.units.quantities import duration, seconds
from rig.flight.failures import Failure, decisive_s, failures
from rig.flight.lane_events import ComputerFinder, failed_by
from rig.flight.servo_events import ActuatorFinder
from rig.show.viewer import charts
from rig.show.viewer import lanes_view as computers
from rig.show.viewer import servo_series as servos
from rig.show.viewer.facts import Facts, Seen
from rig.show.viewer.series import limits, series
from rig.show.viewer.state_strips import acting
from rig.show.viewer.style import plain

ACTUATOR, COMPUTER, LINK = "actuator.", "computer.", "ccdl."  # before a surface, a lane, as places of faults
SILENCE: Final = "message timeout"
_MOST_GROUPS: Final = 3  # of failures in a headline


class Isolation(NamedTuple):
    """A failure, and the first frame in which a fault acted on the channel; None: no fault."""

    failure: Failure
    onset: int | None


class Decisive(NamedTuple):
    """The fault that decided a flight: its signal, onset and isolation in s; None: it was not isolated."""

    signal: str
    onset_s: float
    isolated_s: float | None


class Story:
    """A flight so far: active faults, failed channels, end."""

    def __init__(self, facts: Facts, rate_hz: float) -> None:
        self._facts = facts
        self._rate_hz = rate_hz
        self._onsets: list[int | None] = [None] * len(facts.faults)
        self._before: Block | None = None
        self._servos, self._computers = ActuatorFinder(), ComputerFinder(rate_hz)
        self.isolations: list[Isolation] = []
        self.end = End.FLYING
        self.last = 0  # frame

    def add(self, table: Table) -> bool:
        """Take in the next frames; return True if the headline may have changed.

        A stream shows the headline of the flight so far, so rows arrive block by block.
        """
        rows = table.rows
        acts = acting(rows, len(self._facts.faults))
        onsets_before = list(self._onsets)
        for i, onset in enumerate(self._onsets):
            if onset is None and acts[:, i].any():
                self._onsets[i] = int(rows["frame"][acts[:, i].argmax()])
        new_failures = failures(rows, self._before)
        new_failures += [*self._coils(table), *self._lanes(table)]
        new = [
            Isolation(failure, self._onset(failure)) for failure in sorted(new_failures, key=lambda each: each.frame)
        ]
        self.isolations += new
        self._before = rows[-1:].copy()
        self.end, self.last = End(rows["end"][-1]), int(rows["frame"][-1])
        return bool(new) or onsets_before != self._onsets or self.end != End.FLYING

    def _coils(self, table: Table) -> list[Failure]:
        """Return the channels of servos that are shut off in these frames."""
        before = {surface: set(channels) for surface, channels in self._servos.failed.items()}
        self._servos.find(table)
        return [
            Failure(frame, f"{ACTUATOR}{surface}", channel, monitor)
            for surface, channels in self._servos.failed.items()
            for channel, (frame, monitor) in channels.items()
            if channel not in before.get(surface, ())
        ]

    def _lanes(self, table: Table) -> list[Failure]:
        """Return the computers, and the links by their receivers, that fail in these frames."""
        of, failed, silent = self._computers, len(self._computers.failures), len(self._computers.links)
        of.find(table)
        return [
            *(
                Failure(
                    failure.frame,
                    COMPUTER + COMPUTERS[failure.lane],
                    failure.lane + 1,
                    failed_by(failure).removeprefix("by "),
                )
                for failure in of.failures[failed:]
            ),
            *(
                Failure(link.frame, LINK + COMPUTERS[link.sender], link.receiver + 1, SILENCE)
                for link in of.links[silent:]
            ),
        ]

    def _onset(self, failure: Failure) -> int | None:
        """Return the onset of the first fault that has acted on a failed channel."""
        place, channel = failure.place, failure.channel
        if place.startswith(LINK):  # its faults are those of the lane that sends
            channel = COMPUTERS.index(place.removeprefix(LINK)) + 1
        onsets = [
            onset
            for fault, onset in zip(self._facts.faults, self._onsets, strict=True)
            if onset is not None and onset <= failure.frame and fault.acts_on(place, channel)
        ]
        return min(onsets, default=None)

    def headline(self, outcome: str) -> str:
        """Return one line: the outcome and the failures.

        SURVIVED: pitch rate, channel 3, isolated at 20.07 s, 70 ms after onset, by comparison
        LOST at 10.60 s: angle of attack beyond its limit; no channel isolated
        """
        if self.end != End.FLYING:
            outcome = f"LOST at {seconds(self.last, self._rate_hz)}: {self.end.cause}"
            return f"{outcome}; {self._failed() if self.isolations else self._acted()}"
        return f"{outcome}: {self._failed() if self.isolations else self._acted()}"

    def _failed(self) -> str:
        """Return the failures, those of one frame and rule together."""
        grouped = groupby(self.isolations, lambda each: (each.failure.frame, each.failure.decided_by))
        groups = [list(group) for _, group in grouped]
        more = len(groups) - _MOST_GROUPS
        texts = [self._group(group) for group in groups[:_MOST_GROUPS]]
        return "; ".join([*texts, *([f"and {more} more"] if more > 0 else [])])

    def _acted(self) -> str:
        """Return the faults that acted in a flight without a failure."""
        onsets = [onset for onset in self._onsets if onset is not None]
        if not onsets:
            return "no channel isolated"
        pairs = zip(self._facts.faults, self._onsets, strict=True)
        labels = ", ".join(fault.label for fault, onset in pairs if onset is not None)
        return f"no channel isolated; {labels} from {seconds(min(onsets), self._rate_hz)}"

    def _group(self, group: Sequence[Isolation]) -> str:
        """Return the text of failures in one frame by one rule."""
        frame, by = group[0].failure.frame, group[0].failure.decided_by
        onsets = {isolation.onset for isolation in group}
        [onset] = onsets if len(onsets) == 1 else [None]
        after = f", {duration(frame - onset, self._rate_hz)} after onset" if onset is not None else ""
        free = ", without a fault on it" if onsets == {None} and self._facts.thresholds else ""
        return f"{_named(group)} {_verb(group)} {seconds(frame, self._rate_hz)}{after}, by {by}{free}"

    @property
    def decisive(self) -> Decisive | None:
        """The first failure with a fault on it; without one, the first fault on a signal; None: none acted."""
        for failure, onset in self.isolations:
            if onset is not None and failure.place in INDEX:
                return Decisive(failure.place, onset / self._rate_hz, failure.frame / self._rate_hz)
        for fault, onset in zip(self._facts.faults, self._onsets, strict=True):
            signals = [place for place in fault.places if place in INDEX]
            if signals and onset is not None:
                return Decisive(signals[0], onset / self._rate_hz, None)
        return None

    def first_s(self, *places: str) -> tuple[float, float] | None:
        """Return onset (if it has no fault: failure) and failure of the first item that failed; None: no failure.

        places : beginnings of the names of the items
        """
        for failure, onset in self.isolations:
            if failure.place.startswith(places):
                return (failure.frame if onset is None else onset) / self._rate_hz, failure.frame / self._rate_hz
        return None


def _named(group: Sequence[Isolation]) -> str:
    """Return ``pitch rate, channel 3,``; or the numbers of channels and signals, if there are many."""
    by_place = groupby((isolation.failure for isolation in group), lambda failure: failure.place)
    places = {place: [failure.channel for failure in of_place] for place, of_place in by_place}
    if len(places) > _MOST_GROUPS and INDEX.keys() & places:
        return f"{len(group)} channels of {len(places)} signals"
    return " and ".join(_text(place, channels) for place, channels in places.items())


def _verb(group: Sequence[Isolation]) -> str:
    """Return the verb of a group of failures of one place."""
    place = group[0].failure.place
    if place.startswith((COMPUTER, LINK)):
        return "failed at"
    return "shut off at" if place.startswith(ACTUATOR) else "isolated at"


def _text(place: str, channels: Sequence[int]) -> str:
    """Return the text of a failure: channels, a computer, or a link by its receivers."""
    if place.startswith(COMPUTER):
        return f"computer {place.removeprefix(COMPUTER)}"
    if place.startswith(LINK):
        return f"link {place.removeprefix(LINK)} to {', '.join(COMPUTERS[channel - 1] for channel in channels)}"
    return f"{plain(place)}, channel{'s' if len(channels) > 1 else ''} {', '.join(map(str, channels))},"


def look(facts: Facts, table: Table, rate_hz: float, ended: bool) -> tuple[Facts, str]:
    """Return ``facts`` with the results of a whole flight, and its headline; ended : the loop has finished."""
    story, rows = Story(facts, rate_hz), table.rows
    story.add(table)
    lost = story.end != End.FLYING
    ranges = charts.ranges(rows) | {signal.name: signal_range(facts, rows, i) for i, signal in enumerate(SIGNALS)}
    end_s, decisive = story.last / rate_hz, story.decisive
    survived = not lost if ended or lost else None
    seen = Seen(survived, end_s, noted=_noted(facts, rows), ranges=ranges)
    if (coils := story.first_s(ACTUATOR)) is not None:
        seen = replace(seen, isolated_s=coils[1], coils_s=decisive_s(*coils, end_s))
    if (lanes := story.first_s(COMPUTER, LINK)) is not None:
        seen = replace(seen, isolated_s=lanes[1], lanes_s=decisive_s(*lanes, end_s))
    for of, span_s in ((servos, seen.coils_s), (computers, seen.lanes_s)):
        if of.SHOWN.part in table.parts:
            first, last = (round(s * rate_hz) for s in span_s or (0.0, end_s))
            ranges |= of.ranges(table, slice(first, last + 1))
    if decisive is not None:
        span_s = decisive_s(decisive.onset_s, decisive.isolated_s, end_s)
        first, last = (int(np.searchsorted(rows["frame"], s * rate_hz)) for s in span_s)
        ranges["zoom"] = signal_range(facts, rows, INDEX[decisive.signal], slice(first, last + 1))
        seen = replace(seen, isolated_s=decisive.isolated_s, zoom_s=span_s, main=decisive.signal)
    return replace(facts, seen=seen), story.headline("SURVIVED" if ended else "NOT FINISHED")


def signal_range(facts: Facts, rows: Block, index: int, part: slice = slice(None)) -> tuple[float, float]:
    """Return the axis of a plot of signal ``index``, in display units, by the rule of ``series.limits``.

    Without a threshold, the axis holds all channels.
    """
    whole, threshold = series(rows, 1.0, SIGNALS[index].name), facts.threshold(index)
    shown = whole._replace(**{name: getattr(whole, name)[part] for name in ("channels", "used", "voted", "truth")})
    if np.isfinite(threshold):
        return limits(shown, threshold)
    return charts.spanned(np.concatenate([shown.truth, shown.voted, *shown.channels.T]), 2e-3)


def _noted(facts: Facts, rows: Block) -> tuple[str, ...]:
    """Return the signals with a fault on them or a channel that was not ok."""
    states = rows["state"][:, :, :CHANNELS]
    not_ok = ((states == State.SUSPECT) | (states == State.FAILED)).any(axis=(0, 2))
    return tuple(signal.name for i, signal in enumerate(SIGNALS) if not_ok[i] or facts.faults_on(signal.name))
