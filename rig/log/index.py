"""Message indexes: where in its chunk each message is, so that a viewer can seek."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray


class Run(NamedTuple):
    """Messages of neighbouring channels in a chunk, as many of each and at the same times."""

    first: int  # id of the first channel
    times: NDArray[np.uint64]  # (n,), ns
    offsets: NDArray[np.int64]  # (channels, n) of each message's record in the chunk


class Packed(NamedTuple):
    """One chunk, compressed, and what its indexes say of it."""

    data: bytes
    crc: int  # of the bytes before compression
    size: int  # their number
    runs: Sequence[Run]  # at most MOST_RUNS

    @property
    def span(self) -> tuple[int, int]:
        """Time of the first and of the last message, ns."""
        return min(int(run.times.min()) for run in self.runs), max(int(run.times.max()) for run in self.runs)


MOST_RUNS: Final = 2
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


@lru_cache(maxsize=4)  # all chunks of a flight are of one length but the last
def _blank(first: int, channels: int, entries: int) -> NDArray[Any]:
    made = np.zeros(channels, _index_dtype(entries))
    made["opcode"] = Opcode.MESSAGE_INDEX
    made["length"] = 6 + 16 * entries
    made["channel"] = np.arange(first, first + channels)
    made["bytes"] = 16 * entries
    return made


def index_size(entries: int) -> int:
    """Bytes of a message index record."""
    return _index_dtype(entries).itemsize


def message_indexes(run: Run) -> NDArray[np.uint8]:
    """The bytes of the records that follow a chunk: for each channel of a run, time and offset of each message."""
    made = _blank(run.first, *run.offsets.shape).copy()  # flights in other threads share the original
    made["entries"]["time"], made["entries"]["offset"] = run.times, run.offsets
    return made.view(np.uint8)
