"""What every log of a flight begins with: its schemas and channels, made from the tables of schema.py."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any, Final

import numpy as np
from foxglove_schemas_protobuf.Log_pb2 import Log as FoxgloveLog
from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from numpy.typing import NDArray

from rig.frame import SIGNALS
from rig.log.container import Opening
from rig.log.index import Run
from rig.log.layout import ROW, STARTS
from rig.log.schema import EVENTS, SCHEMA_NAMES, TOPICS, descriptors
from rig.record.event import Severity

RIG: Final = "rig"  # names of the metadata records
RESULT: Final = "result"
EVENT_CHANNEL: Final = TOPICS.index(EVENTS) + 1
LEVELS: Final[dict[Severity, Any]] = {
    "info": FoxgloveLog.INFO,
    "warning": FoxgloveLog.WARNING,
    "error": FoxgloveLog.ERROR,
}


@cache
def opening() -> Opening:
    """Return the schema and the channel records, the same in every file."""
    schemas = [
        Schema(i, descriptors(name).SerializeToString(), SchemaEncoding.Protobuf, name)
        for i, name in enumerate(SCHEMA_NAMES, 1)
    ]
    return Opening.of(schemas, channels())


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
    schema_ids = {name: i for i, name in enumerate(SCHEMA_NAMES, 1)}
    return [
        Channel(i, topic.name, MessageEncoding.Protobuf, about.get(topic.name, {}), schema_ids[topic.message])
        for i, topic in enumerate(TOPICS, 1)
    ]
