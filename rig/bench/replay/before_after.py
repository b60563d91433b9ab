"""The two sides of ``rig diff``: logs of flights, or MCAP files that ``rig vote`` wrote."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.replay.compare_flights import Comparison, Field, of_column, tolerances
from rig.core.errors import BadLog
from rig.core.frame import INDEX, SIGNALS
from rig.core.text import shorten
from rig.log import foreign, read_log
from rig.log.columns import COLUMNS, chosen_lanes
from rig.log.info import leaves
from rig.log.reader import scenario_of
from rig.log.schema import MESSAGES

_SAMPLES: Final = ("truth", "voted", "reference", "channels")
_ANGLES: Final = tuple(field.name for field in MESSAGES["rig.Signal"].fields if field.source in _SAMPLES)
_MOST_KEYS: Final = 20  # settings that are told one by one
_SAID: Final = ("seed", "scenario", "machine", "git commit")  # and all "version ..."


@dataclass(frozen=True, slots=True)
class Side:
    """One file: columns (n,) by name, with whether each is an angle on the circle."""

    path: Path
    rate_hz: float | None
    frames: NDArray[np.int64]
    columns: dict[str, tuple[NDArray[Any], bool]]
    metadata: dict[str, str]
    partial: bool = False  # a vote of a flight: the rest of the flight is not missing in it


def side(path: Path | str) -> Side:
    """Return the file at ``path``; BadLog in one line when it is none of ours."""
    path = Path(path)
    if _is_voted(path):
        return _voted(path)
    log = read_log(path)
    every = (*COLUMNS, *chosen_lanes(log.table))
    columns = {column.path: (column.of(log.table), column.wraps) for column in every}
    return Side(path, log.rate_hz, log.rows["frame"], columns, log.metadata)


def _is_voted(path: Path) -> bool:
    """Return whether the file has signals but no flight; what cannot be told here is for read_log to say."""
    try:
        topics = foreign.topics(path)
    except BadLog:
        return False
    return "/flight" not in topics and "rig.Signal" in topics.values()


def _voted(path: Path) -> Side:
    """Read a vote: of a flight's log by its own scenario only what the flight has too, else all fields."""
    of_flight = foreign.fields(path)
    wanted = {
        topic: {field.name for field in MESSAGES[schema].fields if not of_flight or field.source in of_flight[topic]}
        for topic, schema in foreign.topics(path).items()
        if schema == "rig.Signal" or topic in of_flight
    }
    columns: dict[str, tuple[NDArray[Any], bool]] = {}
    rows = 0
    for topic, source in foreign.read(path, wanted).items():
        name, rows = topic.rsplit("/", 1)[1], len(source.time_s)
        wraps = name in INDEX and SIGNALS[INDEX[name]].wraps
        for field, values in source.fields.items():
            columns[f"{name}.{field}"] = (values, wraps and field in _ANGLES)
    return Side(path, None, np.arange(rows), columns, {}, partial=bool(of_flight))


def diff(a: Side, b: Side, tolerance: Sequence[str] = ()) -> Comparison:
    """All fields of two files, frame by frame, by number and not by time.  BadInput: a tolerance."""
    names = list(dict.fromkeys([*a.columns, *b.columns]))
    if a.partial or b.partial:
        names = [name for name in names if all(name in side.columns for side in (a, b) if side.partial)]
    allowed = tolerances(tolerance, names)
    n = min(len(a.frames), len(b.frames))
    fields: list[Field] = []
    for name in names:
        if name not in a.columns or name not in b.columns:
            fields.append(Field(name, "missing in A" if name not in a.columns else "missing in B"))
            continue
        (left, wraps), (right, _) = a.columns[name], b.columns[name]
        fields.append(of_column(name, left[:n], right[:n], a.frames[:n], allowed.of(name), wraps))
    notes = _notes(a.metadata, b.metadata)
    for name, part, whole in (("A", a, b), ("B", b, a)):
        if part.partial and not whole.partial:
            notes.append(f"{name} is a vote: {len(whole.columns) - len(names)} fields of the flight are not part of it")
    return Comparison(n, fields, _remarks(a, b), notes)


def _remarks(a: Side, b: Side) -> list[str]:
    remarks: list[str] = []
    if len(a.frames) != len(b.frames):
        remarks.append(f"lengths differ: {len(a.frames)} and {len(b.frames)} frames; the common ones are compared")
    if a.rate_hz and b.rate_hz and a.rate_hz != b.rate_hz:
        remarks.append(f"rates differ: {a.rate_hz:g} and {b.rate_hz:g} Hz; frames are compared by number, not by time")
    left, right = (log.metadata.get("aircraft") for log in (a, b))
    if left and right and left != right:
        remarks.append(f"aircraft differ: {left} and {right}")
    return remarks


def _notes(a: dict[str, str], b: dict[str, str]) -> list[str]:
    """Return the origins of both logs that are not alike."""
    keys = [key for key in a if key in b and (key in _SAID or key.startswith("version "))]
    differ = [key for key in keys if a[key] != b[key]]
    of_settings = _settings(a["scenario"], b["scenario"]) if "scenario" in differ else []
    return [*(f"{key}: {a[key]} and {b[key]}" for key in differ if key != "scenario"), *of_settings]


def _settings(a: str, b: str) -> list[str]:
    """Return the keys in which two scenarios of logs differ, with both values; the seed is told by itself."""
    left, right = (dict(leaves(scenario_of({"scenario": text}, "scenario"))) for text in (a, b))
    keys = [key for key in {**left, **right} if key != "seed" and left.get(key) != right.get(key)]
    shown = [f"{key}: {_value(left, key)} and {_value(right, key)}" for key in keys[:_MOST_KEYS]]
    more = len(keys) - len(shown)
    return [*shown, *([f"and {more} more settings that differ: rig info --json has all of each log"] if more else [])]


def _value(settings: dict[str, Any], key: str) -> str:
    return shorten(json.dumps(settings[key])) if key in settings else "not set"


def of_replay(old: dict[str, str], new: dict[str, str]) -> list[str]:
    """Return the versions that replay a log, where they are not those that flew it."""
    return _notes(old, new)
