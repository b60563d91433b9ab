"""Commands to readmit failed channels: their table in a file, and the fields of the rows that carry them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pydantic import Field, field_validator

from rig.core.frame import CHANNELS, DISCRETE_INDEX, INDEX, Block, to_frame
from rig.core.settings import Settings
from rig.core.text import choices


class Reset(Settings):
    """A reset command: failed channels that have agreed long enough are readmitted, the others stay out."""

    at_s: float = Field(ge=0)
    signal: str
    channels: list[int] = Field(default=[1, 2, 3, 4], min_length=1)

    @field_validator("signal")
    @classmethod
    def _known(cls, name: str) -> str:
        names = (*INDEX, *DISCRETE_INDEX)
        if name not in names:
            raise ValueError(f"unknown signal, {choices(name, names, 'rig signals')}")
        return name

    @field_validator("channels")
    @classmethod
    def _numbered(cls, channels: list[int]) -> list[int]:
        if any(not 1 <= channel <= CHANNELS for channel in channels):
            raise ValueError(f"channels are numbers from 1 to {CHANNELS}, got {channels}")
        return channels


def command(rows: Block, resets: Sequence[Reset], rate_hz: float) -> None:
    """Add the reset commands to ``rows``, whose frames follow each other: each to the first frame not before it."""
    for reset in resets:
        k = to_frame(reset.at_s, rate_hz) - int(rows["frame"][0])
        if 0 <= k < len(rows):
            field, index = ("reset", INDEX) if reset.signal in INDEX else ("discrete_reset", DISCRETE_INDEX)
            rows[field][k, index[reset.signal]] |= bits(reset.channels)


def bits(channels: Iterable[int]) -> int:
    """Return the byte of commanded channels, which count from 1."""
    return sum(1 << (channel - 1) for channel in set(channels))
