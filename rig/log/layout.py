"""Where every byte of a chunk lies, and the way from there to frames; packing.py goes the other way.

The message records of one frame always have the same length and the same constant bytes (opcodes,
lengths, channel ids, protobuf tags): the ``TEMPLATE``.  What changes is moved between the frame and the
template by ``MOVES``, tables of byte offsets.  A chunk is a run of such rows, then the records of its events.

No kernels here: a log is read before they would be loaded.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import FRAME, TIMING, Block
from rig.log.record import Value, frame_record
from rig.log.schema import FRAME_TOPICS

Moves = tuple[NDArray[np.uint64], NDArray[np.uint64]]  # of eight bytes, of one byte: rows (in source, in row)


def _moves(source: str, placed: list[tuple[int, Value]]) -> Moves:
    words: list[tuple[int, int]] = []
    octets: list[tuple[int, int]] = []
    for at, value in placed:
        if value.source == source and value.width == 8:
            words.append((value.offset, at))
        elif value.source == source:
            octets += [(value.offset + i, at + i) for i in range(value.width)]
    return (
        np.array(words, np.uint64).reshape(-1, 2),
        np.array(octets, np.uint64).reshape(-1, 2),
    )


def _lay_out() -> tuple[NDArray[np.uint8], list[int], dict[str, Moves]]:
    """The template, the offset of each topic's record in it, and the moves for each source."""
    template = bytearray()
    starts: list[int] = []
    placed: list[tuple[int, Value]] = []
    for topic in FRAME_TOPICS:
        starts.append(len(template))
        for piece in frame_record(topic):
            if isinstance(piece, bytes):
                template += piece
            else:
                placed.append((len(template), piece))
                template += bytes(piece.room)
    moves = {source: _moves(source, placed) for source in ("frame", "timing", "derived")}
    return np.frombuffer(bytes(template), np.uint8), starts, moves


TEMPLATE, STARTS, MOVES = _lay_out()
ROW: Final = len(TEMPLATE)  # bytes of one frame before compression
_OPENING: Final = TEMPLATE[:11]  # opcode, length and channel of the first record: marks a row
_ZERO: Final = 8  # the last byte of that length
_SEQUENCE: Final = range(11, 15)  # which is the frame's number


def _origins(source: str, dtype: np.dtype[Any]) -> NDArray[np.intp]:
    """For every byte of a record of ``dtype`` its place in a packed row; padding comes from a zero."""
    origins = np.full(dtype.itemsize, _ZERO, np.intp)
    words, octets = MOVES[source]
    for i in range(8):
        origins[words[:, 0] + i] = words[:, 1] + i
    origins[octets[:, 0]] = octets[:, 1]
    return origins


_OF_FRAME, _OF_TIMING = _origins("frame", FRAME), _origins("timing", TIMING)
_OF_FRAME[: len(_SEQUENCE)] = _SEQUENCE


def unpack(packed: NDArray[np.uint8]) -> tuple[Block, NDArray[np.void]]:
    """The FRAME rows and their TIMING of ``packed`` (n, ROW), bit for bit what ``packing.pack`` was given."""
    return _gathered(packed, _OF_FRAME, FRAME), _gathered(packed, _OF_TIMING, TIMING)


def _gathered(packed: NDArray[np.uint8], origins: NDArray[np.intp], dtype: np.dtype[Any]) -> NDArray[np.void]:
    rows = np.empty(len(packed), dtype)
    to = rows.view(np.uint8).reshape(len(packed), dtype.itemsize)
    np.take(packed, origins, axis=1, out=to, mode="clip")  # "raise" would copy; the interpreter is free meanwhile
    return rows


def rows_in(data: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The run of rows at the beginning of a chunk's bytes, as (n, ROW)."""
    whole = len(data) // ROW
    candidates = data[: whole * ROW].reshape(whole, ROW)
    ours = (candidates[:, : len(_OPENING)] == _OPENING).all(axis=1)
    return candidates[: whole if ours.all() else int(ours.argmin())]


def log_times(frames: NDArray[np.int64], rate_hz: float) -> NDArray[np.uint64]:
    """Simulation time of frames in ns, rounded to the nearest."""
    return np.rint(frames * 1e9 / rate_hz).astype(np.uint64)
