"""Any fault of a scenario, those that a key begins and ends, and what must hold of all of them together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING, Annotated, Any, Final, Union, get_args

from pydantic import Field, field_validator, model_validator

from rig.core.settings import LONGEST_S, Settings
from rig.core.text import choices, quoted
from rig.world.faults import computer_faults as computers
from rig.world.faults import data_path, kinds, systems
from rig.world.faults import link_faults as links
from rig.world.faults import servo_faults as actuators
from rig.world.faults.fault_settings import Triggered
from rig.world.faults.places import FLIGHT, Places

# Every kind by its name, in the order of the catalogue: as the classes stand in their modules.
KINDS: Final[dict[str, type[Triggered]]] = {
    get_args(model.model_fields["kind"].annotation)[0]: model
    for module in (kinds, data_path, systems, actuators, links, computers)
    for model in vars(module).values()
    if isinstance(model, type) and model.__module__ == module.__name__
    if issubclass(model, Triggered) and "kind" in model.model_fields
}
if TYPE_CHECKING:

    class Fault(Triggered):
        """A fault of any kind."""

        kind: str
        signal: str
        channels: list[int]
else:
    Fault = Annotated[Union[tuple(KINDS.values())], Field(discriminator="kind")]  # noqa: UP007 # of a tuple
RESET, PAUSE, END = "r", "p", "q"  # keys with a meaning of their own
_TRIGGERS: Final = ("start_s", "when", "on", "after", "rate_per_hour", "end_s")


def check(faults: Sequence[Fault], fitted: Mapping[str, int], places: Places = FLIGHT) -> None:
    """Raise ValueError, one line, where faults do not fit the aircraft or each other.

    fitted : number of channels of each signal and discrete
    """
    labels: set[str] = set()
    for i, fault in enumerate(faults):
        if fault.id is not None and fault.id in labels:
            raise ValueError(f"faults.{i}.id: {fault.id!r} is given twice")
        labels.add(fault.label)
    for i, fault in enumerate(faults):
        try:
            fault.check_fitted(fitted, places)
        except ValueError as error:
            raise ValueError(f"faults.{i}.{error}") from None
    order(faults)


def order(faults: Sequence[Fault]) -> list[int]:
    """Return indices of the faults, each behind the one that it comes after; ValueError: unknown, or a circle."""
    parents = [parent(faults, i) for i in range(len(faults))]
    sorter = TopologicalSorter({i: [] if after is None else [after] for i, after in enumerate(parents)})
    try:
        return list(sorter.static_order())
    except CycleError as error:
        names = ", which is after ".join(repr(faults[i].label) for i in reversed(error.args[1]))
        raise ValueError(f"faults.{error.args[1][0]}.after: circular: {names}") from None


def parent(faults: Sequence[Fault], i: int) -> int | None:
    """Return the index of the fault that fault ``i`` comes after; ValueError when there is none of that name."""
    after = faults[i].after
    if after is None:
        return None
    labels = [fault.label for fault in faults]
    if after not in labels:
        others = [repr(label) for j, label in enumerate(labels) if j != i]
        accepted = choices(after, others) if others else "allowed: none, there is no other fault"
        raise ValueError(f"faults.{i}.after: no fault {quoted(after)}, {accepted}")
    if labels.count(after) > 1:
        raise ValueError(f"faults.{i}.after: {after!r} names several faults; give the fault an id")
    return labels.index(after)


class LiveFault(Settings):
    """A fault that a key begins; the same key ends it."""

    key: str
    fault: Fault

    @model_validator(mode="before")
    @classmethod
    def _begun_by_its_key(cls, data: Any) -> Any:
        fault = data.get("fault") if isinstance(data, dict) else None
        if not isinstance(fault, Mapping):
            return data
        given = [name for name in _TRIGGERS if name in fault and fault[name] != LONGEST_S]
        if given:
            raise ValueError(f"fault.{given[0]}: not allowed, the key begins and ends the fault")
        return {**data, "fault": {**fault, "start_s": LONGEST_S}}  # never by itself

    @field_validator("key")
    @classmethod
    def _one_key(cls, key: str) -> str:
        if len(key) != 1 or not key.isalnum() or key in (RESET, PAUSE, END):
            raise ValueError(f"must be a letter or digit except {RESET}, {PAUSE} and {END}, got {key!r}")
        return key


def distinct_keys(live: Sequence[LiveFault]) -> None:
    """Raise ValueError if a key is given twice."""
    keys = [entry.key for entry in live]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:
        raise ValueError(f"live: the key {twice!r} is given twice")
