"""Faults that a key begins and ends: the entries of a scenario's ``[[live]]``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from pydantic import field_validator, model_validator

from rig.faults.fault import Fault
from rig.settings import LONGEST_S, Settings

RESET, PAUSE, END = "r", "p", "q"  # keys with a meaning of their own
_TRIGGERS: Final = ("start_s", "when", "on", "after", "rate_per_hour", "end_s")


class LiveFault(Settings):
    """A fault that waits for its key; pressed again, it ends."""

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
            raise ValueError(f"fault.{given[0]}: the key begins and ends it")
        return {**data, "fault": {**fault, "start_s": LONGEST_S}}  # never by itself

    @field_validator("key")
    @classmethod
    def _one_key(cls, key: str) -> str:
        if len(key) != 1 or not key.isalnum() or key in (RESET, PAUSE, END):
            raise ValueError(f"a letter or digit, but not {RESET}, {PAUSE} or {END}, got {key!r}")
        return key


def distinct_keys(live: Sequence[LiveFault]) -> None:
    """ValueError when a key stands twice."""
    keys = [entry.key for entry in live]
    twice = next((key for key in keys if keys.count(key) > 1), None)
    if twice is not None:
        raise ValueError(f"live: the key {twice!r} stands twice")
