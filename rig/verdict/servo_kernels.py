"""Outcomes of the faults of servo actuators, and of every channel that was shut off, from the rows of the servos.

The monitors run once more over the recorded rows: their counts show the frames in which a threshold was exceeded.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.servo_monitors import MonitorData, watch_surface
from rig.core.frame import CHANNELS, ActuatorMonitor
from rig.core.kernels import kernel, long_kernel
from rig.verdict.fault_kernels import acts, exceed
from rig.verdict.signal_kernels import NEVER
from rig.verdict.words import Cause

MONITORS: Final = 100  # who found a fault: from here on an ActuatorMonitor, before it the comparison or a DecidedBy;
VALVE: Final = MONITORS + len(ActuatorMonitor)  # or the monitor of the shut-off valve, which fails no channel
SERVO: Final = np.dtype(
    [
        ("acted_at", "i8", (CHANNELS,)),  # last frame in which a fault acted on the channel,
        ("shared_at", "i8"),  # and on what all channels share
        ("failed_at", "i8", (CHANNELS,)),
        ("failed_by", "u1", (CHANNELS,)),  # ActuatorMonitor
        ("cause", "u1", (CHANNELS,)),  # words.Cause
        ("faulty", "u1", (CHANNELS,)),  # channels on which a fault acted when each was failed, bits
        ("differs_at", "i8", (CHANNELS,)),  # first frame in which the valve was said to differ
        ("bypassed_at", "i8"),
        ("bypassed", "i8"),  # frames
        ("frames", "i8"),
        # In this row, bits: channels that a monitor speaks against, whose valve is not as commanded.
        ("beyond", "i8"),
        ("differs", "i8"),
    ],
    align=True,
)
PLACED: Final = np.dtype(
    [
        ("fault", "i8"),  # record of outcome_records.FAULT
        ("number", "i8"),  # in the scenario
        ("surfaces", "i8"),  # on which it sits, bits
        ("channel", "i8"),  # from 0; NEVER: on what they share
        ("valve", "u1"),  # it sits on the shut-off valve
        ("acted_at", "i8"),  # last frame
        ("bypassed_at", "i8"),  # first frame in which it cost a surface,
        ("bypassed", "i8"),  # and all such surfaces, bits
    ],
    align=True,
)


class ActuatorOutcomes(NamedTuple):
    """Settings and what is added up; see the types."""

    faults: NDArray[Any]  # (F,) outcome_records.FAULT
    placed: NDArray[Any]  # (A,) PLACED, those on servos
    servos: NDArray[Any]  # (3,) SERVO
    designed: NDArray[Any]  # (3,) rig.world.actuators.servo.SERVO
    monitors: MonitorData
    linger: NDArray[np.int64]  # (1,) frames for which a fault that has ceased can be the cause of a failure


@long_kernel
def add_lanes(rows, actuators, again, off, out):
    """Add ``rows`` (n,) FLAT with their ``actuators`` (n, 3); ``again`` is a copy of these, which the monitors write.

    off : (n, 4) channels that their computers shut off;  out : ActuatorOutcomes
    """
    for k in range(len(actuators)):
        frame = rows[k]["frame"]
        mark_acting(rows[k]["acting"], frame, out)
        for i in range(len(out.servos)):
            watch_surface(again[k, i], out.designed[i], i, off[k], out.monitors)
            see(actuators[k, i], frame, i, out)
        for f in range(len(out.placed)):
            follow(out.placed[f], frame, out)


@kernel
def mark_acting(acting, frame, out):
    """Mark the channels, and what they share, on which faults act; a valve's changes nothing until it is shut."""
    for f in range(len(out.placed)):
        placed = out.placed[f]
        if not acts(acting, placed["number"]):
            continue
        placed["acted_at"] = frame
        for i in range(len(out.servos) if placed["valve"] == 0 else 0):
            if (placed["surfaces"] >> i) & 1:
                if placed["channel"] >= 0:
                    out.servos[i]["acted_at"][placed["channel"]] = frame
                else:
                    out.servos[i]["shared_at"] = frame


