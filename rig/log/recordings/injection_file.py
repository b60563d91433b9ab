"""FILE of ``rig vote --inject``: ``[[faults]]`` as in a scenario, ``seed``; a scenario itself, by path or bundled name.

A recording has no truth, inertial unit, surfaces, computed references or votes before it is voted, and
perhaps no in-line monitors: faults and triggers that need one of these are refused.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from pydantic import Field

from rig.core.errors import BadInput
from rig.core.frame import MOST_FAULTS
from rig.core.settings import Settings, build, read_toml, unknown_key
from rig.core.text import choices, quoted
from rig.log.recordings.recording import Recording
from rig.log.recordings.stamps import digits
from rig.scenario.scenario import Scenario, find
from rig.world.faults.places import site

Table = Mapping[str, Any]
_ICE: Final = {
    "pitot_icing": lambda _: ["static_pressure", "dynamic_pressure"],
    "vane_icing": lambda fault: fault.get("vanes", ["angle_of_attack"]),
}
_NEEDS: Final = {"when": "the truth or votes", "on": "votes"}


class InjectionFile(Settings):
    """The file; each fault is checked when the recording is known."""

    seed: int = Field(default=0, ge=0, lt=2**63)
    faults: list[dict[str, Any]] = Field(min_length=1, max_length=MOST_FAULTS)


def read_injection(name: str) -> tuple[InjectionFile, str]:
    """Return faults and seed of the file, or of the bundled scenario, ``name``, and its path; BadInput in one line."""
    path = find(name)
    data = read_toml(path)
    for key in data:
        if key not in Scenario.model_fields:
            raise BadInput(f"{path}: {unknown_key(key, InjectionFile, 'docs/reference/recordings.md')}")
    mine = {key: value for key, value in data.items() if key in InjectionFile.model_fields}
    if not mine.get("faults"):
        raise BadInput(f"{path}: no [[faults]] to inject")
    return build(InjectionFile, mine, str(path)), str(path)


@dataclass(frozen=True, slots=True)
class Injected:
    """One channel under a fault; rows from 0, of the recording that it was injected into."""

    fault: int  # its place in the file, from 0
    label: str
    kind: str
    signal: str
    channel: int
    first: int | None  # row in which it first acts; None: it never began
    last: int | None


@dataclass(frozen=True, slots=True)
class Fitted:
    """Places of faults in a recording: the channels of each voted signal and discrete."""

    signals: dict[str, int]
    discretes: dict[str, int]

    def check(self, i: int, fault: Table, recording: Recording) -> None:
        """Raise ValueError, one line, if fault ``i`` needs something that the recording does not have."""
        for key in (key for key in _NEEDS if key in fault):
            allowed = "start_s, after, rate_per_hour"
            raise ValueError(
                f"faults.{i}.{key}: needs {_NEEDS[key]}, which a recording does not have; allowed triggers: {allowed}"
            )
        names = [fault[key] for key in ("signal", "source") if isinstance(fault.get(key), str)]
        for name in names:
            self._check_place(i, name)
        if names and isinstance(fault.get("channels"), list):
            self._check_channels(i, names, fault["channels"])
        if (kind := fault.get("kind")) in _ICE:
            self._check_ice(i, str(kind), _ICE[str(kind)](fault))
        _check_monitor(i, fault, recording)
        _check_times(i, fault, recording)

    def _check_place(self, i: int, name: str) -> None:
        if name in self.signals or name in self.discretes:
            return
        accepted = choices(name, (*self.signals, *self.discretes))
        if site(name) not in ("channel", "discrete"):
            raise ValueError(f"faults.{i}.signal: {quoted(name)}: a recording has only channels, {accepted}")
        raise ValueError(f"faults.{i}.signal: {quoted(name)} is not voted in the recording, {accepted}")

    def _check_channels(self, i: int, names: list[str], channels: list[Any]) -> None:
        for name in names:
            fitted = {**self.discretes, **self.signals}[name]
            if any(isinstance(channel, int) and channel > fitted for channel in channels):
                raise ValueError(f"faults.{i}.channels: {name} has {fitted} channels, got {quoted(channels)}")

    def _check_ice(self, i: int, kind: str, needed: Any) -> None:
        missing = [str(name) for name in needed if name not in self.signals] if isinstance(needed, list) else []
        if missing:
            raise ValueError(f"faults.{i}: {kind} needs {' and '.join(missing)}, which the recording does not have")


def _check_monitor(i: int, fault: Table, recording: Recording) -> None:
    """Refuse a fault that speaks of in-line monitors where there are none."""
    if fault.get("kind") != "ilm" and not fault.get("seen_by_ilm"):
        return
    name = fault.get("signal")
    samples = recording.signals.get(str(name)) or recording.discretes.get(str(name))
    if samples is not None and samples.ilm is None:
        what = "kind" if fault.get("kind") == "ilm" else "seen_by_ilm"
        raise ValueError(f"faults.{i}.{what}: {name} has no in-line monitor in the recording")


def _check_times(i: int, fault: Table, recording: Recording) -> None:
    """Check ``start_s`` and ``end_s``, times of the recording, which may be those of a calendar."""
    first, last = float(recording.time_s[0]), float(recording.time_s[-1])
    start, end = number(fault, "start_s"), number(fault, "end_s")
    if start is not None and not first <= start <= last:
        within = f"the recording is from {digits(first)} to {digits(last)} s"
        raise ValueError(f"faults.{i}.start_s: {within}, got {digits(start)}")
    if end is not None and end <= max(first, start or 0.0):
        after = digits(max(first, start or 0.0))
        raise ValueError(f"faults.{i}.end_s: {digits(end)} is not after start_s or the first row, {after}")


def number(fault: Table, key: str) -> float | None:
    """Return a finite number of the table, None when there is none (what else is there the model refuses)."""
    value = fault.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return float(value)
