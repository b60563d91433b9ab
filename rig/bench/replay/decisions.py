"""Decisions: suspect and isolated channels, deciding rules, sources; and their changes between two flights.

A decision is a number that the redundancy stage or the control law chooses from a few.  Two flights of the same
frames are compared decision by decision; consecutive frames with the same old and new value are one entry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.replay.compare_flights import Field, compare, joined
from rig.core.frame import ActuatorMonitor, Block, State, Table
from rig.core.runs import runs
from rig.log.columns import COLUMNS, Column, chosen_of_parts, label

FIELDS: Final = (
    *("state", "level", "pattern", "decided_by", "reference_usable", "source"),
    *("discrete_state", "discrete_level", "discrete_voted"),
)
PART_FIELDS: Final = ("failed_by", "valve_differs", "health", "failed_for", "leads")  # of servo actuators, computers
ALL: Final = (*FIELDS, "law", "end")  # with those that follow from the flight: commands, and how it ended
_VOTES: Final = tuple(column for column in COLUMNS if column.field == "voted")
_FLIGHT: Final = {"law": "control law", "end": "end"}


@dataclass(frozen=True, slots=True)
class Moved:
    """One decision over consecutive frames (the last included) in which it is ``new`` and was ``old``."""

    decision: str  # state, level, pattern, decided_by, reference_usable, source, voted
    signal: str  # or a discrete
    channel: int | None  # counted from 1
    first_frame: int
    last_frame: int
    old: str
    new: str


@dataclass(frozen=True, slots=True)
class Failed:
    """A channel with another isolation: the first frame in which each flight reports it, if any."""

    signal: str
    channel: int
    old_frame: int | None
    new_frame: int | None


@dataclass(frozen=True, slots=True)
class VoteMoved:
    """The largest difference of a signal's votes, unit of the signal; None when one of them is not a number."""

    signal: str
    frames: int  # that are not equal
    first_frame: int
    largest: float | None


@dataclass(frozen=True, slots=True)
class Decisions:
    """Changes from an old flight to a new one over the same channels."""

    moved: list[Moved]
    failures: list[Failed]
    votes: list[VoteMoved]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self)


def decided(fields: tuple[str, ...]) -> list[Column]:
    """Return the columns that hold decisions."""
    return [column for column in COLUMNS if column.field in fields]


def _moved(column: Column, old: Table, new: Table, frames: NDArray[np.int64]) -> list[Moved]:
    before, after = column.of(old), column.of(new)
    changed = np.flatnonzero(before != after)
    if not len(changed):
        return []
    pair = before[changed].astype(np.int64) * 256 + after[changed]
    breaks = np.flatnonzero((np.diff(changed) > 1) | (np.diff(pair) != 0)) + 1
    firsts, lasts = changed[np.concatenate([[0], breaks])], changed[np.concatenate([breaks - 1, [len(changed) - 1]])]
    return [
        Moved(
            decision=_decision(column),
            signal=column.owner,
            channel=column.channel,
            first_frame=int(frames[first]),
            last_frame=int(frames[last]),
            old=label(column, int(before[first])),
            new=label(column, int(after[first])),
        )
        for first, last in zip(firsts, lasts, strict=True)
    ]


def _decision(column: Column) -> str:
    return _FLIGHT.get(column.field, column.field.removeprefix("discrete_"))


def decisions(old: Table, new: Table) -> Decisions:
    """Return the changes from ``old`` to ``new``: decisions, isolations, and differences of votes."""
    moves = Moves()
    moves.add(old, new)
    return moves.decisions()


class Moves:
    """The changed decisions from an old flight to a new one, collected block by block."""

    def __init__(self) -> None:
        self._moved: dict[Column, list[Moved]] = {}
        self._failed: dict[Column, tuple[int | None, int | None]] = {}  # first frame in the old flight, in the new
        self._votes: list[Field] = []

    def add(self, old: Table, new: Table) -> None:
        """Take the next frames of both."""
        votes = compare(old, new, _VOTES)
        self._votes = [joined(*pair) for pair in zip(self._votes, votes, strict=True)] if self._votes else votes
        self._add(old, new, decided(FIELDS), decided(("state", "discrete_state")))
        if old.parts:
            columns = [column for column in chosen_of_parts(new) if column.field in PART_FIELDS]
            n = min(len(old), len(new))
            self._add(old[:n], new[:n], columns, [column for column in columns if column.field == "failed_by"])

    def _add(self, old: Table, new: Table, columns: Sequence[Column], failing: Sequence[Column]) -> None:
        n = min(len(old), len(new))
        for column in columns:
            _extend(self._moved.setdefault(column, []), _moved(column, old[:n], new[:n], old["frame"][:n]))
        for column in failing:
            frames = self._failed.get(column, (None, None))
            before, after = (_first(_failed(column, rows), rows["frame"]) for rows in (old, new))
            self._failed[column] = before if frames[0] is None else frames[0], after if frames[1] is None else frames[1]

    def decisions(self) -> Decisions:
        """Return the changes: decisions in order of time, isolations at another time, votes."""
        moved = sorted(
            (change for changes in self._moved.values() for change in changes), key=lambda change: change.first_frame
        )
        failures = [
            Failed(column.owner, column.channel or 0, *frames)
            for column, frames in self._failed.items()
            if frames[0] != frames[1]
        ]
        votes = [
            VoteMoved(column.owner, field.frames, field.first_frame or 0, field.largest)
            for column, field in zip(_VOTES, self._votes, strict=bool(self._votes))
            if field.verdict != "equal"
        ]
        return Decisions(moved, failures, votes)


def _extend(moves: list[Moved], then: list[Moved]) -> None:
    """Add the changes of the next rows; a continued one stays one entry."""
    if moves and then and moves[-1].last_frame + 1 == then[0].first_frame:
        last, goes_on = moves[-1], then[0]
        if (last.old, last.new) == (goes_on.old, goes_on.new):
            moves[-1], then = replace(last, last_frame=goes_on.last_frame), then[1:]
    moves += then


def _failed(column: Column, rows: Table) -> NDArray[np.bool_]:
    values = column.of(rows)
    return values != ActuatorMonitor.NONE if column.field == "failed_by" else values == State.FAILED


def _first(there: NDArray[np.bool_], frames: NDArray[np.int64]) -> int | None:
    return int(frames[there.argmax()]) if there.any() else None


def history(rows: Block, fields: tuple[str, ...] = ALL) -> list[str]:
    """Yield every decision of a flight as a line of text, in order of time: frame, owner, decision, old, new.

    Decisions of the first frame are left out if they are usual: OK, all channels, no rule.
    """
    found: list[tuple[int, str]] = []
    for column in decided(fields):
        values, name = column.of(rows), _name(column)
        for k in runs(values)[1:, 0]:
            text = f"{name}: {label(column, int(values[k - 1]))} -> {label(column, int(values[k]))}"
            found.append((int(rows["frame"][k]), text))
    return [f"{frame} {text}" for frame, text in sorted(found, key=lambda entry: entry[0])]


def _name(column: Column) -> str:
    if column.field in _FLIGHT:
        return _FLIGHT[column.field]
    channel = "" if column.channel is None else f".{column.channel}"
    return f"{column.owner}{channel} {_decision(column)}"
