"""The computers of a flight with several: lanes A to D, each with its own records and state, at their first frame.

Their frame, each part in one file:

    engage    who is engaged, stops, starts again and leads                                 health.py
    share     each samples its own channel and has the others' by the link                  link.py, exchange.py
    think     as one computer does, with the same kernels, on its own BUS and FCC           think.py, alike.py
    command   each tells its command, votes all, and puts out what is voted                 command.py
    test      each tests itself and the others                                              health.py
    lead      the first engaged lane's FCC is the row's; where none is, the back-up's       backup_lane.py

The row holds the decisions of the leading lane.  Lanes that hold the same samples are equal, bit for bit; one of them
thinks for all.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from rig.computer.analytic.references import ReferenceData
from rig.computer.control.law_state import ControlData
from rig.computer.lanes.alike import follow_thought, follow_vote, follows, stay_alike
from rig.computer.lanes.backup_lane import PLACE, fly_backup, join
from rig.computer.lanes.command import (
    CommandData,
    agree,
    commands,
    equalise,
    keep_integrals,
    middle_of_engaged,
    note_unresolved,
    vote_commands,
)
from rig.computer.lanes.computers_table import Config
from rig.computer.lanes.health import (
    NO_LANE,
    HealthData,
    accuse,
    drawn,
    drives,
    engage,
    health,
    is_engaged,
    suspect,
    test_itself,
    watch_clocks,
)
from rig.computer.lanes.lane_clock import ClockData, clocks, run_on, sample_early
from rig.computer.lanes.link import LinkData, links, share_samples
from rig.computer.lanes.think import ComputerData, give_references, think_lane
from rig.computer.redundancy import RedundancyData
from rig.computer.redundancy.discrete import DiscreteData
from rig.computer.redundancy.state import ManagerData
from rig.core.frame import BUS, CHANNELS, COMPUTERS, FCC, INTEGRATED, SURFACES, Health, S, second_rows
from rig.core.kernels import inlined, kernel
from rig.world.faults import FaultData, break_computers, corrupt_commands
from rig.world.faults.servo_parts import ComputerPart

_LANES: Final = len(COMPUTERS)
_SURFACES: Final = len(SURFACES)
_MOST_NOTED: Final = 127


class Orders(NamedTuple):
    """Commands of several computers to the actuators."""

    asked: NDArray[np.float64]  # (4, 4) of each servo channel, lane by surface
    given: NDArray[np.float64]  # (4,) where there are no servos: the median of the engaged lanes'
    off: NDArray[np.uint8]  # (4,) lanes whose channels are shut off


class LaneData(NamedTuple):
    """Data of the lanes; ``[i]`` of an array is that of one computer, the last that of the back-up."""

    fitted: int  # lanes that think
    outside: int  # the lane whose computer is a unit under test, or ``NO_LANE``
    bus: NDArray[Any]  # (4,) BUS
    fcc: NDArray[Any]  # (5,) FCC
    references: NDArray[Any]  # and so on: states, in place
    manager: NDArray[Any]
    boxes: NDArray[Any]
    failed: NDArray[np.uint8]  # (4,) lanes that are failed, as all know at the beginning of the frame
    alike: NDArray[np.uint8]  # (4,) lanes that have had the same samples: the first of them holds their state
    discretes: NDArray[Any]
    control: NDArray[Any]
    gain: NDArray[np.float64]
    fdi: NDArray[Any]
    kept: NDArray[Any]  # of faults on references
    memory: NDArray[np.float64]
    clocks: ClockData
    links: LinkData
    health: HealthData
    commands: CommandData
    orders: Orders
    running: NDArray[np.uint8]  # (4,) workspace
    counted: NDArray[np.uint8]  # (4,) workspace
    rows: NDArray[Any]  # (n, 4) COMPUTER of a block's rows


class Lanes:
    """The lanes of a flight at their first frame; ``one`` : a computer at its own, from which all begin."""

    def __init__(
        self,
        config: Config,
        one: ComputerData,
        skew: NDArray[np.float64],
        rate_hz: float,
        seeds: SeedSequence,
        outside: int = NO_LANE,
    ) -> None:
        """skew : (S, 4) frames, of the sensors without the lanes' clocks; outside : as of LaneData."""
        redundancy, control, faults = one.redundancy, one.control, one.faults
        law = control.param[0]
        limits = np.stack([law["low"], law["high"]], axis=1)
        drift, alarms = seeds, seeds.spawn(1)[0]
        self._alarms = np.random.default_rng(alarms)
        made = commands(config, limits, rate_hz)
        made.integral[:] = [control.state[0][f"{name.removesuffix('_rad')}_integral"] for name in INTEGRATED]
        for told in (made.told, made.before, made.meant, made.put):
            told[:] = control.state[0]["surface"]
        self.data = LaneData(
            fitted=config.count,
            outside=outside,
            bus=np.zeros(_LANES, BUS),
            fcc=np.zeros(_LANES + 1, FCC),
            references=_of_each(redundancy.references.state),
            manager=_of_each(redundancy.manager.state),
            boxes=_of_each(redundancy.manager.boxes),
            failed=np.zeros(_LANES, np.uint8),
            alike=np.array([i < config.count and i != outside for i in range(_LANES)], np.uint8),
            discretes=_of_each(redundancy.discretes.state),
            control=_of_each(control.state),
            gain=_of_each(control.gain),
            fdi=_of_each(control.fdi),
            kept=_of_each(faults.kept),
            memory=_of_each(faults.memory),
            clocks=clocks(config, rate_hz, skew, drift),
            links=links(config, rate_hz, redundancy.manager.params),
            health=health(config, limits[:, 1] - limits[:, 0], rate_hz),
            commands=made,
            orders=Orders(np.zeros((_LANES, _SURFACES)), np.zeros(_SURFACES), np.zeros(_LANES, np.uint8)),
            running=np.zeros(_LANES, np.uint8),
            counted=np.zeros(_LANES, np.uint8),
            rows=second_rows(2, ("computer",))["computer"],  # of two: of one the view would count as contiguous
        )

    def prepare(self, rows: NDArray[Any]) -> None:
        """Take the next rows to write, (n, 4) COMPUTER, and draw for them."""
        self.data = self.data._replace(rows=rows, health=drawn(self.data.health, len(rows), self._alarms))


