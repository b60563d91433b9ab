"""A log block by block: what there is to ask a flight of any length, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from rig.core.blocks import in_blocks
from rig.core.event import Event
from rig.core.frame import Block, LaneBlock, LaneParts
from rig.log.scan import About, iter_parts


class Frames(NamedTuple):
    """Frames that follow each other: (n,) FLAT, TIMING, and LANES of a flight with servo actuators."""

    rows: Block
    timing: NDArray[Any]
    lanes: LaneBlock | None = None


def iter_blocks(path: Path, about: About) -> Iterator[Frames]:
    """Yield all frames of a log in blocks of util.blocks.ROWS, and fill ``about``; BadLog when damage is reached."""
    parts = iter_parts(path, about)
    yield from (Frames(*block) for block in in_blocks((part.rows, part.timing, part.lanes) for part in parts))


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

    def mapped(self) -> Frames:
        """Return all frames at once, on the disk and mapped into memory: what nobody reads costs none."""
        whole: list[Any] = []
        for first, block in _placed(self.blocks()):
            whole = whole or [None if part is None else _mapped(self.frames, part.dtype) for part in block]
            for target, part in zip(whole, block, strict=True):
                if target is not None:
                    target[first : first + len(part)].view(np.uint8)[:] = np.ascontiguousarray(part).view(np.uint8)
        return Frames(*whole)

    def blocks(self) -> Iterator[Frames]:
        """Yield all frames in blocks of util.blocks.ROWS; BadLog when the file has become another."""
        return iter_blocks(self.path, About())


def _placed(blocks: Iterator[Frames]) -> Iterator[tuple[int, Frames]]:
    first = 0
    for block in blocks:
        yield first, block
        first += len(block.rows)


def _mapped(frames: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return rows in a file without a name, which is gone with them."""
    with TemporaryFile(prefix="rig-") as file:
        return np.memmap(file, dtype, "w+", shape=(frames,)).view(np.ndarray)
