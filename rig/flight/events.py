"""Events of a flight, found by comparing neighbouring rows of a block."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.event import Event, Severity
from rig.core.frame import (
    CHANNELS,
    DISCRETES,
    FLAT,
    SIGNALS,
    Block,
    End,
    Law,
    Pattern,
    SensorFault,
    Source,
    State,
    Trust,
    UnitStatus,
    copied,
    new_block,
    offset,
)
from rig.core.kernels import kernel
from rig.flight.failures import COMPARISON, who_failed

_LEVELS: Final = {"level": "state", "discrete_level": "discrete_state"}  # with the states that they are counted from
MISSED: Final = "unit missed"  # an event's name
NOT_EXECUTED: Final = "fault not executed"  # another


def not_executed(frame: int, missing: Sequence[tuple[str, str]]) -> list[Event]:
    """Return the events of faults that did nothing, at the end of a flight: ``missing``, names and reasons."""
    return [Event(frame, "warning", NOT_EXECUTED, f"{name}: {reason}") for name, reason in missing]


class EventFinder:
    """Finds the events of a flight, block after block; ``faults`` are the labels of its faults, in their order."""

    def __init__(self, faults: Sequence[str]) -> None:
        self._faults = faults
        self._last: Block | None = None
        self._missed = False
        mark_news(_words(new_block(1)), _words(new_block(1))[0], _PLACES, _CHANGED, _SET, np.zeros(1, bool))  # compiles

    def find(self, rows: Block) -> list[Event]:
        """Return the events of ``rows``, which follow those of the last call, in order of time."""
        before, news = _before_the_first(rows) if self._last is None else self._last, np.zeros(len(rows), bool)
        mark_news(_words(rows), _words(before)[0], _PLACES, _CHANGED, _SET, news)
        self._last = copied(rows[-1:])
        places = np.flatnonzero(news)
        if not len(places):
            return []
        old, new = rows[places - 1], rows[places]
        if places[0] == 0:
            old[0] = before[0]
        events = [*self._fault_events(old, new), *_changes(old, new), *_refusals(old, new)]
        return list(self._first_miss_only(sorted(events, key=lambda event: event.frame)))

    def _first_miss_only(self, events: list[Event]) -> Iterator[Event]:
        for event in events:
            if event.name != MISSED or not self._missed:
                yield event
            self._missed = self._missed or event.name == MISSED

    def _fault_events(self, old: Block, new: Block) -> Iterator[Event]:
        """Yield faults that begin or cease to act between rows of ``old`` and those of ``new``."""
        before, now = (np.unpackbits(rows["acting"], axis=1, bitorder="little") for rows in (old, new))
        for k, i in np.argwhere(now != before):
            yield Event(int(new["frame"][k]), "info", "fault on" if now[k, i] else "fault off", self._faults[int(i)])


def _before_the_first(rows: Block) -> Block:
    """Return the row before a flight: as its first one, but nothing acts, has failed, has no majority or is over."""
    before = copied(rows[:1])
    before["acting"] = 0
    before["pattern"] = Pattern.NORMAL
    before["end"] = End.FLYING
    for levels, states in _LEVELS.items():
        failed = before[states] == State.FAILED
        if not failed.any():
            continue
        before[states][failed] = State.OK
        fitted = (before[states] != State.ABSENT).sum(axis=-1)
        before[levels] = np.where(failed.any(axis=-1), fitted, before[levels])
    return before


def _refusals(old: Block, new: Block) -> Iterator[Event]:
    """Yield commands in rows ``new`` that readmitted no channel: failed in the row before, in ``old``, and still."""
    for field, states, named in (("reset", "state", SIGNALS), ("discrete_reset", "discrete_state", DISCRETES)):
        for k, s in np.argwhere(new[field]):
            commanded = new[field][k, s] >> np.arange(CHANNELS) & 1 == 1
            failed = (old[states][k, s] == State.FAILED) & (new[states][k, s] == State.FAILED)
            for c in np.flatnonzero(commanded & failed):
                text = f"{named[s].name}.{c + 1}: it has not agreed with the voted value for long enough"
                yield Event(int(new["frame"][k]), "warning", "readmission refused", text)


def _bits(fields: Iterable[str]) -> NDArray[np.uint64]:
    """Return the words of a row with all bits of ``fields`` set."""
    row = np.zeros(FLAT.itemsize, np.uint8)
    for field in fields:
        row[offset(field) : offset(field) + FLAT[field].itemsize] = 255
    return row.view(np.uint64)


def _words(rows: Block) -> NDArray[np.uint64]:
    """Return ``rows`` as (n, words): most blocks are settled by seeing that none of a few words has moved."""
    return rows.view(np.uint64).reshape(len(rows), -1)


@kernel
def mark_news(words, before, places, changed, present, news):
    """Mark in ``news`` (n,) the rows of ``words`` (n, m) that may hold an event.

    before : (m,) the words of the row before the first
    places : (p,) of the words that are looked at
    changed, present : (p,) bits of them that are news when they differ from the row before, when they are set
    """
    for k in range(words.shape[0]):
        bits = np.uint64(0)
        for i in range(places.shape[0]):
            word = words[k, places[i]]
            last = words[k - 1, places[i]] if k > 0 else before[places[i]]
            bits |= ((word ^ last) & changed[i]) | (word & present[i])
        news[k] = bits != 0


def _changes(old: Block, new: Block) -> Iterator[Event]:
    """Yield events of the rows ``new``, each beside the one before it in ``old``."""
    for field, describe in _DESCRIBE.items():
        moved = new[field] != old[field]
        if field in _LEVELS and moved.any():  # where no state is said, no level is
            moved &= (old[_LEVELS[field]] != State.ABSENT).any(axis=-1)
        for k, *place in np.argwhere(moved):
            before, now = int(old[field][(k, *place)]), int(new[field][(k, *place)])
            event = describe(int(new["frame"][k]), before, now, *map(int, place), new[k])
            if event is not None:
                yield event


def _state(frame: int, old: int, new: int, s: int, c: int, row: Any) -> Event | None:
    decided_by = who_failed(row, s, c) if new == State.FAILED else ""
    return _channel_state(frame, old, new, f"{SIGNALS[s].name}.{c + 1}", decided_by)


def _discrete_state(frame: int, old: int, new: int, d: int, c: int, row: Any) -> Event | None:
    return _channel_state(frame, old, new, f"{DISCRETES[d].name}.{c + 1}", COMPARISON)


def _channel_state(frame: int, old: int, new: int, channel: str, by: str) -> Event | None:
    """Return the event of a channel that was isolated, ``by`` what, or readmitted."""
    if new == State.FAILED:
        return Event(frame, "warning", "channel failed", f"{channel} isolated by {by}")
    if old == State.FAILED:
        return Event(frame, "info", "channel readmitted", f"{channel} readmitted")
    return None


def _discrete_voted(frame: int, old: int, new: int, d: int, row: Any) -> Event | None:
    """Return the event of a mode of the control law; the autopilot's engagement is one of the law itself."""
    modes = {"weight_on_wheels": ("air", "ground"), "gear_down": ("gear up", "gear down")}
    name = DISCRETES[d].name
    return Event(frame, "info", "mode", f"{name}: {modes[name][new != 0]} mode") if name in modes else None


