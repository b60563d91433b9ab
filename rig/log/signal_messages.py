"""Write signals and discretes of any name as rig.Signal and rig.Discrete messages, as in the log of a flight.

The messages of one kind and row have the same constant bytes in every row; what changes has fixed places.  So a row
is a numpy record with the tags as separate fields, and a chunk is a run of such rows of one kind.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final

import numpy as np
import zstandard
from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from numpy.typing import NDArray
from zlib_ng.zlib_ng import crc32

from rig.log.container import Container, Opening, Packed, Run, message_indexes
from rig.log.records import HEAD, MESSAGE_OPCODE, WIRE, tag
from rig.log.schema import DOUBLE, FIXED32, MESSAGES, SCHEMA_VERSION, Field, descriptors
from rig.log.writer import CHUNK_BYTES

ABOUT: Final = "rig.vote"  # name of the metadata record
FIELDS: Final = "fields"  # key of a channel's metadata
_NUMPY: Final = {DOUBLE: "<f8", FIXED32: "<u4"}  # all other kinds are varints of one byte

# For each topic, fields of FRAME by name: an array (n,), or one (n,) for each channel.  What is left out is
# NaN or zero; what the message has no field for is left out.
Columns = Mapping[str, NDArray[Any] | Sequence[NDArray[Any]]]
Topics = Mapping[str, tuple[str, Columns]]  # topic: message, columns


def write_topics(
    path: Path, times_ns: NDArray[np.uint64], topics: Topics, about: Mapping[str, str], name_fields: bool = False
) -> None:
    """Write an MCAP file with one message a row and topic; ``about`` becomes its metadata.

    name_fields : each channel's metadata names the fields that ``topics`` has, FIELDS

    ``times_ns`` (n,), not falling.  OSError when the disk does not take it.
    """
    messages = dict.fromkeys(message for message, _ in topics.values())
    groups = [_Group(i, message, topics) for i, message in enumerate(messages, 1)]
    first = 1
    for group in groups:
        group.first, first = first, first + len(group.columns)
    file, compressor = Container(path, _opening(groups, name_fields)), zstandard.ZstdCompressor(level=1)
    with closing(file):
        file.metadata(ABOUT, {**about, "schema_version": str(SCHEMA_VERSION)})
        room = max(1, CHUNK_BYTES // max(group.row_bytes for group in groups))
        rows = [group.template(room) for group in groups]
        for start in range(0, len(times_ns), room):
            part = slice(start, start + room)
            times = times_ns[part]
            for group, some in zip(groups, rows, strict=True):
                group.fill(some[: len(times)], start, times, part)
                file.chunk(group.packed(some[: len(times)], times, compressor))
        file.finish()


def _tag(field: Field, number: int) -> bytes:
    return tag(number, WIRE.get(field.kind, 0))


def _record(message: str) -> np.dtype[Any]:
    """Return the dtype of one message record: head, then each field's tag and value."""
    parts: list[tuple[str, str]] = [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
    for number, field in enumerate(MESSAGES[message], 1):
        parts += [(f"tag {field.name}", f"V{len(_tag(field, number))}"), (field.name, _NUMPY.get(field.kind, "u1"))]
    return np.dtype(parts)


class _Group:
    """The topics of one kind of message; their channels have ids from ``first`` on."""

    def __init__(self, schema: int, message: str, topics: Topics) -> None:
        self.schema, self.message, self.first = schema, message, 1
        self.columns = {topic: columns for topic, (kind, columns) in topics.items() if kind == message}
        self.fields = MESSAGES[message]
        self.record = _record(message)
        self.row_bytes = len(self.columns) * self.record.itemsize

    @property
    def ids(self) -> NDArray[np.int64]:
        """The ids of its channels."""
        return np.arange(self.first, self.first + len(self.columns))

    def template(self, rows: int) -> NDArray[Any]:
        """Return rows (rows, topics) of ``record`` with all that is constant."""
        made = np.zeros((rows, len(self.columns)), self.record)
        made["opcode"] = MESSAGE_OPCODE
        made["length"] = self.record.itemsize - (HEAD.size - struct.calcsize("<HIQQ"))
        made["channel"] = self.ids
        for number, field in enumerate(self.fields, 1):
            made[f"tag {field.name}"] = np.void(_tag(field, number))
            if field.kind == DOUBLE:
                made[field.name] = np.nan
        return made

    def packed(self, rows: NDArray[Any], times: NDArray[np.uint64], compressor: zstandard.ZstdCompressor) -> Packed:
        """Return rows of this kind as a chunk."""
        raw: Any = rows.view(np.uint8).reshape(-1)
        starts = np.arange(len(self.columns)) * self.record.itemsize
        offsets = np.add.outer(starts, np.arange(len(rows)) * self.row_bytes)
        return Packed(
            compressor.compress(raw), crc32(raw), len(raw), [Run(times, message_indexes(self.first, offsets))]
        )

    def fill(self, rows: NDArray[Any], first: int, times: NDArray[np.uint64], part: slice) -> None:
        """Fill ``rows`` with the columns' rows ``part``."""
        rows["sequence"] = np.arange(first, first + len(rows))[:, None]
        rows["log_time"] = rows["publish_time"] = times[:, None]
        for s, columns in enumerate(self.columns.values()):
            for field in self.fields:
                given = columns.get(field.source)
                if given is None:
                    continue
                if not field.index:
                    rows[field.name][:, s] = given[part]
                elif field.index[0] < len(given):
                    rows[field.name][:, s] = given[field.index[0]][part]


def _opening(groups: Sequence[_Group], name_fields: bool) -> Opening:
    schemas = [
        Schema(group.schema, descriptors(group.message).SerializeToString(), SchemaEncoding.Protobuf, group.message)
        for group in groups
    ]
    channels = []
    for group in groups:
        for i, (topic, columns) in zip(group.ids, group.columns.items(), strict=True):
            named = {FIELDS: ",".join(sorted(columns))} if name_fields else {}
            channels.append(Channel(int(i), topic, MessageEncoding.Protobuf, named, group.schema))
    return Opening.of(schemas, channels)