def _of_each(state: NDArray[Any]) -> NDArray[Any]:
    """Return what one computer has for each lane and for the back-up."""
    return np.stack([state] * (_LANES + 1))


@kernel
def think_all(row, k, data, lanes):
    """Fill the FCC record of row k: by one computer, or by the leading one of several.

    data : ComputerData, of several what they have in common;  lanes : LaneData, None for one computer
    """
    if lanes is None:
        think_lane(row, row["bus"], row["fcc"], k, data)
    else:
        think_before(row, k, data, lanes)
        think_after(row, k, data, lanes)


@inlined
def think_before(row, k, data, lanes):
    """Let the lanes share samples and think; of the lane outside up to the references, which its computer reads."""
    break_computers(row, lanes.health.parts, lanes.health.seen, data.faults)
    engage(row["frame"], lanes.health)
    join(lanes)
    for i in range(lanes.fitted):
        lanes.failed[i] = lanes.health.lane[i]["health"] == Health.FAILED
    lead = lanes.clocks.clock[0]["lead"]
    stay_alike(share_samples(row, lanes.bus, lead, lanes.running, data.faults, lanes.links), lanes)
    think_apart(row, k, data, lanes)


@inlined
def think_after(row, k, data, lanes):
    """Exchange and vote the lanes' commands, test the lanes, and fill the row's FCC record by the leading one."""
    command(row, lanes, data.faults)
    watch(row["frame"], k, lanes)
    lead(row, k, data, lanes)
    give_orders(row["fcc"]["surface"], lanes)
    for i in range(lanes.fitted):
        note(lanes.rows[k, i], i, lanes)
    run_on(lanes.clocks.clock[0], lanes.links.silent, lanes.counted, lanes.health.parts[ComputerPart.DRIFT])


@inlined
def think_apart(row, k, data, lanes):
    """Let every lane that runs think on its own BUS, or follow one that is alike."""
    for i in range(lanes.fitted):
        if lanes.running[i] != 0 and not follows(i, lanes):
            equalise(i, lanes.control[i, 0], lanes.links, lanes.health, lanes.commands)
    for i in range(lanes.fitted):
        if follows(i, lanes):
            follow_thought(i, lanes)
        elif lanes.running[i] != 0:
            lanes.fcc[i] = row["fcc"]
            own = of_lane(i, data, lanes)
            if i == lanes.outside:
                give_references(row, lanes.bus[i], lanes.fcc[i], k, own.redundancy.references, own.faults)
            else:
                think_lane(row, lanes.bus[i], lanes.fcc[i], k, own)
                keep_integrals(i, lanes.control[i, 0], lanes.commands)


@kernel
def command(row, lanes, faults):
    """Let every lane that runs tell its commands, vote all, and put out what is voted, each with its faults."""
    data, running, code = lanes.commands, lanes.running, lanes.health.parts[ComputerPart.CODE]
    for i in range(lanes.fitted):
        for s in range(_SURFACES):
            data.before[i, s] = data.told[i, s]
            if running[i] != 0:
                data.told[i, s] = code[i] * lanes.fcc[i]["surface"][s]
    corrupt_commands(row, data.told, ComputerPart.COMMAND, running, faults)
    for i in range(lanes.fitted):
        if running[i] != 0:
            for s in range(_SURFACES):
                lanes.fcc[i]["surface"][s] = data.meant[i, s] = data.told[i, s]
            if follows(i, lanes):
                follow_vote(i, lanes)
            elif is_engaged(lanes.health.lane[i]):
                vote_commands(i, lanes.clocks.clock[0]["lead"], lanes.fcc, lanes.links, lanes.health, data)
    note_unresolved(lanes.health, data)
    for i in range(lanes.fitted):
        for s in range(_SURFACES):
            data.put[i, s] = data.meant[i, s]
    corrupt_commands(row, data.put, ComputerPart.OUTPUT, running, faults)


