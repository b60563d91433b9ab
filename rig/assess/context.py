"""What the sentences about a flight are made from: its scenario, rows, settings of the monitor and score."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.monitored import references_of
from rig.assess.record import FaultScore, Score
from rig.computer.redundancy.config import MANAGERS
from rig.faults.places import SURFACE_NAMES, number, site
from rig.frame import INDEX, SIGNALS
from rig.scenario import Scenario


class Context(NamedTuple):
    """A scored flight."""

    scenario: Scenario
    score: Score

    @property
    def params(self) -> NDArray[np.void]:
        """(S,) config.PARAMS of its manager."""
        return self.score.evidence.params

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self.scenario.rate_hz

    @property
    def decided_by(self) -> str:
        """Name who failed channels, or did not."""
        if self.score.evidence.by_unit:
            return "the unit under test"
        return f"the manager {self.scenario.redundancy.manager}"

    def compares(self, fault: FaultScore) -> bool:
        """Return True if it was the comparison of cross-channel, which can be done again."""
        return fault.signal in INDEX and self.decided_by == f"the manager {MANAGERS[0]}"

    def silent(self, signal: str) -> bool:
        """Return True if no channel of a signal ever had a state, as from a unit that answers surfaces alone."""
        return signal in self.score.evidence.silent

    def unit(self, fault: FaultScore) -> str:
        """Return the SI unit of a fault's errors; "" where they have none, as those of a discrete."""
        return error_unit(fault, self.scenario)

    def threshold(self, fault: FaultScore) -> float | None:
        """Return what the monitor of the fault's signal allows with all channels in use; None where no signal is."""
        if fault.signal not in INDEX:
            return None
        p = self.params[INDEX[fault.signal]]
        return float(p["outlier_threshold"] or p["threshold"])


def error_unit(fault: FaultScore, scenario: Scenario) -> str:
    """Return the SI unit of a fault's errors; "" where they have none, as those of a discrete."""
    if fault.signal in INDEX:
        return SIGNALS[INDEX[fault.signal]].unit
    where = site(fault.signal)
    if where == "surface":
        return "" if SURFACE_NAMES[number(fault.signal)] == "throttle" else "rad"
    read = references_of(scenario.faults[fault.index], scenario.redundancy)
    return SIGNALS[read[0]].unit if read else ""


def channel(name: str, number_from_1: int | None) -> str:
    """Return a channel as it is written: ``pitch_rate channel 3``."""
    return name if number_from_1 is None else f"{name} channel {number_from_1}"


def channels(numbers_from_1: list[int]) -> str:
    """Return several: ``channels 1 and 2``; ``no channel`` of none."""
    if not numbers_from_1:
        return "no channel"
    *most, last = map(str, numbers_from_1)
    return f"channels {', '.join(most)} and {last}" if most else f"channel {last}"
