"""Message indexes: where in its chunk each message is, so that a viewer can seek."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from rig.log.layout import ROW, STARTS
from rig.log.schema import EVENTS, TOPICS

EVENT_CHANNEL: Final = TOPICS.index(EVENTS) + 1


class Packed(NamedTuple):
    """One chunk, compressed, and what its indexes say of it."""

    data: bytes
    crc: int  # of the bytes before compression
    size: int  # their number
    times: NDArray[np.uint64]  # of its rows, ns
    events: Sequence[tuple[int, int]]  # time in ns and offset of each event's record


_ENTRY: Final = np.dtype([("time", "<u8"), ("offset", "<u8")])


def _index_dtype(entries: int) -> np.dtype[Any]:
    return np.dtype(
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("bytes", "<u4"),
            ("entries", _ENTRY, (entries,)),
        ]
    )


def _indexes(channel: Any, entries: int) -> NDArray[Any]:
    made = np.zeros(np.size(channel), _index_dtype(entries))
    made["opcode"] = Opcode.MESSAGE_INDEX
    made["length"] = 6 + 16 * entries
    made["channel"] = channel
    made["bytes"] = 16 * entries
    return made


@lru_cache(maxsize=4)  # all chunks of a flight are of one length but the last
def _frame_indexes(frames: int) -> NDArray[Any]:
    made = _indexes(np.arange(1, EVENT_CHANNEL), frames)
    made["entries"]["offset"] = np.add.outer(STARTS, ROW * np.arange(frames))
    return made


def index_size(entries: int) -> int:
    """Bytes of a message index record."""
    return _index_dtype(entries).itemsize


def message_indexes(packed: Packed) -> Iterator[NDArray[np.uint8]]:
    """The bytes of the records that follow a chunk: for each channel, the time and offset of each message."""
    if len(packed.times):
        frames = _frame_indexes(len(packed.times)).copy()  # flights in other threads share the original
        frames["entries"]["time"] = packed.times
        yield frames.view(np.uint8)
    if packed.events:
        events = _indexes(EVENT_CHANNEL, len(packed.events))
        events["entries"][0] = np.array(packed.events, _ENTRY)
        yield events.view(np.uint8)
