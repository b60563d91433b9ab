"""What every log of a flight begins with: its schemas and channels, made from the tables of schema.py."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Final

import numpy as np
from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from numpy.typing import NDArray

from rig.frame import SIGNALS
from rig.log.container import Opening
from rig.log.index import Run
from rig.log.layout import ROW, STARTS
from rig.log.schema import EVENTS, SCHEMA_NAMES, TOPICS, descriptors

RIG: Final = "rig"  # names of the metadata records
RESULT: Final = "result"
EVENT_CHANNEL: Final = TOPICS.index(EVENTS) + 1


@cache
def opening() -> Opening:
    """Return the schema and the channel records, the same in every file."""
    return Opening.of(schemas(), channels())


def runs_of(times: NDArray[np.uint64], events: Sequence[tuple[int, int]]) -> list[Run]:
    """Return the runs of a chunk: rows at ``times`` [ns], then events, each with its time and its record's offset."""
    runs = [Run(1, times, _offsets(len(times)))] if len(times) else []
    if events:
        at, offsets = np.array(events, np.uint64).T
        runs.append(Run(EVENT_CHANNEL, at, offsets[None, :]))
    return runs


@lru_cache(maxsize=4)  # all chunks of a flight are of one length but the last
def _offsets(rows: int) -> NDArray[np.int64]:
    return np.add.outer(STARTS, ROW * np.arange(rows))


def schemas() -> list[Schema]:
    """The schema records, ids from 1."""
    return [
        Schema(i, descriptors(name).SerializeToString(), SchemaEncoding.Protobuf, name)
        for i, name in enumerate(SCHEMA_NAMES, 1)
    ]


def channels() -> list[Channel]:
    """The channel records, ids from 1; a signal's says its unit, symbol and range."""
    about = {
        signal.topic: {
            "unit": signal.unit,
            "symbol": signal.symbol,
            "group": signal.group,
            "low": repr(signal.low),
            "high": repr(signal.high),
        }
        for signal in SIGNALS
    }
    return [
        Channel(
            i,
            topic.name,
            MessageEncoding.Protobuf,
            about.get(topic.name, {}),
            SCHEMA_NAMES.index(topic.message) + 1,
        )
        for i, topic in enumerate(TOPICS, 1)
    ]
