"""Reads numbers out of any MCAP file whose messages are protobuf or JSON."""

from __future__ import annotations

import json
import struct
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import zstandard
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Channel, Schema
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray

from rig.errors import BadInput, BadLog

_MALFORMED: Final = (
    McapError,
    DecodeError,
    EOFError,
    ValueError,
    LookupError,
    RuntimeError,  # of the lz4 library
    struct.error,
    zstandard.ZstdError,
)


class Source(NamedTuple):
    """One recorder: its time (m,), s, and its fields (m,) by name."""

    time_s: NDArray[np.float64]
    fields: Mapping[str, NDArray[np.float64]]


def topics(path: Path) -> dict[str, str]:
    """The topics of an MCAP file in their order, with the names of their schemas; BadLog when it is cut or damaged."""
    with _opened(path) as reader:
        summary = reader.get_summary()
        if summary is None:
            raise BadLog(f"{path}: truncated or without a summary")
        channels = [channel for _, channel in sorted(summary.channels.items())]
        named = {channel.topic: summary.schemas.get(channel.schema_id) for channel in channels}
        return {topic: schema.name if schema else "" for topic, schema in named.items()}


def read(path: Path, wanted: Mapping[str, set[str]]) -> dict[str, Source]:
    """Fields of messages by topic, ``angular_velocity.x`` for nested ones, ``data.0`` for an element.

    Time is the log time of each message.  BadInput: no such topic or field, an encoding that is neither protobuf
    nor JSON; BadLog: a file that is cut or damaged.
    """
    there = topics(path)
    for topic in wanted:
        if topic not in there:
            raise BadInput(f"{path}: no topic {topic!r}; there are: {', '.join(there)}")
    collected = {topic: _Collector(path, topic, sorted(fields)) for topic, fields in wanted.items()}
    with _opened(path) as reader:
        for schema, channel, message in reader.iter_messages(topics=list(wanted)):
            collected[channel.topic].add(schema, channel, message.log_time, message.data)
    return {topic: collector.source() for topic, collector in collected.items()}


@contextmanager
def _opened(path: Path) -> Iterator[McapReader]:
    try:
        with path.open("rb") as file:
            yield make_reader(file, validate_crcs=True)
    except OSError as error:
        raise BadLog(f"{path}: cannot be read: {error.strerror}") from None
    except _MALFORMED as error:
        what = " ".join(str(error).split()) or type(error).__name__
        raise BadLog(f"{path}: not an MCAP file, cut or damaged: {what[:200]}") from None


class _Collector:
    """The wanted fields of one topic's messages, in columns."""

    def __init__(self, path: Path, topic: str, fields: list[str]) -> None:
        self._where = f"{path}: topic {topic!r}"
        self._fields = [(field, field.split(".")) for field in fields]
        self._times = array("q")
        self._values = [array("d") for _ in fields]
        self._decode: dict[int, Callable[[bytes], Any]] = {}  # by channel: a topic may have several

    def add(self, schema: Schema | None, channel: Channel, time: int, data: bytes) -> None:
        """Take one message."""
        decode = self._decode.get(channel.id)
        if decode is None:
            decode = self._decode[channel.id] = self._decoder(schema, channel)
        message = decode(data)
        self._times.append(time)
        for (field, steps), values in zip(self._fields, self._values, strict=True):
            values.append(self._number(message, field, steps))

    def source(self) -> Source:
        """What was collected."""
        time_s = np.frombuffer(self._times, np.int64) / 1e9
        columns = (np.frombuffer(values, np.float64) for values in self._values)
        return Source(time_s, dict(zip((field for field, _ in self._fields), columns, strict=True)))

    def _decoder(self, schema: Schema | None, channel: Channel) -> Callable[[bytes], Any]:
        if channel.message_encoding == "json":
            return json.loads
        found = DecoderFactory().decoder_for(channel.message_encoding, schema)
        if found is None:
            raise BadInput(f"{self._where}: encoding {channel.message_encoding!r}; allowed: protobuf, json")
        return found

    def _number(self, message: Any, field: str, steps: list[str]) -> float:
        value = message
        try:
            for step in steps:
                value = _step(value, step)
            return float("nan") if value is None else float(value)
        except (AttributeError, LookupError, TypeError, ValueError):
            raise BadInput(f"{self._where}: no number {field!r} in its messages") from None


def _step(value: Any, name: str) -> Any:
    if isinstance(value, dict):
        return value[name]
    return value[int(name)] if name.isdigit() else getattr(value, name)
