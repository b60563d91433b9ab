"""ASAM MDF 4 measurement files (.mf4), read by asammdf: a topic is a channel group.

Names of channels are those of the user, so no preset can know them: a mapping names them.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.core.errors import BadInput
from rig.log.foreign import Source
from rig.log.recordings.formats.contents import LogContents, OpenLog, Topic, extra_needed, reading, topic_of
from rig.log.recordings.stamps import Floats

FORMAT: Final = "MDF 4"
MAGIC: Final = b"MDF     "
_KINDS: Final = "fiub"  # of numbers


class MdfLog(OpenLog):
    """A measurement file: every channel group with numbers."""

    def __init__(self, path: Path) -> None:
        """Read the groups and their times.  BadInput: asammdf is not installed, no MDF, no channel of numbers."""
        self._path = path
        self._places: dict[str, dict[str, tuple[int, int]]] = {}  # group and index of each channel, by topic
        topics = []
        with reading(path, FORMAT), _library(path)(str(path)) as file:
            for number in range(len(file.groups)):
                channels = dict(_channels(file, number))
                time_s = np.asarray(file.get_master(number), np.float64) if channels else np.empty(0)
                if len(time_s):
                    topic = topic_of(f"group_{number}", "", time_s, {name: of[1] for name, of in channels.items()})
                    self._places[topic.name] = {name: (number, of[0]) for name, of in channels.items()}
                    topics.append(topic)
        if not topics:
            raise BadInput(f"{path}: no channel of numbers")
        self._contents = LogContents(FORMAT, "", tuple(topics))

    @property
    def contents(self) -> LogContents:
        """Return what the file holds."""
        return self._contents

    def source(self, topic: Topic, fields: Collection[str]) -> Source:
        """Return time [s] and the ``fields``."""
        places = self._places[topic.name]
        made: dict[str, Floats] = {}
        with reading(self._path, FORMAT), _library(self._path)(str(self._path)) as file:
            time_s = np.asarray(file.get_master(next(iter(places.values()))[0]), np.float64)
            for name in fields:
                group, index = places[name]
                signal = file.get(group=group, index=index, ignore_invalidation_bits=False)
                values = np.full(len(time_s), np.nan)
                values[np.searchsorted(time_s, signal.timestamps)] = signal.samples  # an invalid sample is missing
                made[name] = values
        return Source(time_s, made)


def _library(path: Path) -> Any:
    """Return the class that reads a file.  BadInput: asammdf is not installed."""
    try:
        from asammdf import MDF
    except ImportError:
        raise extra_needed(path, FORMAT, "mdf") from None
    return MDF


def _channels(file: Any, number: int) -> list[tuple[str, tuple[int, str]]]:
    """Return name, index and unit of the channels of a group that are numbers, without the time."""
    master = file.masters_db.get(number)
    made: dict[str, tuple[int, str]] = {}
    for index, channel in enumerate(file.groups[number].channels):
        if index == master:
            continue
        signal = file.get(group=number, index=index, record_offset=0, record_count=1)
        if signal.samples.dtype.kind in _KINDS and signal.samples.ndim == 1:
            made.setdefault(channel.name, (index, signal.unit or ""))
    return list(made.items())
