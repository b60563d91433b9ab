"""Keys in flight: faults that begin and end now, channels that are readmitted, a pause, the end.

A key acts in the frame that begins after it; what it did is a number of that frame, so that the log alone flies again:
``pressed`` (pressed_keys.py) makes an ordinary scenario of it.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Final

from rig.core.frame import CHANNELS, Nested
from rig.core.interrupt import Stop
from rig.flight.events import Event
from rig.flight.loop import Rig
from rig.flight.pace import Pace
from rig.scenario.pressed_keys import Pressed
from rig.scenario.scenario import Scenario
from rig.world.faults.scenario_faults import END, PAUSE, RESET

_ALL: Final = (1 << CHANNELS) - 1
_LOOK_S: Final = 0.02  # between two looks at the keys of a flight that is paused


class Keys:
    """The keys of one flight: ``press`` from any thread, ``before_row`` between two frames."""

    def __init__(self, scenario: Scenario, pace: Pace, stop: Stop) -> None:
        self._pace, self._stop = pace, stop
        self._by_key = {entry.key: entry.fault.label for entry in scenario.live}
        self._places = {fault.label: i for i, fault in enumerate(scenario.faults)}
        self.waiting: deque[str] = deque()
        self.pressed, self.events = Pressed(), deque[Event]()

    def press(self, key: str) -> None:
        """Have a key act in the next frame; one without a meaning does nothing."""
        if key in self._by_key or key in (RESET, PAUSE, END):
            self.waiting.append(key)

    def before_row(self, rig: Rig, block: Nested, k: int) -> None:
        """Act on the keys that were pressed before row k; the loop calls it."""
        if not self.waiting:
            return
        frame = int(block["frame"][k])
        while self.waiting:
            key = self.waiting.popleft()
            if key == PAUSE:
                self._pace.move(self._pause(frame))
            elif key == END:
                self._add_event(frame, key, "the flight ends")
                self._stop.requested = True
            elif key == RESET:
                block["bus"]["reset"][k] = block["bus"]["discrete_reset"][k] = _ALL
                self.pressed.resets.append(frame)
                self._add_event(frame, key, "all channels are commanded to be readmitted")
            else:
                self._fault(rig, key, frame)

    def _fault(self, rig: Rig, key: str, frame: int) -> None:
        """Begin the key's fault; pressed again end it, once for all."""
        label = self._by_key[key]
        moments = self.pressed.faults.setdefault(label, [])
        if len(moments) == 2 or (moments and moments[0] == frame):
            refused = "has already ended" if len(moments) == 2 else "began in this frame"
            self._add_event(frame, key, f"{label} {refused}")
            return
        moments.append(frame)
        begin_or_end = rig.faults.begin if len(moments) == 1 else rig.faults.end
        begin_or_end(self._places[label], frame)
        self._add_event(frame, key, f"{label} {'begins' if len(moments) == 1 else 'ends'}")

    def _pause(self, frame: int) -> float:
        """Wait for the same key, or for the end, by a key or Ctrl-C; return how long it took, s."""
        self._add_event(frame, PAUSE, "paused")
        began = time.perf_counter()
        while not self._stop.requested and not {PAUSE, END} & set(self.waiting):
            time.sleep(_LOOK_S)
        if PAUSE in self.waiting:
            self.waiting.remove(PAUSE)
        self._add_event(frame, PAUSE, "resumed")
        return time.perf_counter() - began

    def _add_event(self, frame: int, key: str, text: str) -> None:
        self.events.append(Event(frame, "info", "key", f"{key}: {text}"))

    def events_until(self, frame: int) -> list[Event]:
        """Take the events up to ``frame``; the frames may add others meanwhile."""
        due = list[Event]()
        while self.events and self.events[0].frame <= frame:
            due.append(self.events.popleft())
        return due
