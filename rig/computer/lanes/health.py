"""The health of the lanes: engaged lanes, votes against lanes, self-tests, the leading lane.

A strict majority of the other engaged lanes votes a lane out, a frame after their votes, for its commands, for a
link that is lost to them or for its clock; or its own test fails it.  Votes and the state of each lane are wires
to all others and to the shut-off valves (added: the link has no part in them).  A failed lane's
servo channels are shut off; its samples stay in the vote while its link is in order.
It is readmitted by command alone, when it runs and has agreed with the leading lane for ``rejoin_s``.
Source: Zhang 2023, sections 0 to 2, which name the tests; thresholds, times and coverage are added.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.computer.lanes.computers_table import Command, Config
from rig.core.frame import COMPUTERS, SURFACES, Health, LaneTest, LinkState, Table, to_frame
from rig.core.kernels import kernel
from rig.core.settings import in_frames
from rig.world.faults.servo_parts import ComputerPart, whole_computers

_LANES: Final = len(COMPUTERS)
_ARMED_S: Final = 0.5  # clocks are together by then
NO_LANE: Final = -1
_READMIT, _DISENGAGE, _BACK_UP = range(3)
_DOES: Final = {"readmit": _READMIT, "disengage": _DISENGAGE, "backup": _BACK_UP}
LIMITS: Final = np.dtype(
    [
        ("fitted", "i8"),
        ("synchronised", "u1"),
        ("rejoin_frames", "i8"),
        ("sync_window", "f8"),  # frames
        ("sync_frames", "i8"),
        ("armed_frame", "i8"),
        ("wrap_tolerance", "f8", (len(SURFACES),)),  # rad
        ("wrap_frames", "i8"),
        ("voltage_frames", "i8"),
        ("watchdog_frames", "i8"),
        ("checksum_frames", "i8"),
        ("alarm_chance", "f8"),  # a frame
    ],
    align=True,
)
LANE: Final = np.dtype(
    [
        ("health", "u1"),
        ("failed_for", "u1"),  # LaneTest
        ("running", "u1"),
        ("silent", "u1"),  # its computer, a unit under test, has not answered in this frame
        ("joins", "u1"),  # in this frame: it takes over what the leading lane has
        ("accuses", "u1", (_LANES,)),  # LaneTest
        ("off_time", "i8", (_LANES,)),  # frames in a row that another's clock was off
        ("stopped_frames", "i8"),
        ("wrap_frames", "i8"),  # in a row that the wrap-around miscompares, and so on
        ("voltage_frames", "i8"),
        ("agreed_frames", "i8"),
    ],
    align=True,
)
SYSTEM: Final = np.dtype(
    [
        ("leading", "i8"),  # the first lane that is engaged, or ``NO_LANE``: the back-up flies
        ("led", "i8"),  # the last lane that led
        ("backup", "u1"),
        ("taken_over", "u1"),  # the back-up has begun
        ("unresolved_frames", "i8"),  # in a row that the leading lane's vote of commands was
    ],
    align=True,
)
ORDER: Final = np.dtype([("frame", "i8"), ("does", "i8"), ("lane", "i8")], align=True)


class HealthData(NamedTuple):
    """Results of the tests of lanes by each other, and by themselves."""

    limits: NDArray[Any]  # (1,) LIMITS
    lane: NDArray[Any]  # (4,) LANE, in place
    system: NDArray[Any]  # (1,) SYSTEM, in place
    orders: NDArray[Any]  # (m,) ORDER, of the pilot
    parts: NDArray[np.float64]  # (ComputerPart, 4) in this frame
    seen: NDArray[np.uint8]  # (LaneTest, 4) tests that see a fault in this frame
    alarm: NDArray[np.float64]  # (n, 4) uniform draws of a block's rows; no rows where there are no false alarms


def health(config: Config, stroke: NDArray[np.float64], rate_hz: float) -> HealthData:
    """Return the lanes at the first frame, all engaged; stroke : (4,) of each surface."""
    limits, lane, system = np.zeros(1, LIMITS), np.zeros(_LANES, LANE), np.zeros(1, SYSTEM)
    limits["fitted"], limits["synchronised"] = config.count, config.synchronised
    limits["rejoin_frames"] = in_frames(1, config.rejoin_s, rate_hz)
    limits["sync_window"], limits["sync_frames"] = config.sync_window, in_frames(1, config.sync_persistence_s, rate_hz)
    limits["armed_frame"] = to_frame(_ARMED_S, rate_hz)
    limits["wrap_tolerance"] = config.wrap_around.tolerance * stroke
    limits["wrap_frames"] = in_frames(1, config.wrap_around.persistence_s, rate_hz)
    limits["voltage_frames"] = in_frames(1, config.reference_voltage.persistence_s, rate_hz)
    limits["watchdog_frames"] = in_frames(1, config.watchdog.persistence_s, rate_hz)
    limits["checksum_frames"] = in_frames(1, config.checksum_period_s, rate_hz)
    limits["alarm_chance"] = config.false_alarm_per_hour / 3600.0 / rate_hz
    lane["health"][: config.count], lane["running"][: config.count] = Health.ENGAGED, 1
    return HealthData(
        limits=limits,
        lane=lane,
        system=system,
        orders=_orders(config.commands, rate_hz),
        parts=whole_computers(),
        seen=np.zeros((len(LaneTest), _LANES), np.uint8),
        alarm=np.zeros((0, _LANES)),
    )


def _orders(commands: Sequence[Command], rate_hz: float) -> NDArray[Any]:
    orders = np.zeros(len(commands), ORDER)
    for row, command in zip(orders, commands, strict=True):
        row["frame"], row["does"] = to_frame(command.at_s, rate_hz), _DOES[command.do]
        row["lane"] = NO_LANE if command.lane is None else COMPUTERS.index(command.lane)
    return orders


def coverage(config: Config) -> dict[LaneTest, float]:
    """Return the chance that each of a lane's own tests sees a fault."""
    tests = ("wrap_around", "reference_voltage", "watchdog", "checksum")
    return {LaneTest[name.upper()]: getattr(config, name).coverage for name in tests}


