"""Reads numbers out of any MCAP file whose messages are protobuf or JSON."""

from __future__ import annotations

import json
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.records import Channel, Schema
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray

from rig.core.errors import BadInput, BadLog
from rig.core.text import quoted
from rig.log.decode import MALFORMED
from rig.log.mcap_messages import Budget, LimitedFile, Summary, messages, summary
from rig.log.message_time import seconds
from rig.log.publishers import names_of, overlapping
from rig.log.signal_messages import FIELDS

_MALFORMED: Final = (
    *MALFORMED,
    EOFError,
    TypeError,  # of a schema that protobuf does not take
    OverflowError,  # of a place beyond what a file can have
    RuntimeError,  # of the lz4 library; nested too deep
)


class Source(NamedTuple):
    """One recorder: its time (m,), s, and its fields (m,) by name."""

    time_s: NDArray[np.float64]
    fields: Mapping[str, NDArray[np.float64]]


def topics(path: Path) -> dict[str, str]:
    """Return the topics of an MCAP file in their order, with the names of their schemas; BadLog: cut or damaged."""
    with opened(path) as file:
        return _topics(summary(file))


def encodings(path: Path) -> set[tuple[str, str]]:
    """Return encoding and schema of the messages of an MCAP file.  BadLog as ``topics``."""
    with opened(path) as file:
        contents = summary(file)
    of = ((channel.message_encoding, contents.schemas.get(channel.schema_id)) for channel in contents.channels.values())
    return {(encoding, schema.name if schema else "") for encoding, schema in of}


def messages_of(path: Path) -> dict[str, tuple[str, list[str]]]:
    """Return the message of each topic that rig vote or a flight wrote, and the names of its fields.  BadLog."""
    with opened(path) as file:
        contents = summary(file)
    of = {c.topic: contents.schemas[c.schema_id] for c in contents.channels.values() if c.schema_id}
    ours = {topic: schema for topic, schema in of.items() if schema.name.startswith("rig.")}
    return {topic: (schema.name, _names(schema)) for topic, schema in ours.items()}


def _names(schema: Schema) -> list[str]:
    (message,) = FileDescriptorSet.FromString(schema.data).file[0].message_type
    return [field.name for field in message.field]


def fields(path: Path) -> dict[str, set[str]]:
    """Return the fields of FRAME in each topic of a flight's vote; none of another file.  BadLog as ``topics``."""
    with opened(path) as file:
        channels = summary(file).channels.values()
    return {
        channel.topic: set(channel.metadata[FIELDS].split(",")) for channel in channels if FIELDS in channel.metadata
    }


def _topics(contents: Summary) -> dict[str, str]:
    channels = [channel for _, channel in sorted(contents.channels.items())]
    named = {channel.topic: contents.schemas.get(channel.schema_id) for channel in channels}
    return {topic: schema.name if schema else "" for topic, schema in named.items()}


def read(path: Path, wanted: Mapping[str, set[str]]) -> dict[str, Source]:
    """Read fields of messages by topic, ``angular_velocity.x`` for nested ones, ``data.0`` for an element.

    Time is the log time of each message, by which they are ordered.  BadInput: no such topic or field, an encoding
    that is neither protobuf nor JSON; BadLog: a file that is cut or damaged, or expands beyond its limits.
    """
    with opened(path) as file:
        contents = summary(file)
        present = names_of((number, channel.topic) for number, channel in sorted(contents.channels.items()))
        for topic in wanted:
            if topic not in present:
                raise BadInput(f"{path}: no topic {topic!r}; there are: {', '.join(_topics(contents))}")
        collected = {topic: _Collector(path, topic, sorted(fields)) for topic, fields in wanted.items()}
        takers = {number: collected[topic] for topic in wanted for number in present[topic]}
        budget = Budget(file)
        for message in messages(file, contents, takers, budget):
            channel = contents.channels[message.channel]
            schema = contents.schemas[channel.schema_id] if channel.schema_id else None
            budget.spend(takers[channel.id].add(schema, channel, message.time_ns, message.data))
    return {topic: collector.source() for topic, collector in collected.items()}


@contextmanager
def opened(path: Path) -> Iterator[LimitedFile]:
    """Open an MCAP file; what its parts raise in the block is a BadLog."""
    try:
        with LimitedFile(path) as file:
            yield file
    except OSError as error:
        raise BadLog(f"{path}: cannot be read: {error.strerror}") from None
    except _MALFORMED as error:
        what = " ".join(str(error).split()) or type(error).__name__
        raise BadLog(f"{path}: not an MCAP file, cut or damaged: {what[:200]}") from None


class _Collector:
    """The wanted fields of one topic's messages, in columns."""

    def __init__(self, path: Path, topic: str, fields: list[str]) -> None:
        self._topic, self._where = topic, f"{path}: topic {topic!r}"
        self._fields = [(field, field.split(".")) for field in fields]
        self._times, self._channels = array("Q"), array("H")
        self._values = [array("d") for _ in fields]
        self._decode: dict[int, Callable[[bytes], Any]] = {}  # by channel: a topic may have several

    def add(self, schema: Schema | None, channel: Channel, time: int, data: bytes) -> int:
        """Take one message; how many bytes it takes."""
        decode = self._decode.get(channel.id)
        if decode is None:
            decode = self._decode[channel.id] = self._decoder(schema, channel)
        message = decode(data)
        self._times.append(time)
        self._channels.append(channel.id)
        for (field, steps), values in zip(self._fields, self._values, strict=True):
            values.append(self._number(message, field, steps))
        return 8 + 8 * len(self._values)

    def source(self) -> Source:
        """Return the collected numbers in the order of time; messages of one time in that of the file.

        BadInput: two publishers on the topic.
        """
        self._refuse_two_publishers()
        times = np.frombuffer(self._times, np.uint64)
        columns = [np.frombuffer(values, np.float64) for values in self._values]
        if (times[1:] < times[:-1]).any():
            order = np.argsort(times, kind="stable")
            times, columns = times[order], [column[order] for column in columns]
        time_s = times / 1e9
        return Source(time_s, dict(zip((field for field, _ in self._fields), columns, strict=True)))

    def _refuse_two_publishers(self) -> None:
        both = overlapping(self._channels, np.frombuffer(self._times, np.uint64) / 1e9) if self._channels else []
        if both:
            names = ", ".join(quoted(f"{self._topic}#{number}") for number in both)
            raise BadInput(f"{self._where}: {len(both)} publishers at a time; the mapping may name one of {names}")

    def _decoder(self, schema: Schema | None, channel: Channel) -> Callable[[bytes], Any]:
        if channel.message_encoding == "json":
            return json.loads
        decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
        if decode is None:
            raise BadInput(f"{self._where}: encoding {channel.message_encoding!r}; allowed: protobuf, json")
        return decode

    def _number(self, message: Any, field: str, steps: list[str]) -> float:
        value = message
        try:
            for step in steps:
                value = _step(value, step)
            value = seconds(value)
            return float("nan") if value is None else float(value)
        except OverflowError:  # a whole number beyond all floats: not a sample
            return float("nan")
        except (AttributeError, LookupError, TypeError, ValueError):
            raise BadInput(f"{self._where}: no number {field!r} in its messages") from None


def _step(value: Any, name: str) -> Any:
    if isinstance(value, dict):
        return value[name]
    return value[int(name)] if name.isdigit() else getattr(value, name)
