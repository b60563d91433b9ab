"""Where the faults of a scenario sit: on channels of signals, on what references read, or elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from rig.frame import INDEX

MONITOR_KINDS = ("ilm",)  # they change what a channel says of itself, never its sample


class Place(NamedTuple):
    """Fault ``index`` of the scenario on one channel; ``signal`` and ``channel`` are columns of the frame."""

    index: int
    fault: Any
    signal: int
    channel: int
    spoils: bool  # whether the sample is what it changes


def on_channels(faults: Sequence[Any]) -> Iterator[Place]:
    """Each fault on each channel that it changes, in the order of the scenario."""
    for index, fault in enumerate(faults):
        for name, channel in channels_of(fault):
            yield Place(index, fault, INDEX[name], channel - 1, fault.kind not in MONITOR_KINDS)


def channels_of(fault: Any) -> list[tuple[str, int]]:
    """(signal, channel from 1) of all that a fault changes; empty for one that sits on no channel."""
    return [(fault.signal, channel) for channel in fault.channels] if fault.signal in INDEX else []
