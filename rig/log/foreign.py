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
from rig.core.text import choices, quoted, shorten
from rig.log.mcap_contents import Summary, messages, summary
from rig.log.mcap_messages import BROKEN, Budget, LimitedFile
from rig.log.message_fields import FieldPath, names_in
from rig.log.message_time import seconds
from rig.log.publishers import names_of, overlapping
from rig.log.signal_messages import FIELDS

_NAN: Final = float("nan")
_MALFORMED: Final = (*BROKEN, TypeError)  # the last: of a schema that protobuf does not take


class Source(NamedTuple):
    """One recorder: its time (m,), s, and its fields (m,) by name."""

    time_s: NDArray[np.float64]
    fields: Mapping[str, NDArray[np.float64]]


def topics(path: Path, lenient: bool = False) -> dict[str, str]:
    """Return the topics of an MCAP file in their order, with the names of their schemas; BadLog: cut or damaged.

    lenient : those that a cut or damaged file still declares
    """
    with opened(path) as file:
        return _topics(summary(file, lenient))


def encodings(path: Path) -> set[tuple[str, str]]:
    """Return encoding and schema of the messages that an MCAP file declares.  BadLog: it is none."""
    with opened(path) as file:
        contents = summary(file, lenient=True)
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


def read(path: Path, wanted: Mapping[str, set[str]], damage: list[str] | None = None) -> dict[str, Source]:
    """Read fields of messages by topic, ``angular_velocity.x`` for nested ones, ``data.0`` for an element.

    Time is the log time of each message, by which they are ordered.
    damage : a cut or damaged file is read as far as possible, and lines on what was left out are added; None: BadLog
    BadInput: no such topic or field, an encoding that is neither protobuf nor JSON; BadLog: a file that is none, or
    expands beyond its limits.
    """
    with opened(path) as file:
        contents = summary(file, damage is not None)
        present = names_of((number, channel.topic) for number, channel in sorted(contents.channels.items()))
        for topic in wanted:
            if topic not in present:
                there = shorten(", ".join(_topics(contents)), 1000) or "none"
                raise BadInput(f"{path}: no topic {quoted(topic)}; there are: {there}")
        collected = {topic: _Collector(path, topic, sorted(fields)) for topic, fields in wanted.items()}
        takers = {number: collected[topic] for topic in wanted for number in present[topic]}
        budget, bad = Budget(file), list[Exception]()
        for message in messages(file, contents, takers, budget, damage):
            channel = contents.channels[message.channel]
            schema = contents.schemas.get(channel.schema_id) if channel.schema_id else None
            try:
                budget.spend(takers[channel.id].add(schema, channel, message.time_ns, message.data))
            except _MALFORMED as error:
                if damage is None or not takers[channel.id].rows:
                    raise
                bad.append(error)
    if damage is not None and bad:
        damage.append(f"{len(bad)} messages cannot be decoded: left out; of the first: {_one_line(bad[0])}")
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
        raise BadLog(f"{path}: not an MCAP file, cut or damaged: {_one_line(error)}") from None


def _one_line(error: Exception) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:200]


class _Collector:
    """The wanted fields of one topic's messages, in columns."""

    def __init__(self, path: Path, topic: str, fields: list[str]) -> None:
        self._topic, self._where = topic, f"{path}: topic {quoted(topic)}"
        self._fields = [_Field(name) for name in fields]
        self._times, self._channels = array("Q"), array("H")
        self._decode: dict[int, Callable[[bytes], Any]] = {}  # by channel: a topic may have several

    @property
    def rows(self) -> int:
        """Messages taken."""
        return len(self._times)

    def add(self, schema: Schema | None, channel: Channel, time: int, data: bytes) -> int:
        """Take one message; how many bytes it takes."""
        decode = self._decode.get(channel.id)
        if decode is None:
            decode = self._decode[channel.id] = self._decoder(schema, channel)
        message = decode(data)
        numbers = [field.number(message, schema, self._where) for field in self._fields]
        self._times.append(time)  # behind all that may refuse the message
        self._channels.append(channel.id)
        for field, number in zip(self._fields, numbers, strict=True):
            if number is None:
                field.lack(len(self._times), message)
                number = _NAN
            field.values.append(number)
        return 8 + 8 * len(self._fields)

    def source(self) -> Source:
        """Return the collected numbers in the order of time; messages of one time in that of the file.

        BadInput: two publishers on the topic, messages that lack a field, which has no default.
        """
        self._refuse_two_publishers()
        for field in self._fields:
            field.refuse_lacking(self._where, self._times)
        times = np.frombuffer(self._times, np.uint64)
        columns = [np.frombuffer(field.values, np.float64) for field in self._fields]
        if (times[1:] < times[:-1]).any():
            order = np.argsort(times, kind="stable")
            times, columns = times[order], [column[order] for column in columns]
        time_s = times / 1e9
        return Source(time_s, dict(zip((field.name for field in self._fields), columns, strict=True)))

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


class _Field:
    """One field: its numbers, and which messages lack it."""

    def __init__(self, name: str) -> None:
        self.name, self._path = name, FieldPath(name)
        self.values = array("d")
        self._defaults: dict[int, float | None] = {}  # by schema
        self._lacking, self._first, self._there = 0, 0, list[str]()

    def number(self, message: Any, schema: Schema | None, where: str) -> float | None:
        """Return the number of a message, or its default; None: it has neither.  BadInput: no number."""
        try:
            value = self._path.value(message)
        except LookupError:
            return self._default(schema)
        try:
            value = seconds(value)
            return _NAN if value is None else float(value)
        except OverflowError:  # a whole number beyond all floats: not a sample
            return _NAN
        except (TypeError, ValueError):
            raise BadInput(f"{where}: no number {quoted(self.name)} in its messages") from None

    def lack(self, number: int, message: Any) -> None:
        """Note that message ``number``, from 1, lacks the field."""
        if not self._lacking:
            self._first, self._there = number, names_in(message)
        self._lacking += 1

    def refuse_lacking(self, where: str, times: array[int]) -> None:
        """Raise BadInput if messages lack the field: which, and how many."""
        if self._lacking == 0:
            return
        if self._lacking == len(times):
            there = f"; {choices(self.name, self._there)}" if self._there else ""
            raise BadInput(f"{where}: no number {quoted(self.name)} in its messages{there}")
        raise BadInput(
            f"{where}: {self._lacking} of {len(times)} messages lack {quoted(self.name)}, and their schema has no "
            f"default for it; the first is message {self._first}, at {(times[self._first - 1] - times[0]) / 1e9:.6g} s"
        )

    def _default(self, schema: Schema | None) -> float | None:
        key = 0 if schema is None else schema.id
        if key not in self._defaults:
            self._defaults[key] = self._path.default(schema)
        return self._defaults[key]