def drawn(data: HealthData, rows: int, rng: Generator) -> HealthData:
    """Return ``data`` with the draws of the next ``rows``; their stream is the same for any number of these."""
    return data if data.limits[0]["alarm_chance"] == 0.0 else data._replace(alarm=rng.random((rows, _LANES)))


@kernel
def is_engaged(lane):
    """Return True if a lane, a LANE record, takes part in votes of commands and accusations."""
    return lane["health"] == Health.ENGAGED or lane["health"] == Health.SUSPECT


@kernel
def responds(lane):
    """Return True if a lane, a LANE record, runs, and its computer has answered where that is a unit under test."""
    return lane["running"] != 0 and lane["silent"] == 0


@kernel
def drives(i, data):
    """Return True if lane i drives its servo channels: the last one that led does until the back-up takes over."""
    if is_engaged(data.lane[i]):
        return True
    for j in range(data.limits[0]["fitted"]):
        if is_engaged(data.lane[j]):
            return False
    return i == data.system[0]["leading"]


@kernel
def engage(frame, data):
    """Find who is engaged, stops, starts again and leads in ``frame``; data : HealthData."""
    fail_accused(data)
    start_and_stop(frame, data)
    for m in range(len(data.orders)):
        if data.orders[m]["frame"] == frame:
            execute(data.orders[m], data)
    find_leading(data)


@kernel
def fail_accused(data):
    """Fail the lanes that a strict majority of the other engaged ones voted out in the last frame."""
    fitted, lane = data.limits[0]["fitted"], data.lane
    accused = 0
    for j in range(fitted):
        others, accusers, found = 0, 0, LaneTest.NONE.value
        for i in range(fitted):
            if i != j and is_engaged(lane[i]):
                others += 1
                accusers += lane[i]["accuses"][j] != LaneTest.NONE
                found = lane[i]["accuses"][j] if found == LaneTest.NONE else found  # what the first says
        if is_engaged(lane[j]) and 2 * accusers > others:
            accused |= 1 << j
            lane[j]["failed_for"] = found  # before anybody is out: they may accuse each other
    for j in range(fitted):
        if (accused >> j) & 1:
            fail(lane[j], lane[j]["failed_for"])


@kernel
def fail(lane, test):
    """Fail a lane, a LANE record, for what ``test`` found."""
    lane["health"], lane["failed_for"], lane["agreed_frames"] = Health.FAILED.value, test, 0


@kernel
def start_and_stop(frame, data):
    """Note which lanes run; one that starts again joins with what the leading lane has."""
    for i in range(data.limits[0]["fitted"]):
        lane = data.lane[i]
        runs = data.parts[ComputerPart.STOPPED, i] == 0.0
        lane["joins"] = runs and lane["running"] == 0
        lane["running"] = runs
        if lane["joins"] and lane["health"] == Health.FAILED:
            lane["health"] = Health.RESTARTING.value
        elif not runs and lane["health"] == Health.RESTARTING:
            lane["health"] = Health.FAILED.value  # it stopped again


@kernel
def execute(order, data):
    """Do what the pilot commands; a readmission does not wait: a lane that has not agreed for long enough stays out."""
    if order["does"] == _BACK_UP:
        data.system[0]["backup"] = 1
        return
    lane = data.lane[order["lane"]]
    if order["does"] == _DISENGAGE:
        lane["health"], lane["failed_for"] = Health.OFF.value, LaneTest.COMMANDED.value
        lane["agreed_frames"] = 0
    elif not is_engaged(lane) and lane["agreed_frames"] >= data.limits[0]["rejoin_frames"]:
        lane["health"], lane["failed_for"], lane["joins"] = Health.ENGAGED.value, LaneTest.NONE.value, 1
        for i in range(data.limits[0]["fitted"]):
            data.lane[i]["off_time"][order["lane"]] = 0


