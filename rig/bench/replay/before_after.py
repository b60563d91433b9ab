"""The two sides of ``rig diff``, in bounded memory: logs of flights, or MCAP files that ``rig vote`` wrote."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.bench.replay.compare_flights import Comparison, Field, joined, of_column, tolerances
from rig.computer.redundancy.managers import manager_kind
from rig.core.blocks import cuts
from rig.core.errors import BadLog
from rig.core.frame import INDEX, SIGNALS
from rig.core.renamed import field_now
from rig.core.text import shorten
from rig.log import LogFile, foreign
from rig.log.columns import COLUMNS, PART_COLUMNS
from rig.log.info import leaves
from rig.log.reader import scenario_of
from rig.log.schema import MESSAGES

_SAMPLES: Final = ("truth", "voted", "reference", "channels")
_ANGLES: Final = tuple(field.name for field in MESSAGES["rig.Signal"] if field.source in _SAMPLES)
_MOST_KEYS: Final = 20  # settings that are told one by one
# Rules of the manager that a log of an earlier version may have on, and this version has not; each by its keys.
_GONE: Final = {
    "isolation thresholds": ("outlier_threshold", "outlier_threshold_triplex"),
    "channel equalisation": ("equalise_bound", "bias_bound"),
}
_SAID: Final = ("seed", "scenario", "machine", "git commit")  # and all "version ..."


Part = Callable[[str], NDArray[Any]]  # a column (n,) of some frames by its name


@dataclass(frozen=True, slots=True)
class Side:
    """One file, a block of frames at a time: its columns, and the numbers of its frames."""

    path: Path
    rate_hz: float | None
    frames: int
    wraps: dict[str, bool]  # by the name of a column: an angle on the circle
    blocks: Callable[[], Iterator[tuple[NDArray[np.int64], Part]]]
    metadata: dict[str, str]
    partial: bool = False  # a vote of a flight: the rest of the flight is not missing in it


def side(path: Path | str) -> Side:
    """Return the file at ``path``.  BadLog, one line: it is neither a log nor a vote."""
    path = Path(path)
    if _is_voted(path):
        return _voted(path)
    log = LogFile.open(path)
    columns = {column.path: column for column in (*COLUMNS, *(lane for lane in PART_COLUMNS if lane.part in log.parts))}

    def blocks() -> Iterator[tuple[NDArray[np.int64], Part]]:
        return ((block["frame"], lambda name, block=block: columns[name].of(block)) for block in log.blocks())

    wraps = {name: column.wraps for name, column in columns.items()}
    return Side(path, log.rate_hz, log.frames, wraps, blocks, log.metadata)


def _is_voted(path: Path) -> bool:
    """Return True if the file has signals but no flight; LogFile reports any other fault."""
    try:
        topics = foreign.topics(path)
    except BadLog:
        return False
    return "/flight" not in topics and "rig.Signal" in topics.values()


def _voted(path: Path) -> Side:
    """Read a vote: all fields, or only the flight's fields for a vote of its log by its scenario."""
    of_flight = {topic: set(map(field_now, fields)) for topic, fields in foreign.fields(path).items()}
    wanted = {
        topic: _fields(message, names, of_flight.get(topic))
        for topic, (message, names) in foreign.messages_of(path).items()
        if message == "rig.Signal" or topic in of_flight
    }
    columns, wraps, rows = dict[str, NDArray[Any]](), dict[str, bool](), 0
    for topic, source in foreign.read(path, wanted).items():
        name, rows = topic.rsplit("/", 1)[1], len(source.time_s)
        on_circle = name in INDEX and SIGNALS[INDEX[name]].wraps
        for field, values in ((field_now(field), values) for field, values in source.fields.items()):
            columns[f"{name}.{field}"], wraps[f"{name}.{field}"] = values, on_circle and field in _ANGLES

    def blocks() -> Iterator[tuple[NDArray[np.int64], Part]]:
        return ((np.arange(rows)[part], lambda name, part=part: columns[name][part]) for part in cuts(rows))

    return Side(path, None, rows, wraps, blocks, {}, partial=bool(of_flight))


