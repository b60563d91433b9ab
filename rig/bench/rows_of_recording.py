"""From recorded channels to rows of the frame, and from rows to votes, a block of rows at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from rig.bench.drive import ROWS
from rig.core.blocks import room
from rig.core.frame import Block, Ilm, Rows, S
from rig.log.recordings.recording import Bytes, Samples

FIELDS: Final = ("voted", "level", "pattern", "decided_by", "trend_high", "trend_low", "reference_usable")
# What a flight's log has besides, and a vote by its scenario gives again.
FLIGHT_FIELDS: Final = ("common_mode", "source", "reset")
_OF_EACH_SIGNAL: Final = ("channels", "valid", "ilm", "reset", "reference", "second_reference")  # what a manager reads


def blocks(kind: Rows, n: int) -> Iterator[tuple[slice, Block]]:
    """Yield parts of n rows, and blank rows for each, in the same memory."""
    size = max(1, ROWS * S // max(kind.signals, S))
    memory = kind.block(size)
    for start in range(0, n, size):
        part = slice(start, min(start + size, n))
        block = memory[: part.stop - start]
        block["frame"], block["acting"] = np.arange(part.start, part.stop), 0
        block["channels"] = block["reference"] = block["second_reference"] = np.nan
        block["valid"] = 1
        block["ilm"] = block["discrete_ilm"] = Ilm.ABSENT
        yield part, block


class Columns(NamedTuple):
    """Votes and states of one signal or discrete, (n,) each."""

    fields: dict[str, Any]
    states: list[Bytes]
    prefix: str  # of the fields in a row

    @classmethod
    def of(cls, n: int, fitted: int, names: Sequence[str], prefix: str = "") -> Columns:
        """Return room for n rows of ``channels`` channels and of the fields ``names``."""
        answers = np.empty((fitted + len(names), n), np.uint8)
        fields: dict[str, Any] = dict(zip(names, answers[fitted:], strict=True))
        if not prefix:
            fields["voted"] = room((n,))
        return cls(fields, [*answers[:fitted]], prefix)

    def take(self, block: Block, i: int, part: slice) -> None:
        """Store the votes and states of ``part`` for signal or discrete i of the block."""
        for name, column in self.fields.items():
            column[part] = block[f"{self.prefix}{name}"][:, i]
        for c, column in enumerate(self.states):
            column[part] = block[f"{self.prefix}state"][:, i, c]


def put(block: Block, i: int, samples: Samples, part: slice, second: bool) -> None:
    """Write the samples of ``part`` as signal i of the block."""
    for c, column in enumerate(samples.channels):
        block["channels"][:, i, c] = column[part]
    for c, flags in enumerate(samples.ilm or ()):
        block["ilm"][:, i, c] = flags[part]
    for c, flags in enumerate(samples.valid or ()):
        block["valid"][:, i, c] = flags[part]
    if samples.reference is not None:
        block["reference"][:, i] = samples.reference[part]
    if second and samples.second_reference is not None:
        block["second_reference"][:, i] = samples.second_reference[part]


def repeat_first(block: Block, signals: int) -> None:
    """Write the samples of the first signal as those of every signal of the block from number ``signals`` on.

    A manager of the user's own is written for the signals of a flight: it gets as many, and none without channels.
    """
    for name in _OF_EACH_SIGNAL:
        block[name][:, signals:] = block[name][:, :1]


def put_discrete(block: Block, d: int, samples: Samples, part: slice) -> None:
    """Write the samples of ``part`` as discrete d of the block; an empty one is invalid."""
    valid = block["discrete_valid"]
    for c, column in enumerate(samples.channels):
        block["discrete_channels"][:, d, c], valid[:, d, c] = column[part] == 1, ~np.isnan(column[part])
    for c, flags in enumerate(samples.valid or ()):
        valid[:, d, c] &= flags[part] != 0
    for c, flags in enumerate(samples.ilm or ()):
        block["discrete_ilm"][:, d, c] = flags[part]