@kernel
def find_leading(data):
    """Find the first engaged lane, of those that run if there are; else, or by command, the back-up takes over."""
    system, leading = data.system[0], NO_LANE
    for i in range(data.limits[0]["fitted"]):
        if is_engaged(data.lane[i]) and (leading == NO_LANE or responds(data.lane[leading]) < responds(data.lane[i])):
            leading = i
    if leading == NO_LANE:
        system["backup"] = 1
    elif system["backup"] == 0:
        system["led"] = leading
    system["taken_over"] = system["backup"] != 0 and system["leading"] != NO_LANE
    system["leading"] = NO_LANE if system["backup"] != 0 else leading


@kernel
def test_itself(i, k, frame, off, data):
    """Let lane i test itself; off : whether it puts out something else than it commands; k : row in the block."""
    limits, lane, parts, seen = data.limits[0], data.lane[i], data.parts, data.seen
    lane["stopped_frames"] = 0 if responds(lane) else lane["stopped_frames"] + 1
    found = LaneTest.NONE.value
    if not responds(lane):
        seen_here = seen[LaneTest.WATCHDOG, i] != 0 or lane["silent"] != 0
        if seen_here and lane["stopped_frames"] >= limits["watchdog_frames"]:
            found = LaneTest.WATCHDOG.value
    else:
        wraps = seen[LaneTest.WRAP_AROUND, i] != 0 and (off or parts[ComputerPart.INPUT, i] != 0.0)
        lane["wrap_frames"] = lane["wrap_frames"] + 1 if wraps else 0
        scaled = seen[LaneTest.REFERENCE_VOLTAGE, i] != 0 and parts[ComputerPart.SCALE, i] != 0.0
        lane["voltage_frames"] = lane["voltage_frames"] + 1 if scaled else 0
        if lane["wrap_frames"] >= limits["wrap_frames"]:
            found = LaneTest.WRAP_AROUND.value
        elif lane["voltage_frames"] >= limits["voltage_frames"]:
            found = LaneTest.REFERENCE_VOLTAGE.value
        elif seen[LaneTest.CHECKSUM, i] != 0 and (frame + 1) % limits["checksum_frames"] == 0:
            found = LaneTest.CHECKSUM.value
        elif len(data.alarm) > 0 and data.alarm[k, i] < limits["alarm_chance"]:
            found = LaneTest.WRAP_AROUND.value
    if found != LaneTest.NONE and is_engaged(lane):
        fail(lane, found)


@kernel
def is_content(lane):
    """Return True if the lane passes all its own tests."""
    return lane["wrap_frames"] == 0 and lane["voltage_frames"] == 0 and lane["stopped_frames"] == 0


@kernel
def watch_clocks(frame, lead, silent, data):
    """Count frames in a row in which a lane whose messages come samples at another time than they should.

    lead : (4,) frames;  silent : (4, 4) frames without a message, receiver by sender
    """
    limits = data.limits[0]
    if limits["synchronised"] == 0 or frame < limits["armed_frame"]:
        return
    for i in range(limits["fitted"]):
        for j in range(limits["fitted"]):
            apart = lead[j] - lead[i]
            apart = abs(apart - np.floor(apart + 0.5))
            off = i != j and silent[i, j] == 0 and apart > limits["sync_window"]
            data.lane[i]["off_time"][j] = data.lane[i]["off_time"][j] + 1 if off else 0


@kernel
def accuse(i, commands_differ, link_states, data):
    """Write the lanes against which lane i votes, and for which test.

    commands_differ : (4,) its vote of the commands has failed those of that lane;  link_states : (4,) LinkState
    """
    limits, lane = data.limits[0], data.lane[i]
    for j in range(limits["fitted"]):
        found = LaneTest.NONE.value
        if i != j and responds(lane) and is_engaged(lane) and is_engaged(data.lane[j]):
            if commands_differ[j] != 0:
                found = LaneTest.COMMANDS.value
            elif link_states[j] == LinkState.FAILED:
                found = LaneTest.LINK.value
            elif lane["off_time"][j] >= limits["sync_frames"]:
                found = LaneTest.CLOCK.value
        lane["accuses"][j] = found


@kernel
def suspect(data):
    """Mark the engaged lanes with a vote against them, or whose own tests miscompare."""
    fitted = data.limits[0]["fitted"]
    for j in range(fitted):
        if is_engaged(data.lane[j]):
            accused = not is_content(data.lane[j])
            for i in range(fitted):
                accused |= data.lane[i]["accuses"][j] != LaneTest.NONE
            data.lane[j]["health"] = Health.SUSPECT.value if accused else Health.ENGAGED.value


def shut_off(table: Table) -> NDArray[np.uint8]:
    """Return (n, 4): servo channels that their computers shut off in recorded rows, none while the back-up flies."""
    computer = table.lane
    if computer is None:
        return np.zeros((len(table), _LANES), np.uint8)
    engaged, leads = np.isin(computer["health"], (Health.ENGAGED, Health.SUSPECT)), computer["leads"] != 0
    driven = engaged | (leads & ~engaged.any(axis=1, keepdims=True))
    return (~driven & leads.any(axis=1, keepdims=True)).astype(np.uint8)