def _fields(message: str, names: Sequence[str], of_flight: set[str] | None) -> set[str]:
    """Return which ``names`` of a stored message are fields of the rig; of_flight : the fields that count."""
    sources = {field.name: field.source for field in MESSAGES[message]}
    given = {name: sources.get(field_now(name)) for name in names}
    return {name for name, source in given.items() if source and (of_flight is None or source in of_flight)}


def diff(a: Side, b: Side, tolerance: Sequence[str] = ()) -> Comparison:
    """Compare all fields of two files, frame by frame, by number and not by time.  BadInput: a tolerance."""
    names = list(dict.fromkeys([*a.wraps, *b.wraps]))
    if a.partial or b.partial:
        names = [name for name in names if all(name in side.wraps for side in (a, b) if side.partial)]
    allowed = tolerances(tolerance, names)
    both = {name: Field(name, "equal") for name in names if name in a.wraps and name in b.wraps}
    for (frames, left), (others, right) in zip(a.blocks(), b.blocks(), strict=False):
        n = min(len(frames), len(others))
        for name, before in both.items():
            here = of_column(name, left(name)[:n], right(name)[:n], frames[:n], allowed.of(name), a.wraps[name])
            both[name] = joined(before, here)
    missing = {name: Field(name, "missing in A" if name not in a.wraps else "missing in B") for name in names}
    fields = [both.get(name, missing[name]) for name in names]
    notes = _notes(a.metadata, b.metadata)
    for name, part, whole in (("A", a, b), ("B", b, a)):
        if part.partial and not whole.partial:
            notes.append(f"{name} is a vote: {len(whole.wraps) - len(names)} fields of the flight are not part of it")
    return Comparison(min(a.frames, b.frames), fields, _remarks(a, b), notes)


def _remarks(a: Side, b: Side) -> list[str]:
    remarks: list[str] = []
    if a.frames != b.frames:
        remarks.append(f"lengths differ: {a.frames} and {b.frames} frames; the common ones are compared")
    if a.rate_hz and b.rate_hz and a.rate_hz != b.rate_hz:
        remarks.append(f"rates differ: {a.rate_hz:g} and {b.rate_hz:g} Hz; frames are compared by number, not by time")
    left, right = (log.metadata.get("aircraft") for log in (a, b))
    if left and right and left != right:
        remarks.append(f"aircraft differ: {left} and {right}")
    return remarks


def _notes(a: dict[str, str], b: dict[str, str]) -> list[str]:
    """Return the differences in the origins of both logs."""
    keys = [key for key in a if key in b and (key in _SAID or key.startswith("version "))]
    differ = [key for key in keys if a[key] != b[key]]
    of_settings = _settings(a["scenario"], b["scenario"]) if "scenario" in differ else []
    return [*(f"{key}: {a[key]} and {b[key]}" for key in differ if key != "scenario"), *of_settings]


def _settings(a: str, b: str) -> list[str]:
    """Return the keys in which two scenarios of logs differ, with both values; without the seed."""
    left, right = (dict(leaves(scenario_of({"scenario": text}, "scenario"))) for text in (a, b))
    keys = [key for key in {**left, **right} if key != "seed" and left.get(key) != right.get(key)]
    shown = [f"{key}: {_value(left, key)} and {_value(right, key)}" for key in keys[:_MOST_KEYS]]
    more = len(keys) - len(shown)
    return [*shown, *([f"and {more} more settings that differ: rig info --json has all of each log"] if more else [])]


def _value(settings: dict[str, Any], key: str) -> str:
    return shorten(json.dumps(settings[key])) if key in settings else "not set"


def of_replay(old: dict[str, str], new: dict[str, str]) -> list[str]:
    """Return what differs between the replay and the flight: rules that are gone, versions."""
    return [*rules_gone(old), *_notes(old, new)]


def rules_gone(metadata: Mapping[str, str]) -> list[str]:
    """Return a note if the manager of the flight had rules on that this version does not have; metadata : its log's."""
    redundancy = json.loads(metadata["scenario"]).get("redundancy", {})
    kind = manager_kind(redundancy.get("manager", ""))
    if kind.kernel is not None and not kind.compares:
        return []
    signals = redundancy.get("signals", {}).values()
    rules = [name for name, keys in _GONE.items() if any(signal.get(key) for signal in signals for key in keys)]
    if not rules:
        return []
    return [f"the log was flown with {' and '.join(rules)}, which this version does not have: decisions can differ"]
