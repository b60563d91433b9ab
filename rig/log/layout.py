"""Where every byte of a chunk lies, and the way from there to frames; packing.py goes the other way.

The message records of one frame always have the same length and the same constant bytes (opcodes,
lengths, channel ids, protobuf tags): the ``TEMPLATE``.  What changes is moved between the frame and the
template by ``MOVES``, tables of byte offsets.  A chunk is a run of such rows, then the records of its events.

No kernels here: a log is read before they would be loaded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import FLAT, TIMING, Block, Ilm, State
from rig.frame.fields import FIELD
from rig.log.record import Value, frame_record
from rig.log.schema import FRAME_TOPICS, MESSAGES, Field

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


class Layout:
    """The rows of a chunk, for the fields that each of our messages has, in the order of their numbers.

    ``template``: a row but for its values; ``starts``: of each topic's record in it; ``moves``: of each source into it;
    ``absent``: numbers of FLAT that the messages do not have, field and index
    """

    def __init__(self, messages: Mapping[str, Sequence[Field]]) -> None:
        template, placed = bytearray(), list[tuple[int, Value]]()
        self.starts: list[int] = []
        for topic in FRAME_TOPICS:
            self.starts.append(len(template))
            for piece in frame_record(topic, messages.get(topic.message, ())):
                if isinstance(piece, bytes):
                    template += piece
                else:
                    placed.append((len(template), piece))
                    template += bytes(piece.room)
        self.template = np.frombuffer(bytes(template), np.uint8)
        self.moves = {source: _moves(source, placed) for source in ("frame", "timing", "derived")}
        self.absent = [
            (field.source, field.index)
            for name, message in MESSAGES.items()
            for field in message.fields
            if field not in messages[name] and field.source in FIELD
        ]
        self._of_frame, self._of_timing = self._origins("frame", FLAT), self._origins("timing", TIMING)
        self._of_frame[: len(_SEQUENCE)] = _SEQUENCE

    def _origins(self, source: str, dtype: np.dtype[Any]) -> NDArray[np.intp]:
        """For every byte of a record of ``dtype`` its place in a packed row; what has none comes from a zero."""
        origins = np.full(dtype.itemsize, _ZERO, np.intp)
        words, octets = self.moves[source]
        for i in range(8):
            origins[words[:, 0] + i] = words[:, 1] + i
        origins[octets[:, 0]] = octets[:, 1]
        return origins

    def unpack(self, packed: NDArray[np.uint8]) -> tuple[Block, NDArray[np.void]]:
        """The FLAT rows and their TIMING of ``packed`` (n, row), bit for bit what ``packing.pack`` was given."""
        rows = _gathered(packed, self._of_frame, FLAT)
        if self.absent:
            self._fill(rows)
        return rows, _gathered(packed, self._of_timing, TIMING)

    def _fill(self, rows: Block) -> None:
        """Give ``rows`` what an older log does not say: no number; a discrete whose channels are valid, unmonitored."""
        for name, index in self.absent:
            fill = np.nan if FIELD[name].kind == "number" else 0
            if name == "discrete_ilm":
                fill = Ilm.ABSENT
            rows[name][(..., *index)] = fill
        if ("discrete_valid", (0,)) in self.absent:
            rows["discrete_valid"] = rows["discrete_state"] != State.ABSENT

    def rows_in(self, data: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The run of rows at the beginning of a chunk's bytes, as (n, row)."""
        size = len(self.template)
        whole = len(data) // size
        candidates = data[: whole * size].reshape(whole, size)
        ours = (candidates[:, :_OPENING] == self.template[:_OPENING]).all(axis=1)
        return candidates[: whole if ours.all() else int(ours.argmin())]


_OPENING: Final = 11  # bytes: opcode, length and channel of the first record, which mark a row
_ZERO: Final = 8  # the last byte of that length
_SEQUENCE: Final = range(11, 15)  # which is the frame's number


def _gathered(packed: NDArray[np.uint8], origins: NDArray[np.intp], dtype: np.dtype[Any]) -> NDArray[np.void]:
    rows = np.empty(len(packed), dtype)
    to = rows.view(np.uint8).reshape(len(packed), dtype.itemsize)
    np.take(packed, origins, axis=1, out=to, mode="clip")  # "raise" would copy; the interpreter is free meanwhile
    return rows


LAYOUT: Final = Layout({name: message.fields for name, message in MESSAGES.items()})  # of what we write
TEMPLATE, STARTS, MOVES = LAYOUT.template, LAYOUT.starts, LAYOUT.moves
ROW: Final = len(TEMPLATE)  # bytes of one frame before compression


def log_times(frames: NDArray[np.int64], rate_hz: float) -> NDArray[np.uint64]:
    """Simulation time of frames in ns, rounded to the nearest."""
    return np.rint(frames * 1e9 / rate_hz).astype(np.uint64)