def _discrete_level(frame: int, old: int, new: int, d: int, row: Any) -> Event:
    return _channels_left(
        frame, old, new, DISCRETES[d].name, f", its fail-safe value {row['discrete_voted'][d]} is used"
    )


def _level(frame: int, old: int, new: int, s: int, row: Any) -> Event:
    return _channels_left(frame, old, new, SIGNALS[s].name)


def _channels_left(frame: int, old: int, new: int, name: str, lost: str = "") -> Event:
    """Return the event of another number of channels in use; ``lost``: added to the text of the last one's."""
    if new == 0:
        return Event(frame, "error", "signal lost", f"{name}: no channel left{lost}")
    return Event(frame, "warning", "level", f"{name}: {old} to {new} channels")


def _pattern(frame: int, old: int, new: int, s: int, row: Any) -> Event | None:
    pattern = Pattern(new)
    if not pattern.is_split:
        return None
    return Event(frame, "warning", "split", f"{SIGNALS[s].name}: {pattern.label}")


def _reference(frame: int, old: int, new: int, s: int, row: Any) -> Event:
    standing = "usable" if new else "unusable"
    return Event(frame, "info", "reference", f"{SIGNALS[s].name}: reference {standing}")


def _common(frame: int, old: int, new: int, s: int, row: Any) -> Event | None:
    if not new and row["level"][s] == 0:
        return None  # it has been failed for it
    if not new:
        return Event(
            frame, "info", "common mode", f"{SIGNALS[s].name}: references no longer disagree with all channels"
        )
    return Event(frame, "error", "common mode", f"{SIGNALS[s].name}: two references disagree with all channels")


