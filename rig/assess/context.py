"""What the sentences about a flight are made from: its scenario, rows, settings of the monitor and score."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.places import references_of
from rig.assess.record import FaultScore, Score
from rig.computer.redundancy.managers import manager_kind
from rig.faults.places import SURFACE_NAMES, number, site
from rig.frame import INDEX, SIGNALS, Block, State, Unit
from rig.scenario import Scenario


class Context(NamedTuple):
    """A scored flight; ``params`` (S,) config.PARAMS of its manager."""

    scenario: Scenario
    rows: Block
    params: NDArray[np.void]
    score: Score

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self.scenario.rate_hz

    @property
    def decided_by(self) -> str:
        """Who failed channels, or did not."""
        if (self.rows["unit"] != Unit.NONE).any():
            return "the unit under test"
        return f"the manager {self.scenario.redundancy.manager}"

    def compares(self, fault: FaultScore) -> bool:
        """Return True if channels were compared with each other, which can be done again."""
        own = not (self.rows["unit"] != Unit.NONE).any()
        return fault.signal in INDEX and own and manager_kind(self.scenario.redundancy.manager).compares

    def silent(self, signal: str) -> bool:
        """Whether nothing was ever said of a signal's channels, as by a unit that answers surfaces alone."""
        return signal in INDEX and bool((self.rows["state"][:, INDEX[signal]] == State.ABSENT).all())

    def unit(self, fault: FaultScore) -> str:
        """The SI unit of a fault's errors; "" where they have none, as those of a discrete."""
        return error_unit(fault, self.scenario)

    def threshold(self, fault: FaultScore) -> float | None:
        """What the monitor of the fault's signal allows with all channels in use, its unit; None where no signal is."""
        if fault.signal not in INDEX:
            return None
        p = self.params[INDEX[fault.signal]]
        return float(p["outlier_threshold"] or p["threshold"])


def error_unit(fault: FaultScore, scenario: Scenario) -> str:
    """The SI unit of a fault's errors; "" where they have none, as those of a discrete."""
    if fault.signal in INDEX:
        return SIGNALS[INDEX[fault.signal]].unit
    where = site(fault.signal)
    if where == "surface":
        return "" if SURFACE_NAMES[number(fault.signal)] == "throttle" else "rad"
    read = references_of(scenario.faults[fault.index], scenario.redundancy)
    return SIGNALS[read[0]].unit if read else ""


def channel(name: str, number_from_1: int | None) -> str:
    """A channel as it is said: ``pitch_rate channel 3``."""
    return name if number_from_1 is None else f"{name} channel {number_from_1}"


def channels(numbers_from_1: list[int]) -> str:
    """Several: ``channels 1 and 2``; ``no channel`` of none."""
    if not numbers_from_1:
        return "no channel"
    *most, last = map(str, numbers_from_1)
    return f"channels {', '.join(most)} and {last}" if most else f"channel {last}"
