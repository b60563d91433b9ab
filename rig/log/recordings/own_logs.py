"""Files of the rig as recordings: the log of a flight, or an MCAP file that ``rig vote`` wrote."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from enum import IntEnum
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.blocks import room
from rig.core.errors import BadInput, BadLog
from rig.core.frame import CHANNELS, DISCRETES, FLAT, SIGNALS, Ilm, State
from rig.log import Log, LogFile, foreign
from rig.log.foreign import Source
from rig.log.recordings.recording import Bytes, Recording, Samples, on_clock
from rig.log.recordings.stamps import clock
from rig.log.schema import MESSAGES

_READ: Final = ("channels", "valid", "ilm", "state", "reference")
_COLUMNS: Final = {  # of a flight's rows, and their types in a recording
    **dict.fromkeys(("channels", "reference", "second_reference", "discrete_channels"), np.float64),
    **dict.fromkeys(("valid", "ilm", "discrete_valid", "discrete_ilm"), np.uint8),
    "frame": np.int64,
}
_FIELDS: Final = {
    message: {field.name for field in MESSAGES[message] if field.source.removeprefix("discrete_") in _READ}
    for message in ("rig.Signal", "rig.Discrete")
}


def read_ours(path: Path, repair: bool = False) -> Recording:
    """Return a log of a flight, or the output of an earlier vote; BadInput in one line when it is neither."""
    topics = _topics(path)
    if "/flight" in topics:
        return of_log(LogFile.open(path), path, repair)
    ours = {topic: schema for topic, schema in topics.items() if schema in _FIELDS}
    if not ours:
        raise BadInput(f"{path}: not a log of this rig: CONFIG needs a [mapping] of its topics: {', '.join(topics)}")
    return _voted(path, ours, repair)


def is_flight(path: Path) -> bool:
    """Return True if an MCAP file is the log of a flight.  BadInput in one line when it cannot be read."""
    return "/flight" in _topics(path)


def _topics(path: Path) -> dict[str, str]:
    try:
        return foreign.topics(path)
    except BadLog:
        LogFile.open(path)  # says more, if it is a log of a flight that was cut
        raise


def of_log(log: Log | LogFile, path: Path, repair: bool = False) -> Recording:
    """Return the log of a flight, read from ``path``, as a recording; it is gone through block by block."""
    columns = {name: room((*FLAT[name].shape, log.frames), dtype) for name, dtype in _COLUMNS.items()}
    states, done = np.empty(0, FLAT), 0
    for block in log.blocks():
        states = states if done else block.rows[:1].copy()
        for name, column in columns.items():
            column[..., done : done + len(block)] = np.moveaxis(block[name], 0, -1)
        done += len(block)
    accepted = clock(str(path), columns["frame"] / log.rate_hz, repair)
    signals = {signal.name: _recorded(columns, states[0], "", i) for i, signal in enumerate(SIGNALS)}
    discretes = {each.name: _recorded(columns, states[0], "discrete_", i) for i, each in enumerate(DISCRETES)}
    return replace(on_clock(accepted, signals, discretes), in_si=True)


def _recorded(columns: Mapping[str, NDArray[Any]], first: Any, kind: str, i: int) -> Samples:
    """Return the channels of signal or discrete ``i``, whose fields begin with ``kind``, that the first row has."""
    fitted = int((first[f"{kind}state"][i] != State.ABSENT).sum())
    channels, ilm, valid = ([*columns[f"{kind}{name}"][i, :fitted]] for name in ("channels", "ilm", "valid"))
    references = (None, None) if kind else (columns["reference"][i], columns["second_reference"][i])
    return Samples(channels, ilm, references[0], valid, references[1])


def _voted(path: Path, topics: Mapping[str, str], repair: bool) -> Recording:
    sources = foreign.read(path, {topic: _FIELDS[schema] for topic, schema in topics.items()})
    first, time_s = next((topic, source.time_s) for topic, source in sources.items())
    for topic, source in sources.items():
        if not np.array_equal(source.time_s, time_s):
            raise BadInput(f"{path}: the times of {topic} and {first} differ")
    accepted = clock(str(path), time_s, repair)
    of_kind: dict[str, dict[str, Samples]] = {schema: {} for schema in _FIELDS}
    for topic, source in sources.items():
        name = topic.removeprefix("/signal/").removeprefix("/discrete/")
        of_kind[topics[topic]][name] = _samples(f"{path}: {topic}", source)
    return replace(on_clock(accepted, of_kind["rig.Signal"], of_kind["rig.Discrete"]), in_si=True)


def _samples(where: str, source: Source) -> Samples:
    """Return the fields of ``rig.Signal`` or ``rig.Discrete`` as samples; BadInput: a code is not the rig's."""
    fields = source.fields
    states = [_codes(where, fields, f"st_{c}", State)[0] for c in range(1, CHANNELS + 1)]
    fitted = [c for c, state in enumerate(states, 1) if state != State.ABSENT]
    if fitted != list(range(1, len(fitted) + 1)) or len(fitted) < 2:
        raise BadInput(f"{where}: channels {fitted}; two to {CHANNELS} are needed, from 1 on")
    return Samples(
        [fields[f"ch_{c}"] for c in fitted],
        [_codes(where, fields, f"ilm_{c}", Ilm) for c in fitted] if "ilm_1" in fields else None,
        fields.get("reference"),
        [_codes(where, fields, f"valid_{c}", (0, 1)) for c in fitted] if "valid_1" in fields else None,
    )


def _codes(
    where: str, fields: Mapping[str, NDArray[np.float64]], name: str, codes: type[IntEnum] | Collection[int]
) -> Bytes:
    values = fields[name]
    wrong = np.flatnonzero(~np.isin(values, [int(code) for code in codes]))
    if len(wrong):
        allowed = ", ".join(str(int(code)) for code in codes)
        raise BadInput(f"{where}: message {wrong[0] + 1}: {name} is one of {allowed}, got {values[wrong[0]]:g}")
    return values.astype(np.uint8)
