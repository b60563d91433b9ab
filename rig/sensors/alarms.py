"""False alarms of in-line monitors, drawn a block at a time: memoryless, each of a given length."""

from __future__ import annotations

from math import exp
from typing import Final

import numpy as np
from numpy.random import Generator, SeedSequence

from rig.frame import CHANNELS, SIGNALS, S, to_frame
from rig.settings import Settings

_NEVER: Final = int(np.iinfo(np.int64).max)


class Alarms:
    """``rows`` (n, S, 4): whether the monitor of each channel raises a false alarm, each from a stream of its own."""

    def __init__(self, suite: Settings, rate_hz: float, seeds: SeedSequence) -> None:
        self._channels: list[_Channel] = []
        for s, (signal, child) in enumerate(zip(SIGNALS, seeds.spawn(S), strict=True)):
            monitor = getattr(suite, signal.name).monitor
            if monitor is not None and monitor.false_alarm_per_hour > 0:
                chance = 1.0 - exp(-monitor.false_alarm_per_hour / (3600.0 * rate_hz))
                length = max(1, to_frame(monitor.false_alarm_s, rate_hz))
                streams = map(np.random.default_rng, child.spawn(CHANNELS))
                self._channels += [_Channel(s, c, chance, length, rng) for c, rng in enumerate(streams)]
        self.rows = np.zeros((0, S, CHANNELS), np.uint8)
        self._frame = 0
        self._next = min((channel.begin for channel in self._channels), default=_NEVER)
        self._dirty = False

    def prepare(self, frames: int) -> None:
        """The next ``frames`` rows; what is drawn does not depend on the length of the blocks."""
        if len(self.rows) < frames and self._channels:
            self.rows, self._dirty = np.zeros((frames, S, CHANNELS), np.uint8), False
        if self._dirty:
            self.rows[:] = 0
        first, self._frame = self._frame, self._frame + frames
        self._dirty = self._next < self._frame
        if self._dirty:
            for channel in self._channels:
                channel.mark(self.rows, first, self._frame)
            self._next = min(channel.begin for channel in self._channels)


class _Channel:
    """When the monitor of channel c of signal s raises its next false alarm."""

    def __init__(self, s: int, c: int, chance: float, length: int, rng: Generator) -> None:
        self._place, self._chance, self._length, self._rng = (s, c), chance, length, rng
        self.begin = int(rng.geometric(chance)) - 1

    def mark(self, rows: np.ndarray, first: int, last: int) -> None:
        """Write the alarms of the frames from ``first`` to before ``last``."""
        while self.begin < last:
            end = self.begin + self._length
            rows[(slice(max(self.begin - first, 0), min(end, last) - first), *self._place)] = 1
            if end > last:
                return
            self.begin = end + int(self._rng.geometric(self._chance)) - 1
