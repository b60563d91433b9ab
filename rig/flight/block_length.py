"""The length of a block of rows, by what its flight is for.

A block costs half a millisecond whatever its length: it is handed to a thread, and to the log as a chunk or more.  A
viewer receives a block when it is full.  A killed flight loses two at most: the one that it fills and the one that is
being recorded.
"""

from __future__ import annotations

from typing import Final, Literal

from rig.scenario.scenario import Scenario

# paced by the clock; watched block by block, or by a unit; alone: as fast as can be, and read when it is over;
# memory: nothing is recorded, so nothing is lost
Use = Literal["paced", "watched", "alone", "memory"]
SECONDS: Final[dict[Use, float]] = {"paced": 0.5, "watched": 1.0, "alone": 4.0, "memory": 10.0}
ALONE_FRAMES: Final = 400  # more fall out of a core's own cache: 800 kB, 15 ms of work


def block_frames(scenario: Scenario, use: Use = "watched") -> int:
    """Return how many frames a block has, at least one."""
    frames = int(SECONDS[use] * scenario.rate_hz)
    if use == "alone":
        frames = max(min(frames, ALONE_FRAMES), int(SECONDS["watched"] * scenario.rate_hz))
    return max(1, frames)
