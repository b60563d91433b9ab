"""A log block by block: a flight of any length, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from rig.core.blocks import in_blocks, scratch
from rig.core.event import Event
from rig.core.frame import FLAT, RowParts, Table, new_block
from rig.log.scan import About, iter_parts

HELD_BYTES: Final = 128 * 1024 * 1024  # of the rows of a log that is decoded once; of a longer one as often as asked


def iter_blocks(path: Path, about: About, events: list[Event] | None = None) -> Iterator[Table]:
    """Yield all frames of a log in blocks of core.blocks.ROWS, and fill ``about``; BadLog when damage is reached.

    events : its events are added to it
    """
    noted = list[Event]() if events is None else events

    def arrays() -> Iterator[tuple[Any, Any, Any]]:
        for part in iter_parts(path, about):
            noted.extend(part.events)
            yield part.rows, part.beside, part.timing

    yield from (Table(*block) for block in in_blocks(arrays()))


@dataclass(slots=True, repr=False)
class LogFile:
    """A whole log that was checked once; its frames can be read repeatedly, from memory or the disk."""

    path: Path
    rate_hz: float
    metadata: dict[str, str]
    result: dict[str, str] | None  # None when the flight was not ended by the loop
    attachments: dict[str, bytes]
    events: list[Event]
    frames: int
    complete: bool  # the frames' numbers count from 0 on
    parts: RowParts  # of the second row, those that it has
    _held: list[Table] | None = field(default=None)  # all its blocks; None: they are too long for that

    @classmethod
    def open(cls, path: Path | str) -> Self:
        """Check the log at ``path``; BadLog, one line: it is missing, cut, damaged or no log of the rig."""
        about, events, frames, complete = About(), list[Event](), 0, True
        held: list[Table] | None = []
        for block in iter_blocks(Path(path), about, events):
            complete = complete and np.array_equal(block["frame"], np.arange(frames, frames + len(block)))
            frames += len(block)
            held = None if held is None or frames * FLAT.itemsize > HELD_BYTES else [*held, block]
        said = about.metadata, about.result, about.attachments
        return cls(Path(path), about.rate_hz, *said, events, frames, complete, about.parts, held)

    def table(self, fields: Sequence[str]) -> Table:
        """Return all frames at once; of a long log some ``fields`` of FLAT with servos and lanes, from a scratch file.

        It is mapped into memory, has no name, and is gone with the table.
        """
        kept = np.dtype([(name, FLAT[name]) for name in fields])
        whole: Table | None = None
        first = 0
        for block in self.blocks():
            if self._held is None:
                block = Table(_fields(block.rows, kept), block.beside)
            make = np.empty if self._held is not None else scratch
            whole = whole or block.each(lambda part, make=make: make((self.frames,), part.dtype))
            for target, part in zip(whole.arrays(), block.arrays(), strict=True):
                if target is not None:
                    target[first : first + len(part)].view(np.uint8)[:] = part.view(np.uint8)
            first += len(block)
        return Table(new_block(0)) if whole is None else whole

    def blocks(self) -> Iterator[Table]:
        """Yield all frames in blocks of core.blocks.ROWS; BadLog: the file has changed."""
        return iter_blocks(self.path, About()) if self._held is None else iter(self._held)


def _fields(rows: NDArray[Any], kept: np.dtype[Any]) -> NDArray[Any]:
    """Return some fields of ``rows`` as rows of their own."""
    chosen = np.empty(len(rows), kept)
    for name in kept.names or ():
        chosen[name] = rows[name]
    return chosen
