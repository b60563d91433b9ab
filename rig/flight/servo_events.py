"""Events of the servo actuators of a flight: which monitor isolated which channel, and when."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rig.core.event import Event
from rig.core.frame import MOVED, ActuatorMonitor, Table, new_block, second_rows

FAILED, VALVE, BYPASSED = "actuator channel failed", "shut-off valve", "surface lost"  # names of events
CoilsFailed = dict[str, dict[int, tuple[int, str]]]  # by surface and channel from 1: frame and monitor


def monitor_name(monitor: int) -> str:
    """Return the name of the monitor that isolated a channel."""
    return ActuatorMonitor(monitor).name.lower()


class ActuatorFinder:
    """Finds the events of a flight's servos, block after block."""

    def __init__(self) -> None:
        self.failed: CoilsFailed = {}
        self._last = Table(new_block(1), second_rows(1))

    def find(self, table: Table) -> list[Event]:
        """Return the events of frames, which follow those of the last call, in order of time."""
        if table.servo is None:
            return []
        before, self._last = self._last, table[-1:].copy()
        found = [*self._failures(before, table), *_valves(before, table), *_bypassed(before, table)]
        return sorted(found, key=lambda event: event.frame)

    def failed_at(self, rate_hz: float) -> dict[str, dict[int, tuple[float, str]]]:
        """Return the isolated channels, by surface and channel from 1: time [s] and monitor."""
        return {
            surface: {channel: (frame / rate_hz, monitor) for channel, (frame, monitor) in channels.items()}
            for surface, channels in self.failed.items()
        }

    def _failures(self, before: Table, table: Table) -> Iterator[Event]:
        for k, i, c in _news(before, table, "failed_by"):
            frame, monitor = int(table["frame"][k]), monitor_name(table.servo["failed_by"][k, i, c])
            self.failed.setdefault(MOVED[i], {})[c + 1] = frame, monitor
            yield Event(frame, "error", FAILED, f"{MOVED[i]}.{c + 1} isolated by {monitor}")


def _valves(before: Table, table: Table) -> Iterator[Event]:
    for k, i, c in _news(before, table, "valve_differs"):
        if table.servo["valve_differs"][k, i, c]:
            yield Event(int(table["frame"][k]), "warning", VALVE, f"{MOVED[i]}.{c + 1}: not in the commanded position")


def _bypassed(before: Table, table: Table) -> Iterator[Event]:
    for k, i in _news(before, table, "bypassed"):
        if table.servo["bypassed"][k, i]:
            yield Event(int(table["frame"][k]), "error", BYPASSED, f"{MOVED[i]}: no channel or no pressure moves it")


def _news(before: Table, table: Table, field: str) -> list[tuple[int, ...]]:
    """Return the places in ``field`` of ``table`` where it is not what it was a row before."""
    values = np.concatenate([before.servo[field], table.servo[field]])
    return [tuple(map(int, place)) for place in np.argwhere(values[1:] != values[:-1])]
