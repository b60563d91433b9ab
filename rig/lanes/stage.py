"""The computers of a flight with several: lanes A to D, each with records and state of its own, at their first frame.

Each lane thinks as one computer does (think.py), with the same kernels and parameters, on its own BUS and FCC.  The
leading lane's FCC is the row's: triggers, score and all who read the row see what it decided.  All arrays have four
lanes; how many think is the bound of a loop.

Each samples its own channel, by its own clock (clock.py), and has the others' by the link (link.py).  While the lanes
hold the same samples they are equal, bit for bit.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.computer.analytic.references import ReferenceData
from rig.computer.control.state import ControlData
from rig.computer.redundancy import RedundancyData
from rig.computer.redundancy.discrete import DiscreteData
from rig.computer.redundancy.manager import ManagerData
from rig.faults import FaultData
from rig.frame import BUS, CHANNELS, COMPUTERS, FCC, SURFACES, S, lane_rows
from rig.kernels import kernel
from rig.lanes.clock import ClockData, clocks, run_on, sample_early
from rig.lanes.config import Config
from rig.lanes.link import LinkData, links, share_samples
from rig.lanes.think import ComputerData, think_lane

_LANES: Final = len(COMPUTERS)
_LEADING: Final = 0  # the first lane that is engaged, and all are
_SURFACES: Final = len(SURFACES)
_MOST_NOTED: Final = 127


class LaneData(NamedTuple):
    """What the lanes have of their own; ``[i]`` of an array is what one computer has."""

    fitted: int  # lanes that think
    bus: NDArray[Any]  # (4,) BUS
    fcc: NDArray[Any]  # (4,) FCC
    references: NDArray[Any]  # and so on: states, in place
    manager: NDArray[Any]
    boxes: NDArray[Any]
    discretes: NDArray[Any]
    control: NDArray[Any]
    gain: NDArray[np.float64]
    fdi: NDArray[Any]
    kept: NDArray[Any]  # of faults on references
    memory: NDArray[np.float64]
    clocks: ClockData
    links: LinkData
    rows: NDArray[Any]  # (n, 4) COMPUTER of a block's rows


class Lanes:
    """The lanes of a flight at their first frame; ``one`` : a computer at its own, from which all begin."""

    def __init__(
        self, config: Config, one: ComputerData, skew: NDArray[np.float64], rate_hz: float, seeds: SeedSequence
    ) -> None:
        """skew : (S, 4) frames, of the sensors without the lanes' clocks."""
        redundancy, control, faults = one.redundancy, one.control, one.faults
        self.data = LaneData(
            fitted=config.count,
            bus=np.zeros(_LANES, BUS),
            fcc=np.zeros(_LANES, FCC),
            references=_of_each(redundancy.references.state),
            manager=_of_each(redundancy.manager.state),
            boxes=_of_each(redundancy.manager.boxes),
            discretes=_of_each(redundancy.discretes.state),
            control=_of_each(control.state),
            gain=_of_each(control.gain),
            fdi=_of_each(control.fdi),
            kept=_of_each(faults.kept),
            memory=_of_each(faults.memory),
            clocks=clocks(config, rate_hz, skew, seeds),
            links=links(config, rate_hz, redundancy.manager.params),
            rows=lane_rows(2, ("computer",))["computer"],  # of two: of one the view would count as contiguous
        )

    def prepare(self, rows: NDArray[Any]) -> None:
        """Take the next rows to write, (n, 4) COMPUTER."""
        self.data = self.data._replace(rows=rows)


def _of_each(state: NDArray[Any]) -> NDArray[Any]:
    """Return what one computer has for each lane."""
    return np.stack([state] * _LANES)


@kernel
def think_all(row, k, data, lanes):
    """Fill the FCC record of row k: by one computer, or by the leading one of several.

    data : ComputerData, of several what they have in common;  lanes : LaneData, None for one computer
    """
    if lanes is None:
        think_lane(row, row["bus"], row["fcc"], k, data)
    else:
        clock = lanes.clocks.clock[0]
        share_samples(row, lanes.bus, clock["lead"], data.faults, lanes.links)
        for i in range(lanes.fitted):
            lanes.fcc[i] = row["fcc"]
            think_lane(row, lanes.bus[i], lanes.fcc[i], k, of_lane(i, data, lanes))
            note(lanes.rows[k, i], lanes.fcc[i], lanes.control[i, 0])
            note_link(lanes.rows[k, i], i, lanes)
        run_on(clock, lanes.links.silent)
        row["fcc"] = lanes.fcc[_LEADING]


@kernel
def of_lane(i, data, lanes):
    """Return the ComputerData of lane i: its own state, and the parameters that all have."""
    r, m, c, f = data.redundancy.references, data.redundancy.manager, data.control, data.faults
    references = ReferenceData(r.pressures, r.table, r.param, lanes.references[i])
    manager = ManagerData(m.choice, m.params, lanes.manager[i], lanes.boxes[i], m.rival)
    discretes = DiscreteData(data.redundancy.discretes.params, lanes.discretes[i])
    control = ControlData(c.pressures, c.table, c.param, lanes.control[i], lanes.gain[i], c.fdi_param, lanes.fdi[i])
    faults = FaultData(
        f.param, f.schedule, f.state, f.targets, lanes.kept[i], f.program, f.stack, f.times, lanes.memory[i],
        f.seen, f.uniform, f.normal, f.clean,
    )  # fmt: skip
    return ComputerData(RedundancyData(references, manager, discretes), control, faults)


@kernel
def note(out, fcc, law):
    """Write a lane's COMPUTER record from its FCC and from the state of its control law."""
    voted, state, level, pattern, resolver = out["voted"], out["state"], out["level"], out["pattern"], out["resolver"]
    for s in range(S):
        voted[s], level[s], pattern[s], resolver[s] = (
            fcc["voted"][s], fcc["level"][s], fcc["pattern"][s], fcc["resolver"][s]
        )  # fmt: skip
        for c in range(CHANNELS):
            state[s, c] = fcc["state"][s, c]
    for i in range(_SURFACES):
        out["surface"][i] = fcc["surface"][i]
    integral = out["integral"]
    integral[0], integral[1] = law["elevator_integral"], law["aileron_integral"]
    integral[2], integral[3] = law["rudder_integral"], law["throttle_integral"]


@kernel
def note_link(out, i, lanes):
    """Write what lane i has of its clock and of its links into its COMPUTER record; before the clocks run on."""
    out["clock_lead"] = lanes.clocks.clock[0]["lead"][i]
    for j in range(lanes.fitted):
        out["link"][j], out["outvoted"][j] = lanes.links.state[i, j], lanes.links.outvoted[i, j]
        out["silent"][j] = min(lanes.links.silent[i, j], _MOST_NOTED)


@kernel
def sample(sensors, lanes):
    """Let the sensors sample when the lanes' clocks say; sensors : (S,) PARAMS, lanes : LaneData or None."""
    if lanes is not None:
        sample_early(sensors, lanes.clocks.skew, lanes.clocks.clock[0]["lead"])


@kernel
def commands(lanes):
    """Return the (4,) FCC records whose lanes command the actuators; None for one computer; lanes : LaneData."""
    return None if lanes is None else lanes.fcc
