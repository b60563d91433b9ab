"""Parts of servo actuators and of links between lanes that faults change, and what they are while nothing is broken."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, COMPUTERS, MOVED


class Part(IntEnum):
    """Part of a servo actuator: a number a channel, or in the place of the first one for all."""

    COMMANDED = 0  # 1: the coil's current is the one asked for,
    ADDED = 1  # and this is added
    OPEN_SEEN = 2  # 1: the monitor of its wire sees that the coil is open
    OFFSET = 3  # of the position sensor, rad
    FACTOR = 4
    STUCK = 5  # 1: the position sensor stays at its last value
    VALVE_STUCK = 6
    JAMMED = 7  # 1: the spool stays where it is
    LEFT = 8  # share of the flow that no leak takes
    PRESSURE = 9  # share of each hydraulic system's, in the record of the first actuator


def whole_parts() -> NDArray[np.float64]:
    """Return (actuators, parts, channels): every part as it is while nothing is broken."""
    parts = np.zeros((len(MOVED), len(Part), CHANNELS))
    parts[:, [Part.COMMANDED, Part.FACTOR, Part.LEFT, Part.PRESSURE]] = 1.0
    return parts


class LinkPart(IntEnum):
    """Part of a one-way link between two lanes."""

    SILENT = 0  # 1: nothing arrives
    FROZEN = 1  # 1: the last message arrives again, with its frame number
    DAMAGED = 2  # 1: the checksum is wrong
    OFFSET = 3  # added to every sample that is told, in thresholds of its signal's monitor; the checksum is right


def whole_links() -> NDArray[np.float64]:
    """Return (parts, receivers, senders): every part as it is while nothing is broken."""
    return np.zeros((len(LinkPart), len(COMPUTERS), len(COMPUTERS)))


class ComputerPart(IntEnum):
    """Part of a computer: the quantity that a fault changes, and the self-test that may detect it."""

    STOPPED = 0  # 1: it computes nothing; its watchdog
    DRIFT = 1  # of its clock, frames a frame
    CODE = 2  # factor on its commands: a damaged program; the checksum
    COMMAND = 3  # its command of a surface
    OUTPUT = 4  # the same behind its output converter; the wrap-around
    INPUT = 5  # 1: its input converter gives nothing, or the last again; the wrap-around
    SCALE = 6  # 1: its input converter is off; the reference voltage


def whole_computers() -> NDArray[np.float64]:
    """Return (parts, lanes): every part as it is while nothing is broken."""
    parts = np.zeros((len(ComputerPart), len(COMPUTERS)))
    parts[ComputerPart.CODE] = 1.0
    return parts
