"""Meanings of the one-byte fields of a frame; kernels use the members directly."""

from __future__ import annotations

from enum import IntEnum


class State(IntEnum):
    """State of a channel by its monitor."""

    OK = 0
    SUSPECT = 1
    FAILED = 2
    ABSENT = 3  # the signal has fewer than four channels


class Pattern(IntEnum):
    """Agreement of the channels in use (Zhang 2023, sections 2 and 3)."""

    NORMAL = 0
    ISOLATED = 1
    P2_2 = 2
    P1_1_1_1 = 3
    P1_1_1 = 4
    P1_1 = 5
    LOST = 6

    @property
    def label(self) -> str:
        """Text in tables: ``2:2`` for ``P2_2``."""
        return self.name[1:].replace("_", ":") if self.is_split else self.name.lower()

    @property
    def is_split(self) -> bool:
        """True if no majority exists."""
        return Pattern.P2_2 <= self <= Pattern.P1_1


class DecidedBy(IntEnum):
    """Rule that decided a split."""

    NONE = 0
    ILM = 1
    TREND = 2
    REFERENCE = 3
    EXTREMES = 4
    MIDDLE = 5
    UNRESOLVED = 6
    BOX = 7  # the channel is out on several signals: its box has died
    COMMON = 8  # all channels agree, and two references agree against them
    SLOW = 9  # small deviations of a channel, summed over seconds
    LANE = 10  # the computers of one side are failed
    GIVEN_UP = 11  # no rule has answered for ``unresolved_s``: the signal is lost
    SLOW_MEANS = 12  # a slow-fault test: a mean of the channel's residual,
    SLOW_SQUARES = 13  # the mean of its square,
    SLOW_HALVES = 14  # a half of the channels against the reference


class Ilm(IntEnum):
    """In-line monitor of a channel: the sensor's test of itself."""

    BAD = 0
    GOOD = 1
    ABSENT = 2


class Source(IntEnum):
    """Source of a signal in the control law."""

    VOTED = 0
    REFERENCE = 1  # the signal is lost, its reference is usable
    DEGRADED = 2  # neither: the signal's degraded mode


class Law(IntEnum):
    """Control law of the frame."""

    AUTOPILOT = 0
    STICK = 1
    BACKUP = 2
    EXTERNAL = 3  # that of a unit under test


class UnitStatus(IntEnum):
    """Status of the unit's reply in this frame."""

    NONE = 0  # there is none: the rig's own flight computer answers
    ANSWERED = 1
    HELD = 2  # no reply by the deadline: the last one is flown
    LATE = 3
    DEAD = 4
    RESTARTED = 5
    REFUSED = 6  # invalid reply


class Trust(IntEnum):
    """Trust of the fault-tolerant law in the pitch-angle sensor."""

    NONE = 0  # another law flies, which does not test it
    TRUSTED = 1
    CORRECTED = 2  # faulty: the law uses the estimate
    WITHDRAWN = 3  # the estimate was wrong, not the sensor: the law uses the sensor again


class SensorFault(IntEnum):
    """Fault identified by the fault-tolerant law, of the pitch-angle sensor or of a rate beside it."""

    NONE = 0
    UNDETERMINED = 1
    EFFECTIVENESS = 2
    OFFSET = 3
    BOTH = 4
    RATE_BIAS = 5  # the sensor is trusted; a rate that it is compared with is biased


class End(IntEnum):
    """End of a flight; FLYING before it."""

    FLYING = 0
    NOT_FINITE = 1
    GROUND_CONTACT = 2
    DEPARTURE_ANGLE_OF_ATTACK = 3
    DEPARTURE_SIDESLIP = 4
    DEPARTURE_LOAD_FACTOR = 5
    DEPARTURE_ATTITUDE = 6
    DEPARTURE_RATE = 7

    @property
    def label(self) -> str:
        """Name in logs and tables: ``departure angle of attack``."""
        return self.name.lower().replace("_", " ")

    @property
    def cause(self) -> str:
        """Why the aircraft is lost: ``angle of attack beyond its limit``."""
        if self == End.NOT_FINITE:
            return "its state was no longer a finite number"
        kind, _, quantity = self.label.partition(" ")
        return f"{quantity} beyond its limit" if kind == "departure" else self.label


class ActuatorMonitor(IntEnum):
    """Monitor that shut off a channel of an actuator, in the order of evaluation."""

    NONE = 0
    CURRENT = 1  # asked and measured
    CONTINUITY = 2  # of the coil's wire
    SPOOL = 3  # its model and its sensor
    POSITION = 4  # the ram's four sensors with each other
    RAM = 5  # its model and its sensor


class LinkState(IntEnum):
    """State of the message that a lane has from another lane in a frame."""

    ABSENT = 0  # it is the lane itself, or not fitted
    FRESH = 1
    OLD = 2  # of a frame before
    MISSING = 3  # damaged, or older than it may be
    FAILED = 4  # nothing good has come for long


class Health(IntEnum):
    """Health of a lane by the other lanes and its self-tests; engaged and suspect lanes drive their servo channels."""

    ABSENT = 0  # not fitted
    ENGAGED = 1
    SUSPECT = 2  # accused, or a test of its own miscompares
    FAILED = 3
    RESTARTING = 4  # it runs again after a stop
    OFF = 5  # disengaged by command


class LaneTest(IntEnum):
    """Test that isolated a lane: the first three are a majority of the other lanes, the next four its self-tests."""

    NONE = 0
    COMMANDS = 1
    LINK = 2
    CLOCK = 3
    WRAP_AROUND = 4  # what its converters put out, read back
    REFERENCE_VOLTAGE = 5  # read by its input converter
    CHECKSUM = 6  # of its program
    WATCHDOG = 7
    COMMANDED = 8  # by the pilot
