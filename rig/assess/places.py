"""Where the faults of a scenario sit: on channels of signals or discretes, on what references say, or elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rig.computer.analytic.sources import FROM_UNIT, second, source
from rig.computer.redundancy import Config
from rig.faults import Fault
from rig.faults.places import number, site
from rig.frame import INDEX, INERTIAL


class Place(NamedTuple):
    """Fault ``number``, from 0, of the scenario on one channel; ``signal`` and ``channel`` are columns of the frame.

    discrete : whether ``signal`` is the place of a discrete; changes : whether the sample is what it changes
    """

    number: int
    fault: Fault
    signal: int
    channel: int
    discrete: bool
    changes: bool


def on_channels(faults: Sequence[Fault]) -> Iterator[Place]:
    """Each fault on each channel that it changes, in the order of the scenario."""
    for i, fault in enumerate(faults):
        for name, channel in channels_of(fault):
            discrete = site(name) == "discrete"
            changes = discrete or fault.changes_samples  # a discrete that says bad of itself is not voted
            yield Place(i, fault, number(name), channel - 1, discrete, changes)


def channels_of(fault: Fault) -> list[tuple[str, int]]:
    """(signal, channel from 1) of all that a fault changes; empty for one that sits on no channel."""
    return [(point.place, point.channel) for point in fault.points if point.channel is not None]


def references_of(fault: Fault, config: Config, *, second_too: bool = False) -> list[int]:
    """The signals whose reference a fault can change: it sits on the reference, or on the unit that it is read from.

    second_too : their second reference counts as well
    """
    where = site(fault.signal)
    if where == "reference":
        return [number(fault.signal)]
    if where != "inertial":
        return []
    quantity = INERTIAL[number(fault.signal)]
    fed = [name for name, read in FROM_UNIT.items() if quantity in read]
    sources = (source, second) if second_too else (source,)
    return [INDEX[name] for name in fed if any(of(config.references, name) == "inertial" for of in sources)]
