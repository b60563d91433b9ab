"""Files of the rig as recordings: the log of a flight, or an MCAP file that ``rig vote`` wrote."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.errors import BadInput, BadLog
from rig.frame import CHANNELS, SIGNALS, Ilm, State
from rig.log import foreign, read_log
from rig.log.foreign import Source
from rig.recorded.clock import clock
from rig.recorded.record import Bytes, Recording, Samples, on_clock


def read_ours(path: Path, repair: bool = False) -> Recording:
    """A log of a flight, or the output of an earlier vote; BadInput in one line when it is neither."""
    try:
        topics = foreign.topics(path)
    except BadLog:
        read_log(path)  # says more, if it is a log of a flight that was cut
        raise
    if "/flight" in topics:
        return _flown(path, repair)
    ours = [topic for topic, schema in topics.items() if schema == "rig.Signal"]
    if not ours:
        raise BadInput(f"{path}: not a log of this rig: CONFIG needs a [mapping] of its topics: {', '.join(topics)}")
    return _voted(path, ours, repair)


def _flown(path: Path, repair: bool) -> Recording:
    log = read_log(path)
    rows = log.rows
    accepted = clock(str(path), rows["frame"] / log.rate_hz, repair)
    recorded: dict[str, Samples] = {}
    for i, signal in enumerate(SIGNALS):
        fitted = range(int((rows["state"][0, i] != State.ABSENT).sum()))
        recorded[signal.name] = Samples(
            [rows["channels"][:, i, c].copy() for c in fitted],
            [rows["ilm"][:, i, c].copy() for c in fitted],
            rows["reference"][:, i].copy(),
            [rows["valid"][:, i, c].copy() for c in fitted],
        )
    return on_clock(accepted, recorded)


def _voted(path: Path, topics: list[str], repair: bool) -> Recording:
    per_channel = [f"{kind}_{c}" for kind in ("ch", "valid", "ilm", "st") for c in range(1, CHANNELS + 1)]
    sources = foreign.read(path, {topic: {*per_channel, "reference"} for topic in topics})
    time_s = sources[topics[0]].time_s
    for topic, source in sources.items():
        if not np.array_equal(source.time_s, time_s):
            raise BadInput(f"{path}: {topic} has other times than {topics[0]}")
    accepted = clock(str(path), time_s, repair)
    signals = {
        topic.removeprefix("/signal/"): _samples(f"{path}: {topic}", source) for topic, source in sources.items()
    }
    return on_clock(accepted, signals)


def _samples(where: str, source: Source) -> Samples:
    """The fields of ``rig.Signal`` as samples; BadInput when a code is not one of the rig's."""
    fields = source.fields
    states = [_codes(where, fields, f"st_{c}", State)[0] for c in range(1, CHANNELS + 1)]
    fitted = [c for c, state in enumerate(states, 1) if state != State.ABSENT]
    if fitted != list(range(1, len(fitted) + 1)) or len(fitted) < 2:
        raise BadInput(f"{where}: channels {fitted}; two to {CHANNELS} are needed, from 1 on")
    return Samples(
        [fields[f"ch_{c}"] for c in fitted],
        [_codes(where, fields, f"ilm_{c}", Ilm) for c in fitted],
        fields["reference"],
        [_codes(where, fields, f"valid_{c}", (0, 1)) for c in fitted],
    )


def _codes(
    where: str, fields: Mapping[str, NDArray[np.float64]], name: str, known: type[IntEnum] | Collection[int]
) -> Bytes:
    values = fields[name]
    wrong = np.flatnonzero(~np.isin(values, [int(code) for code in known]))
    if len(wrong):
        allowed = ", ".join(str(int(code)) for code in known)
        raise BadInput(f"{where}: message {wrong[0] + 1}: {name} is one of {allowed}, got {values[wrong[0]]:g}")
    return values.astype(np.uint8)
