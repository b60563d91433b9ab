"""A log of a flight with the scenario that flew it, as needed for a replay."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig.core.errors import BadInput, BadLog
from rig.core.trust import Trust
from rig.log import LogFile, scenario_of, unit_of
from rig.scenario.pressed_keys import pressed
from rig.scenario.scenario import Scenario, from_resolved
from rig.world.faults.places import OF_LANES, site


@dataclass(frozen=True, slots=True)
class Recorded:
    """A log, which stays on the disk, and the scenario in it."""

    path: Path
    log: LogFile
    scenario: Scenario

    @property
    def what_if(self) -> str | None:
        """Return what was changed, when these frames were never flown but are the answer to a what if."""
        return self.log.metadata.get("what if")

    @property
    def unit(self) -> dict[str, Any]:
        """The unit under test that flew it, as ``settings.Unit.about``; empty if the built-in manager did."""
        return unit_of(self.log.metadata)


def refuse_link(scenario: Scenario) -> None:
    """Raise BadInput if the computers of the flight may have voted other samples than one computer does here."""
    computers = scenario.computers
    broken = next((fault.signal for fault in scenario.faults if site(fault.signal) in OF_LANES), None)
    if broken is not None or (computers.count > 1 and not computers.synchronised):
        why = f"a fault of {broken}" if broken else "clocks that run free"
        votes = f"one computer votes here, not the exchange of {computers.count}"
        raise BadInput(f"{votes}, and this flight has {why}; rig replay runs all again")


def recorded(path: Path | str, allow_code: bool = False) -> Recorded:
    """Go through the log at ``path``; BadInput or BadLog in one line when it cannot be replayed.

    allow_code : a manager class that the log names may be run
    """
    path = Path(path)
    log = LogFile.open(path)
    data = scenario_of(log.metadata, path)
    if not data:
        raise BadLog(f"{path}: no scenario in its metadata")
    scenario = from_resolved(data, f"{path}: its scenario", Trust(str(path), allow_code))
    scenario = pressed(scenario, log.result, str(path))
    if log.frames == 0:
        raise BadInput(f"{path}: no frames")
    if not log.complete:
        raise BadInput(f"{path}: frames are missing; a replay needs all of them from the first on")
    return Recorded(path, log, scenario)