@kernel
def watch(frame, k, lanes):
    """Let the lanes test their outputs and each other, and vote."""
    data, limits = lanes.health, lanes.health.limits[0]
    for i in range(lanes.fitted):
        off = False
        for s in range(_SURFACES):
            off |= abs(lanes.commands.put[i, s] - lanes.commands.meant[i, s]) > limits["wrap_tolerance"][s]
        test_itself(i, k, frame, off, data)
    watch_clocks(frame, lanes.clocks.clock[0]["lead"], lanes.links.silent, data)
    for i in range(lanes.fitted):
        agree(i, lanes.links, data, lanes.commands)
        accuse(i, lanes.commands.differs[i], lanes.links.state[i], data)
    suspect(data)


@kernel
def lead(row, k, data, lanes):
    """Write the FCC record of the row: the leading lane's, or the back-up's."""
    system = lanes.health.system[0]
    if system["leading"] != NO_LANE:
        row["fcc"] = lanes.fcc[system["leading"]]
    else:
        row["fcc"] = lanes.fcc[system["led"]]
        fly_backup(row, row["fcc"], k, lanes.commands.samples, of_lane(PLACE, data, lanes))


@kernel
def give_orders(surface, lanes):
    """Write what the actuators are told; surface : (4,) of the row, which is the back-up's where no lane leads."""
    orders, backup = lanes.orders, lanes.health.system[0]["leading"] == NO_LANE
    for c in range(lanes.fitted):
        orders.off[c] = not backup and not drives(c, lanes.health)
        for s in range(_SURFACES):
            orders.asked[c, s] = surface[s] if backup else lanes.commands.put[c, s]
    for s in range(_SURFACES):
        orders.given[s] = surface[s] if backup else middle_of_engaged(s, orders.given[s], lanes.health, lanes.commands)


@kernel
def of_lane(i, data, lanes):
    """Return the ComputerData of lane i: its own state, and the parameters that all have."""
    r, m, c, f = data.redundancy.references, data.redundancy.manager, data.control, data.faults
    references = ReferenceData(r.pressures, r.table, r.param, lanes.references[i])
    manager = ManagerData(m.choice, m.params, lanes.manager[i], lanes.boxes[i], lanes.failed, m.baseline)
    discretes = DiscreteData(data.redundancy.discretes.params, lanes.discretes[i])
    control = ControlData(c.pressures, c.table, c.param, lanes.control[i], lanes.gain[i], c.fdi_param, lanes.fdi[i])
    faults = FaultData(
        param=f.param, schedule=f.schedule, state=f.state, targets=f.targets, kept=lanes.kept[i], program=f.program,
        stack=f.stack, times=f.times, memory=lanes.memory[i], seen=f.seen, uniform=f.uniform, normal=f.normal,
        clean=f.clean,
    )  # fmt: skip
    return ComputerData(RedundancyData(references, manager, discretes), control, faults)


@kernel
def note(out, i, lanes):
    """Write the COMPUTER record of lane i; before the clocks run on."""
    note_votes(out, lanes.fcc[i])
    health, commands = lanes.health.lane[i], lanes.commands
    for s in range(_SURFACES):
        out["surface"][s], out["output"][s] = lanes.fcc[i]["surface"][s], commands.put[i, s]
        out["integral"][s] = commands.integral[i, s]
        out["command_pattern"][s], out["command_decided_by"][s] = (
            commands.state[i, s]["pattern"],
            commands.decided_by[i, s],
        )
    out["clock_lead"], out["leads"] = lanes.clocks.clock[0]["lead"][i], lanes.health.system[0]["leading"] == i
    out["health"], out["failed_for"] = health["health"], health["failed_for"]
    for j in range(lanes.fitted):
        out["link"][j], out["outvoted"][j] = lanes.links.state[i, j], lanes.links.outvoted[i, j]
        out["silent"][j], out["accuses"][j] = min(lanes.links.silent[i, j], _MOST_NOTED), health["accuses"][j]


@kernel
def note_votes(out, fcc):
    """Write what a lane decided on the signals, an FCC record, into its COMPUTER record."""
    voted, state, level, pattern, decided_by = (
        out["voted"],
        out["state"],
        out["level"],
        out["pattern"],
        out["decided_by"],
    )
    for s in range(S):
        voted[s], level[s], pattern[s], decided_by[s] = (
            fcc["voted"][s], fcc["level"][s], fcc["pattern"][s], fcc["decided_by"][s]
        )  # fmt: skip
        for c in range(CHANNELS):
            state[s, c] = fcc["state"][s, c]


@kernel
def sample(sensors, lanes):
    """Let the sensors sample at the times of the lanes' clocks; sensors : (S,) PARAMS, lanes : LaneData or None."""
    if lanes is not None:
        sample_early(sensors, lanes.clocks.skew, lanes.clocks.clock[0]["lead"])


@kernel
def orders(lanes):
    """Return the Orders of several computers; None for one; lanes : LaneData."""
    return None if lanes is None else lanes.orders
