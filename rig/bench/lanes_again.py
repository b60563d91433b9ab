"""Several computers over recorded frames: exchange, computation of each lane, vote of commands, health and back-up.

Open loop: recorded rows replace plant, sensors and servos.  The faults of references, links and computers act again in
their recorded frames; the recorded samples contain the faults of channels.  The surfaces of the first frame, which are
the trim, start the control law; surfaces that no servo moved in the recorded previous frame stop its integrators.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.computer.control.autopilot import Control
from rig.computer.lanes.lanes_stage import Lanes, think_all
from rig.computer.lanes.think import ComputerData
from rig.computer.redundancy.resets import command
from rig.core.frame import FCC, FLAT, FLIGHT_INDEX, MOVED, SURFACES, Block, Table, nested, second_rows
from rig.core.kernels import kernel, long_kernel
from rig.flight.stages import computers, faults, redundancy
from rig.scenario.scenario import Scenario
from rig.world.faults import Fault, actuate, corrupt
from rig.world.faults.places import Site, site
from rig.world.sensors import Sensors

OUTPUTS: Final = tuple(FCC.names or ())  # what the computers write of a row
_THOUGHT: Final[set[Site]] = {"reference", "ccdl", "computer"}  # where faults act within ``think``
_FIRST: Final = FLIGHT_INDEX[SURFACES[0]]  # where the surfaces truly are, in the order of SURFACES


class LanesAgain:
    """The computers of ``scenario`` over the rows of their flight, given in order."""

    def __init__(self, scenario: Scenario, own: str | None = None) -> None:
        """Prepare the lanes; own : the user's manager or unit, which several lanes refuse as in flight.  BadInput."""
        rate_hz, limits = scenario.rate_hz, scenario.airframe.surface_limits
        self._scenario, self._own = scenario, own
        self._redundancy, self._faults = redundancy(scenario), faults(scenario)
        self._sensors = Sensors(scenario.sensors, rate_hz, scenario.streams()["sensors"])
        self._control = Control(scenario.control, scenario.gains, rate_hz, limits)
        self._again = [i for i, fault in enumerate(scenario.faults) if places_of(fault) <= _THOUGHT]
        self._lanes: Lanes | None = None

    def over(self, recorded: Table) -> Table:
        """Copy the next frames with new FCC and lanes, and unchanged servos."""
        rows = recorded.rows
        lanes = self._lanes = self._lanes or self._begin(rows[0])
        again, flown = blank(rows, self._scenario, OUTPUTS, self._again), copied(rows)
        self._faults.prepare(again)
        made = second_rows(max(2, len(rows)), self._scenario.row_parts)  # of one row the view would be another type
        lanes.prepare(made["computer"][: len(rows)])
        data = lanes.data._replace(rows=made["computer"])
        common = ComputerData(self._redundancy.data, self._control.data, self._faults.data)
        think_rows(nested(again), nested(flown), bypassed(recorded), common, data)
        whole = recorded.copied_beside(part for part in recorded.parts if part == "servo")
        whole.lane[:] = made["computer"][: len(rows)]
        return Table(again, whole.beside, recorded.timing)

    def _begin(self, first: Any) -> Lanes:
        """Return the lanes at the ``first`` row of the flight.  BadInput: another computer or manager."""
        self._control.reset(first["flight"][_FIRST : _FIRST + len(SURFACES)])
        alone = ComputerData(self._redundancy.data, self._control.data, self._faults.data)
        lanes = computers(self._scenario, alone, self._sensors, self._own or self._redundancy.own)
        assert lanes is not None  # one computer is voted again without them
        return lanes


def places_of(fault: Fault) -> set[Site]:
    """Return the kinds of all places of a fault."""
    return {site(point.place) for point in fault.targets}


def bypassed(recorded: Table) -> NDArray[np.uint8]:
    """Return (n, 3): surfaces that no servo moved in a frame; none without servos."""
    if recorded.servo is None:
        return np.zeros((len(recorded), len(MOVED)), np.uint8)
    return np.ascontiguousarray(recorded.servo["bypassed"])


def blank(rows: Block, scenario: Scenario, names: Sequence[str], again: Sequence[int]) -> Block:
    """Copy ``rows`` with the fields ``names`` blank, the scenario's commands, and no mark of the faults ``again``."""
    made = copied(rows)
    for name in names:
        made[name] = np.nan if name.endswith("reference") else 0
    made["reset"], made["discrete_reset"] = 0, 0
    command(made, scenario.redundancy.resets, scenario.rate_hz)  # a log of an older schema has none
    for i in again:
        made["acting"][:, i // 8] &= 255 ^ (1 << i % 8)
    return made


def copied(rows: Block) -> Block:
    """Copy field by field: the padding between them is part of the digest, and zero."""
    made = np.zeros(len(rows), FLAT)
    for name in FLAT.names or ():
        made[name] = rows[name]
    return made


@long_kernel
def think_rows(rows, flown, still, data, lanes):
    """Run the lanes over all ``rows`` (n,).

    flown : (n,) rows as recorded, whose truth and votes trigger faults;  still : (n, 3) surfaces that no servo moved
    data : ComputerData that the lanes share;  lanes : LaneData
    """
    for k in range(len(rows)):
        corrupt(flown[k], k, data.faults)
        think_all(rows[k], k, data, lanes)
        actuate(flown[k], data.faults)
        keep_still(still[k], data.control.param[0]["still"])


@kernel
def keep_still(now, still):
    """Store for the next frame which surfaces no servo moves, (3,) of all ``still``."""
    for i in range(len(now)):
        still[i] = now[i]
