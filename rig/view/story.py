"""The headline of a flight: survived or lost, which channel failed when, how long after the onset, by what.

Found from the events and the rows, block after block, so that a stream has it as soon as a log.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import groupby
from typing import Final, NamedTuple

from rig.frame import SIGNALS, Block, End
from rig.record.event import Event
from rig.view.facts import Facts
from rig.view.lanes import acting
from rig.view.style import plain

_FAILED: Final = re.compile(r"(\w+)\.(\d) failed by (\w+)")
_MOST_GROUPS: Final = 3  # of failures in a headline
_MARGIN_S: Final = (0.5, 1.0)  # of the zoom: before the fault, after the isolation
_UNSEEN_S: Final = 2.0  # of the zoom, after a fault that nobody isolated


class Failure(NamedTuple):
    """A channel that was failed; ``onset``: the first frame in which a fault acted on it, None: none has."""

    place: str
    channel: int
    frame: int
    by: str
    onset: int | None


class Story:
    """What a flight has come to so far."""

    def __init__(self, facts: Facts, rate_hz: float) -> None:
        self._facts = facts
        self._rate_hz = rate_hz
        self._onsets: list[int | None] = [None] * len(facts.faults)
        self.failures: list[Failure] = []
        self.end = End.FLYING
        self.last = 0  # frame

    def add(self, rows: Block, events: Sequence[Event]) -> bool:
        """Take in the next rows and their events; whether the headline may have changed."""
        acts = acting(rows, len(self._facts.faults))
        known = list(self._onsets)
        for i, onset in enumerate(self._onsets):
            if onset is None and acts[:, i].any():
                self._onsets[i] = int(rows["frame"][acts[:, i].argmax()])
        found = [self._failure(event, match) for event in events if (match := _FAILED.fullmatch(event.text))]
        self.failures += found
        self.end, self.last = End(rows["end"][-1]), int(rows["frame"][-1])
        return bool(found) or known != self._onsets or self.end != End.FLYING

    def _failure(self, event: Event, match: re.Match[str]) -> Failure:
        place, channel = match[1], int(match[2])
        onsets = [
            onset
            for fault, onset in zip(self._facts.faults, self._onsets, strict=True)
            if onset is not None and onset <= event.frame and fault.acts_on(place, channel)
        ]
        return Failure(place, channel, event.frame, match[3], min(onsets, default=None))

    def headline(self, outcome: str) -> str:
        """One line: the outcome and what failed, e.g. that of a single channel.

        SURVIVED: pitch rate, channel 3, failed at 20.07 s, 70 ms after the onset, by comparison
        """
        if self.end != End.FLYING:
            outcome = f"LOST at {self._seconds(self.last)}, {self.end.label}"
        return f"{outcome}: {self._failed()}"

    def _failed(self) -> str:
        if self.failures:
            groups = [list(group) for _, group in groupby(self.failures, lambda f: (f.frame, f.by))]
            more = len(groups) - _MOST_GROUPS
            told = [self._group(group) for group in groups[:_MOST_GROUPS]]
            return "; ".join([*told, *([f"and {more} times more"] if more > 0 else [])])
        acted = [
            fault.label for fault, onset in zip(self._facts.faults, self._onsets, strict=True) if onset is not None
        ]
        first = min((onset for onset in self._onsets if onset is not None), default=0)
        return f"no channel failed; {', '.join(acted)} from {self._seconds(first)}" if acted else "no channel failed"

    def _group(self, group: Sequence[Failure]) -> str:
        """Channels that were failed in one frame by the same."""
        frame, by = group[0].frame, group[0].by
        onsets = {failure.onset for failure in group}
        [onset] = onsets if len(onsets) == 1 else [None]
        after = f", {self._delay(frame - onset)} after the onset" if onset is not None else ""
        free = " with no fault on it" if onsets == {None} and self._facts.thresholds else ""
        return f"{_named(group)} failed at {self._seconds(frame)}{after}, by {by}{free}"

    def _seconds(self, frame: int) -> str:
        return f"{frame / self._rate_hz:.2f} s"

    def _delay(self, frames: int) -> str:
        seconds = frames / self._rate_hz
        return f"{seconds * 1000:.0f} ms" if seconds < 1 else f"{seconds:.2f} s"

    @property
    def decisive(self) -> tuple[str, float, float | None] | None:
        """The signal, onset and isolation (s; None: it was not isolated) of the first failure with a fault on it.

        Without one: of the first fault on a signal; None when no fault on a signal acted.
        """
        names = {signal.name for signal in SIGNALS}
        for failure in self.failures:
            if failure.onset is not None and failure.place in names:
                return failure.place, failure.onset / self._rate_hz, failure.frame / self._rate_hz
        for fault, onset in zip(self._facts.faults, self._onsets, strict=True):
            on = [place for place in fault.place.split("+") if place in names]
            if on and onset is not None:
                return on[0], onset / self._rate_hz, None
        return None


def _named(group: Sequence[Failure]) -> str:
    """Pitch rate, channel 3; or how many channels of which signals, when there are many."""
    places = {place: [f.channel for f in of_it] for place, of_it in groupby(group, lambda f: f.place)}
    if len(places) > _MOST_GROUPS:
        return f"{len(group)} channels of {len(places)} signals"
    return " and ".join(
        f"{plain(place)}, channel{'s' if len(which) > 1 else ''} {', '.join(map(str, which))},"
        for place, which in places.items()
    )


def zoom(onset_s: float, isolated_s: float | None, end_s: float) -> tuple[float, float]:
    """From half a second before the fault to one second after the isolation, within the flight, all in s."""
    before, after = _MARGIN_S
    last = onset_s + _UNSEEN_S if isolated_s is None else isolated_s + after
    return max(onset_s - before, 0.0), min(last, end_s)
