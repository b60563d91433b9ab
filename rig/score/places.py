"""Where the faults of a scenario sit: on channels of signals, on what the references say, or elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

from rig.frame import INDEX
from rig.redundancy import Config
from rig.redundancy.reference import source

MONITOR_KINDS: Final = ("ilm",)  # they change what a channel says of itself, never its sample


class Place(NamedTuple):
    """Fault ``number``, from 0, of the scenario on one channel; ``signal`` and ``channel`` are columns of the frame."""

    number: int
    fault: Any
    signal: int
    channel: int
    spoils: bool  # whether the sample is what it changes


def on_channels(faults: Sequence[Any]) -> Iterator[Place]:
    """Each fault on each channel that it changes, in the order of the scenario."""
    for number, fault in enumerate(faults):
        for name, channel in channels_of(fault):
            yield Place(number, fault, INDEX[name], channel - 1, fault.kind not in MONITOR_KINDS)


def channels_of(fault: Any) -> list[tuple[str, int]]:
    """(signal, channel from 1) of all that a fault changes; empty for one that sits on no channel."""
    points = getattr(fault, "points", [(fault.signal, channel) for channel in fault.channels])
    return [(signal, channel) for signal, channel in points if signal in INDEX and channel is not None]


def references_of(fault: Any, config: Config) -> list[int]:
    """The signals whose reference a fault can spoil: it sits on the reference, or on the unit that it is read from."""
    of, _, quantity = fault.signal.partition(".")
    if of == "reference":
        return [INDEX[quantity]]
    if of != "inertial":
        return []
    fed = [quantity.removesuffix("_rad_s")] if quantity.endswith("_rad_s") else ["dynamic_pressure"]
    return [INDEX[name] for name in fed if source(config.references, name) == "inertial"]