@kernel
def see(row, frame, i, out):
    """Add the thresholds exceeded on channels of surface ``i``, isolations with causes, and bypasses."""
    servo, watch, positions = out.servos[i], out.monitors.watch[i], out.monitors.state[i]
    servo["beyond"] = servo["differs"] = 0
    for c in range(CHANNELS):
        if servo["failed_at"][c] == NEVER:
            counts = watch["current"][c] + watch["open_coil"][c] + watch["spool"][c] + watch["ram"][c]
            counts += positions["count"][c] + positions["failed"][c]
            servo["beyond"] |= (1 if counts > 0 else 0) << c
            if row["failed_by"][c] != 0:
                servo["failed_at"][c], servo["failed_by"][c] = frame, row["failed_by"][c]
                servo["faulty"][c] = faulty(servo, frame, out.linger[0])
                servo["cause"][c] = cause(servo, c, frame, out.linger[0])
        servo["differs"] |= (1 if watch["valve"][c] > 0 else 0) << c
        if servo["differs_at"][c] == NEVER and row["valve_differs"][c] != 0:
            servo["differs_at"][c] = frame
    servo["frames"] += 1
    servo["bypassed"] += row["bypassed"] != 0
    if servo["bypassed_at"] == NEVER and row["bypassed"] != 0:
        servo["bypassed_at"] = frame


@kernel
def cause(servo, c, frame, linger):
    """Return why channel ``c`` was isolated: a Cause."""
    if frame - servo["acted_at"][c] <= linger or frame - servo["shared_at"] <= linger:
        return Cause.OWN_FAULT.value
    return Cause.WRONG_ISOLATION.value if servo["faulty"][c] != 0 else Cause.FALSE_ALARM.value


@kernel
def faulty(servo, frame, linger):
    """Return the channels on which a fault has acted within the linger, bits."""
    channels = 0
    for c in range(CHANNELS):
        channels |= (frame - servo["acted_at"][c] <= linger) << c
    return channels


@kernel
def follow(placed, frame, out):
    """Add the monitors' results for a fault that acts or has just acted, and note a lost surface."""
    if frame - placed["acted_at"] > out.linger[0]:
        return
    fault, beyond = out.faults[placed["fault"]], False
    for i in range(len(out.servos)):
        if (placed["surfaces"] >> i) & 1:
            servo = out.servos[i]
            for c in range(CHANNELS):
                if sits(placed, servo, c, frame, out.linger[0]):
                    beyond |= ((servo["differs"] if placed["valve"] != 0 else servo["beyond"]) >> c) & 1 != 0
                    find(placed, fault, servo, c, frame)
            if servo["bypassed_at"] == frame and costs(placed, fault, servo, frame):
                placed["bypassed"] |= 1 << i
                placed["bypassed_at"] = frame if placed["bypassed_at"] == NEVER else placed["bypassed_at"]
    if beyond:
        exceed(fault, frame)


@kernel
def sits(placed, servo, c, frame, linger):
    """Return whether a result about channel ``c`` is about this fault; a channel's own fault hides shared ones."""
    if placed["channel"] >= 0:
        return placed["channel"] == c
    return frame - servo["acted_at"][c] > linger


@kernel
def find(placed, fault, servo, c, frame):
    """Note that a fault was found, if it was so on channel ``c`` in this frame, for the first time."""
    if fault["failed_at"] != NEVER:
        return
    if placed["valve"] != 0:
        if servo["differs_at"][c] == frame:
            fault["failed_at"], fault["decided_by"] = frame, VALVE
    elif servo["failed_at"][c] == frame:
        fault["failed_at"], fault["decided_by"] = frame, MONITORS + servo["failed_by"][c]


@kernel
def costs(placed, fault, servo, frame):
    """Return whether a surface is bypassed in this frame for this fault: its last channel, or what all share."""
    if placed["valve"] != 0:
        return False
    if placed["channel"] >= 0:
        return servo["failed_at"][placed["channel"]] == frame
    if fault["failed_at"] != NEVER:
        return True
    left = 0
    for c in range(CHANNELS):
        left += servo["failed_at"][c] == NEVER
    return left > 0  # it is not for want of channels
