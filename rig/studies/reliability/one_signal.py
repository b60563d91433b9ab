"""The basis of open-loop trials: one signal alone, on the recorded truth and references of a healthy flight.

Kernels take the fields of a row by name and loop over the signals of their parameters, so a row with the tested signal
alone runs through the same code.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.redundancy.managers import MANAGERS, Manager, manager_kind
from rig.core.errors import BadInput
from rig.core.frame import INDEX, Block, rows
from rig.flight import loop
from rig.scenario.scenario import Scenario
from rig.world import sensors
from rig.world.faults import Faults
from rig.world.sensors.kernel import MEMORY

ROW: Final = rows(1).frame


class OneSignal(NamedTuple):
    """The common part of all trials of a scenario: the records of the tested signal, blank to begin with."""

    signal: int
    params: NDArray[np.void]  # (1,) sensors.params.PARAMS, channel errors still to be drawn
    memory: NDArray[np.void]  # (1,) sensors.kernel.MEMORY
    line: NDArray[np.float64]  # (1, 4, frames) the latency's ring
    manager: Manager  # of the signal alone
    threshold: float
    latches: bool  # whether the manager keeps isolated channels out for the rest of the flight


def setting_key(data: Mapping[str, Any]) -> str:
    """Return the key of a scenario's table, which its faults, title and seed do not change."""
    given = {key: value for key, value in data.items() if key not in ("faults", "title", "seed")}
    return json.dumps(given, sort_keys=True, default=str)


def one_signal(scenario: Scenario, name: str, key: str | None = None) -> OneSignal:
    """Return the tested signal of a scenario.  BadInput: a manager or sensor that open-loop trials do not support.

    key : of the settings, see ``setting_key``; the same settings are made only once
    """
    params, p = _parameters(scenario, name) if key is None else _kept(_Settings(key, scenario), name)
    chosen = scenario.redundancy.manager
    return OneSignal(
        signal=INDEX[name],
        params=params.copy(),
        memory=np.zeros(1, MEMORY),
        line=np.zeros((1, 4, int(params["delay"].max()) + 2)),
        manager=Manager(chosen, p.copy()),
        threshold=float(p["threshold"][0]),
        latches=manager_kind(chosen).latches,
    )


@dataclass(frozen=True)
class _Settings:
    key: str
    scenario: Scenario = field(compare=False)


@lru_cache(maxsize=64)  # combinations of a plan have few settings, and all signals are made to find one
def _kept(settings: _Settings, name: str) -> tuple[NDArray[np.void], NDArray[np.void]]:
    return _parameters(settings.scenario, name)


def _parameters(scenario: Scenario, name: str) -> tuple[NDArray[np.void], NDArray[np.void]]:
    """Return PARAMS of the sensors and of the manager of one signal, (1,) each."""
    s, chosen = INDEX[name], scenario.redundancy.manager
    if chosen not in MANAGERS:
        raise BadInput(f"redundancy.manager: {chosen!r}: open-loop trials support {', '.join(MANAGERS)}")
    params = sensors.Sensors(scenario.sensors, scenario.rate_hz, scenario.streams()["sensors"]).params[s : s + 1].copy()
    for key, what in (("shares", "cross-axis errors"), ("drifts", "drift"), ("alarms", "false alarms of monitors")):
        if params[0][key] != 0:
            raise BadInput(f"sensors.{name}: open-loop trials do not support {what}")
    return params, loop.redundancy(scenario).manager.params[s : s + 1].copy()


def faults_of(scenario: Scenario, name: str) -> Faults:
    """Return a scenario's faults on one signal, at the first frame.  BadInput: one is elsewhere, or has a trigger."""
    made = loop.faults(scenario)
    for fault in scenario.faults:
        if fault.signal != name or {point.place for point in fault.points} != {name}:
            raise BadInput(f"faults: {fault.label}: open-loop trials need all faults on channels of one signal")
        if fault.when is not None or fault.on is not None or fault.rate_per_hour is not None:
            raise BadInput(f"faults: {fault.label}: in open-loop trials a fault must begin at a time or after another")
    made.targets["row"] = made.targets["source"] = 0
    return made


class Recording(NamedTuple):
    """A healthy flight: all signals, (N, S), frame by frame."""

    truth: NDArray[np.float64]
    reference: NDArray[np.float64]
    second_reference: NDArray[np.float64]


def recording(scenario: Scenario, seed: int) -> Recording:
    """Fly ``scenario`` without its faults, with ``seed``.  BadInput: the aircraft is lost before the end."""
    flown = loop.fly_rows(scenario.model_copy(update={"faults": [], "seed": seed}).trusted(scenario.trust))
    if len(flown) < scenario.frames:
        raise BadInput(
            f"the healthy flight ends after {len(flown)} of {scenario.frames} frames; trials need the whole flight"
        )
    return of_rows(flown)


def of_rows(flown: Block) -> Recording:
    """Return the recording of a flight's rows."""
    return Recording(*(np.ascontiguousarray(flown[name]) for name in Recording._fields))
