"""ROS 2 bags: SQLite files, MCAP files with CDR, folders with or without metadata.yaml.

An instance is a topic; where messages of several frames (``header.frame_id``) share a topic, each frame is one.  A bag
does not store who published: two publishers of one topic and frame are noticed by stamps that come in turn or that
have two values, and such a topic is no channel.  Time is ``header.stamp``, or the time of the log where that is 0.
"""

from __future__ import annotations

import sqlite3
import struct
from array import array
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from rig.core.errors import BadInput
from rig.log.foreign import Source
from rig.log.publishers import publishers
from rig.log.recordings.formats.bags import Bag, bag
from rig.log.recordings.formats.cdr import KINDS, decoded
from rig.log.recordings.formats.contents import LogContents, OpenLog, Topic, topic_of
from rig.log.recordings.stamps import Floats

FORMAT: Final = "ROS 2"


class Ros2Log(OpenLog):
    """A bag: the messages of the types of KINDS."""

    def __init__(self, path: Path) -> None:
        """Read the messages.  BadInput: no bag, damaged, no topic of these types."""
        opened = bag(path)
        try:
            found, bad = _collected(opened)
        except sqlite3.Error as error:
            raise BadInput(f"{path}: damaged, or no {FORMAT} bag: {error}") from None
        except (OverflowError, TypeError, ValueError) as error:
            raise BadInput(f"{path}: damaged, or no {FORMAT} bag: {' '.join(str(error).split())[:200]}") from None
        self._rows: dict[str, tuple[Topic, Source]] = {}
        remarks: list[str] = []
        for topic, source in _topics(found, remarks):
            self._rows[topic.name] = topic, source
        if not self._rows:
            there = sorted(set(opened.kinds.values()))
            raise BadInput(f"{path}: no messages of {', '.join(KINDS)}; there are: {', '.join(there)[:200] or 'none'}")
        damage = [*opened.damage, *([f"{bad} messages are damaged: left out"] if bad else [])]
        topics = tuple(self._rows[name][0] for name in sorted(self._rows))
        self._contents = LogContents(FORMAT, "ros2-imu", topics, tuple(remarks), tuple(damage))

    @property
    def contents(self) -> LogContents:
        """Return what the log holds."""
        return self._contents

    def source(self, topic: Topic, fields: Collection[str]) -> Source:
        """Return time [s] and the ``fields``."""
        _, source = self._rows[topic.name]
        return Source(source.time_s, {name: source.fields[name] for name in fields})


class _Rows:
    """The messages of one frame on one topic."""

    def __init__(self, topic: str, kind: str, frame: bytes) -> None:
        self.topic, self.kind, self.frame = topic, kind, frame.decode("utf-8", "replace")
        self.stamps_ns, self.log_ns = array("q"), array("q")
        self.values = array("d")  # of one message behind those of another


def _collected(opened: Bag) -> tuple[list[_Rows], int]:
    """Return the messages by topic and frame, and how many are damaged."""
    rows: dict[tuple[str, str, bytes], _Rows] = {}
    bad = 0
    for raw in opened.raw(KINDS):
        try:
            message = decoded(raw.data, KINDS[raw.kind])
        except (struct.error, ValueError, IndexError):
            bad += 1
            continue
        key = raw.topic, raw.kind, message.frame
        of = rows.get(key)
        if of is None:
            of = rows[key] = _Rows(*key)
        of.stamps_ns.append(message.stamp_ns)
        of.log_ns.append(raw.log_ns)
        of.values.extend(message.values)
    return [rows[key] for key in sorted(rows)], bad


def _topics(found: list[_Rows], remarks: list[str]) -> Iterator[tuple[Topic, Source]]:
    """Yield each topic and its columns in the order of time; what is told of them is added to ``remarks``."""
    names = [rows.topic for rows in found]
    for rows in found:
        name = rows.topic if names.count(rows.topic) == 1 else f"{rows.topic}#{rows.frame}"
        units = dict(KINDS[rows.kind].units)
        stamps, values = np.frombuffer(rows.stamps_ns, np.int64), np.frombuffer(rows.values).reshape(-1, len(units))
        empty = stamps == 0
        if 2 * empty.sum() >= len(stamps):
            stamps = np.frombuffer(rows.log_ns, np.int64)
            remarks.append(f"{name}: header.stamp is 0: the time of the log is used")
        elif empty.any():
            stamps, values = stamps[~empty], values[~empty]
            remarks.append(f"{name}: {int(empty.sum())} messages without a stamp were left out")
        order = np.argsort(stamps, kind="stable")
        stamps, values = stamps[order], values[order]
        copies = np.append(False, (np.diff(stamps) == 0) & (values[1:] == values[:-1]).all(axis=1))
        if copies.any():
            stamps, values = stamps[~copies], values[~copies]
            remarks.append(f"{name}: {int(copies.sum())} copies of messages were left out")
        time_s: Floats = stamps / 1e9
        unusable = publishers(time_s)
        if unusable:
            remarks.append(f"{name}: {unusable}: no channel")
        topic = replace(topic_of(name, "", time_s, units, rows.frame), unusable=unusable)
        yield topic, Source(time_s, dict(zip(units, np.ascontiguousarray(values.T), strict=True)))
