"""Status, fault word and output discretes of a unit, as events and in the flight's result."""

from __future__ import annotations

from typing import Any, Final

from rig.core.event import Event, Severity
from rig.unit.port import CHANGES, MOST_CHANGES, STARTING, Inbound
from rig.unit.unit_records import Status

_SEVERITY: Final[dict[str, Severity]] = {"failed": "error", "degraded": "warning"}
_NAMES: Final = {status.value: status.name.lower().replace("_", "-") for status in Status}
_READY: Final = (0, 0, 0)


class News:
    """Changes that compiled code has stored in a port (port.note_status); each is reported once."""

    def __init__(self, back: Inbound) -> None:
        self._back, self._told = back, 0

    def until(self, frame: int) -> list[Event]:
        """Return the new events of changes up to ``frame``."""
        events: list[Event] = []
        while self._told < self._kept and self._back.changes[self._told, 0] <= frame:
            events += self._events(self._told)
            self._told += 1
        return events

    @property
    def _kept(self) -> int:
        return min(int(self._back.counts[CHANGES]), MOST_CHANGES)

    def _at(self, n: int) -> tuple[int, int, int]:
        """Return status, fault word and outputs after the change n, from 0; before the first it was ready."""
        status, word, outputs = self._back.changes[n, 1:].tolist() if n >= 0 else _READY
        return status, word, outputs

    def _events(self, n: int) -> list[Event]:
        frame, events = int(self._back.changes[n, 0]), []
        (old_status, old_word, old_outputs), (status, word, outputs) = self._at(n - 1), self._at(n)
        if status != old_status:
            name = _name(status)
            text = name if n == 0 else f"{_name(old_status)} to {name}"
            events.append(Event(frame, _SEVERITY.get(name, "info"), "unit status", text))
        if word != old_word:
            events.append(
                Event(frame, "warning" if word else "info", "unit fault word", f"{old_word:#010x} to {word:#010x}")
            )
        if outputs != old_outputs:
            events.append(Event(frame, "info", "unit outputs", f"{_outputs(old_outputs)} to {_outputs(outputs)}"))
        return events

    def still_starting(self, start_s: float) -> str:
        """Return the reason why the rig stops waiting for a unit in power-up or self-test; "" in other states."""
        starting, last = self._back.counts[STARTING] > 0, self._at(self._kept - 1)
        return f"is in {_name(last[0])} after start_s = {start_s:g} s" if starting else ""

    def result(self) -> dict[str, Any]:
        """Return the last status, fault word and outputs, and the number of changes."""
        status, word, outputs = self._at(self._kept - 1)
        of_itself = {"status": _name(status), "fault_word": word, "output_discretes": _bytes(outputs)}
        return {**of_itself, "status_changes": int(self._back.counts[CHANGES])}


def _name(status: int) -> str:
    return _NAMES.get(status, f"status {status}")


def _bytes(outputs: int) -> list[int]:
    return list((outputs & (1 << 64) - 1).to_bytes(8, "little"))


def _outputs(outputs: int) -> str:
    return " ".join(map(str, _bytes(outputs)))
