"""A log block by block: what there is to ask a flight of any length, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from rig.core.blocks import in_blocks
from rig.core.event import Event
from rig.core.frame import LaneParts, Table, new_block
from rig.log.scan import About, iter_parts


def iter_blocks(path: Path, about: About) -> Iterator[Table]:
    """Yield all frames of a log in blocks of util.blocks.ROWS, and fill ``about``; BadLog when damage is reached."""
    parts = iter_parts(path, about)
    yield from (Table(*block) for block in in_blocks((part.rows, part.lanes, part.timing) for part in parts))


@dataclass(slots=True, repr=False)
class LogFile:
    """A whole log that stays on the disk: it was gone through once, and gives its frames as often as it is asked."""

    path: Path
    rate_hz: float
    metadata: dict[str, str]
    result: dict[str, str] | None  # None when the flight was not ended by the loop
    attachments: dict[str, bytes]
    events: list[Event]
    frames: int
    complete: bool  # the frames' numbers count from 0 on
    lanes: LaneParts  # what its rows of lanes have

    @classmethod
    def open(cls, path: Path | str) -> Self:
        """Go through the flight at ``path``; BadLog in one line when it is missing, foreign, cut or damaged."""
        about, events, frames, complete = About(), list[Event](), 0, True
        for part in iter_parts(Path(path), about):
            expected = np.arange(frames, frames + len(part.rows))
            complete = complete and np.array_equal(part.rows["frame"], expected)
            frames += len(part.rows)
            events += part.events
        said = about.metadata, about.result, about.attachments
        return cls(Path(path), about.rate_hz, *said, events, frames, complete, about.lanes)

    def mapped(self) -> Table:
        """Return all frames at once, on the disk and mapped into memory: what nobody reads costs none."""
        whole: Table | None = None
        first = 0
        for block in self.blocks():
            whole = whole or block.each(lambda part: _mapped(self.frames, part))
            for target, part in zip(whole.arrays(), block.arrays(), strict=True):
                if target is not None:
                    target[first : first + len(part)].view(np.uint8)[:] = np.ascontiguousarray(part).view(np.uint8)
            first += len(block)
        return Table(new_block(0)) if whole is None else whole

    def blocks(self) -> Iterator[Table]:
        """Yield all frames in blocks of util.blocks.ROWS; BadLog when the file has become another."""
        return iter_blocks(self.path, About())


def _mapped(frames: int, part: NDArray[Any]) -> NDArray[Any]:
    """Return rows like those of ``part`` in a file without a name, which is gone with them."""
    with TemporaryFile(prefix="rig-") as file:
        return np.memmap(file, part.dtype, "w+", shape=(frames, *part.shape[1:])).view(np.ndarray)
