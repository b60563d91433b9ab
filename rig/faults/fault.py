"""Any fault of a scenario, and what must hold of all of them together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Annotated, Final, get_args

from pydantic import Field

from rig.faults import kinds, systems
from rig.faults.places import PLACES, site
from rig.text import choices, quoted

Fault = Annotated[
    kinds.Offset
    | kinds.Drift
    | kinds.Hardover
    | kinds.Scale
    | kinds.SignReversal
    | kinds.Stuck
    | kinds.Noise
    | kinds.Oscillation
    | kinds.Spikes
    | kinds.Intermittent
    | kinds.Dropout
    | kinds.Delay
    | kinds.FrameSkew
    | kinds.Quantisation
    | kinds.CrossTalk
    | kinds.DuplicateFrame
    | systems.IlmFault
    | systems.RateLoss
    | systems.PitotIcing
    | systems.VaneIcing,
    Field(discriminator="kind"),
]
# Every kind by its name, in the order of the catalogue.
KINDS: Final = {get_args(kind.model_fields["kind"].annotation)[0]: kind for kind in get_args(get_args(Fault)[0])}


def check(faults: Sequence[Fault], fitted: Mapping[str, int]) -> None:
    """ValueError, one line, where faults do not fit the aircraft or each other.

    fitted : number of channels of each signal
    """
    _check_labels(faults)
    for i, fault in enumerate(faults):
        for place, channel in fault.points:
            if channel is not None and channel > fitted[place]:
                raise ValueError(f"faults.{i}.channels: {place} has {fitted[place]} channels, got [{channel}]")
        if isinstance(fault, kinds.CrossTalk):
            _check_source(i, fault, fitted)
    order(faults)


def _check_labels(faults: Sequence[Fault]) -> None:
    labels: set[str] = set()
    for i, fault in enumerate(faults):
        if fault.id is not None and fault.id in labels:
            raise ValueError(f"faults.{i}.id: {fault.id!r} is used twice")
        labels.add(fault.label)


def _check_source(i: int, fault: kinds.CrossTalk, fitted: Mapping[str, int]) -> None:
    """Cross-talk comes from another place of the same sort and, on channels, from one that is fitted."""
    if fault.source not in PLACES or site(fault.source) != site(fault.signal) or fault.source == fault.signal:
        raise ValueError(f"faults.{i}.source: {fault.source!r} must be another place of the sort of {fault.signal}")
    beyond = [channel for channel in fault.channels if channel > fitted[fault.source]]
    if beyond:
        raise ValueError(f"faults.{i}.source: {fault.source} has {fitted[fault.source]} channels, got {beyond}")


def order(faults: Sequence[Fault]) -> list[int]:
    """Indices of the faults, each behind the one that it comes after; ValueError: unknown, or a circle."""
    parents = [parent(faults, i) for i in range(len(faults))]
    sorter = TopologicalSorter({i: [] if after is None else [after] for i, after in enumerate(parents)})
    try:
        return list(sorter.static_order())
    except CycleError as error:
        names = " after ".join(repr(faults[i].label) for i in reversed(error.args[1]))
        raise ValueError(f"faults.{error.args[1][0]}.after: faults wait for each other: {names}") from None


def parent(faults: Sequence[Fault], i: int) -> int | None:
    """The index of the fault that fault ``i`` comes after; ValueError when there is none of that name."""
    after = faults[i].after
    if after is None:
        return None
    labels = [fault.label for fault in faults]
    if after not in labels:
        others = [repr(label) for j, label in enumerate(labels) if j != i]
        known = choices(after, others) if others else "allowed: none, there is no other"
        raise ValueError(f"faults.{i}.after: no fault {quoted(after)}, {known}")
    if labels.count(after) > 1:
        raise ValueError(f"faults.{i}.after: {after!r} is the name of several faults; give the one an id")
    return labels.index(after)