def _source(frame: int, old: int, new: int, s: int, row: Any) -> Event:
    """Return the event of a signal that control takes from elsewhere; the switch is faded."""
    taken = {Source.VOTED: "the voted value", Source.REFERENCE: "the reference", Source.DEGRADED: "the degraded mode"}
    level: Severity = "info" if new == Source.VOTED else "warning"
    return Event(frame, level, "source", f"{SIGNALS[s].name}: the control law uses {taken[Source(new)]}")


def _law(frame: int, old: int, new: int, row: Any) -> Event:
    return Event(frame, "info", "control law", f"{Law(old).name.lower()} to {Law(new).name.lower()}")


def _trust(frame: int, old: int, new: int, row: Any) -> Event | None:
    """Return the event of another source of the fault-tolerant law's pitch angle."""
    if new == Trust.CORRECTED:
        return Event(frame, "warning", "sensor corrected", "pitch_angle: the control law uses its estimate")
    if old == Trust.CORRECTED:
        why = "the sensor has recovered" if new == Trust.TRUSTED else "the flight path agrees with the sensor"
        return Event(frame, "info", "sensor trusted", f"pitch_angle: {why}")
    return None


def _sensor_fault(frame: int, old: int, new: int, row: Any) -> Event | None:
    if new == SensorFault.RATE_BIAS:
        return Event(frame, "warning", "rate biased", "pitch_angle: the sensor is correct, an angular rate is biased")
    if new in (SensorFault.NONE, SensorFault.UNDETERMINED):
        return None
    what = {
        SensorFault.EFFECTIVENESS: "effectiveness",
        SensorFault.OFFSET: "offset",
        SensorFault.BOTH: "effectiveness and offset",
    }
    return Event(frame, "info", "sensor fault", f"pitch_angle: {what[SensorFault(new)]}")


def _unit(frame: int, old: int, new: int, row: Any) -> Event | None:
    """Return the event of a unit's missing reply; that it missed a frame is kept once a flight."""
    events: dict[int, tuple[Severity, str, str]] = {
        UnitStatus.HELD: ("warning", MISSED, "no reply by the deadline; the last reply is used"),
        UnitStatus.REFUSED: (
            "warning",
            "unit refused",
            "the reply is not allowed; the last valid reply is used",
        ),
        UnitStatus.RESTARTED: ("warning", "unit restarted", "the unit started again and has lost its latched states"),
        UnitStatus.DEAD: ("error", "unit dead", "the unit sends no more replies"),
    }
    return Event(frame, *events[new]) if new in events else None


def _end(frame: int, old: int, new: int, row: Any) -> Event:
    return Event(frame, "error", "flight ends", End(new).cause)


_DESCRIBE = {
    "state": _state,
    "discrete_state": _discrete_state,
    "discrete_level": _discrete_level,
    "discrete_voted": _discrete_voted,
    "level": _level,
    "pattern": _pattern,
    "reference_usable": _reference,
    "common_mode": _common,
    "source": _source,
    "law": _law,
    "trust": _trust,
    "sensor_fault": _sensor_fault,
    "unit": _unit,
    "end": _end,
}
_IF_CHANGED, _IF_SET = _bits([*_DESCRIBE, "acting"]), _bits(["reset", "discrete_reset"])
_PLACES: Final = np.flatnonzero(_IF_CHANGED | _IF_SET)
_CHANGED, _SET = _IF_CHANGED[_PLACES], _IF_SET[_PLACES]
