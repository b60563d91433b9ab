"""Kinds of faults of a servo actuator and of its hydraulics, with ``[actuators] model = "servo"``.

A current is a fraction of the full current. A fault with channels acts on their coils, position sensors or shut-off
valves. A fault without channels acts on the spool or the ram, which the channels share.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import model_validator

from rig.world.faults.effects import Act, Effect
from rig.world.faults.fault_settings import Placed, Size, quantity, require_one
from rig.world.faults.places import Site
from rig.world.faults.servo_parts import Part


class _OfChannels(Placed):
    """A fault of some channels of an actuator."""

    sites: ClassVar[tuple[Site, ...]] = ("actuator",)
    act, changes_samples = Act.SET, False
    on_channels: ClassVar[bool | None] = True


class _OfAll(_OfChannels):
    """A fault of what the channels of an actuator share."""

    on_channels: ClassVar[bool | None] = False


class CoilOpen(_OfChannels):
    """A channel's coil has no current. Causes: a broken wire, a burnt winding, a failed amplifier.

    The wire monitor detects it with the probability of its coverage; the current monitor if the command is large.
    """

    act = Effect(Act.SET, 0.0, part=Part.ADDED, uncommanded=True, seen_by_wire=True)
    sentence = "coil open at {at}"
    example = "f16_elevator_coil_open"

    kind: Literal["coil_open"]


class CoilHardover(_OfChannels):
    """A channel's coil has the full current at any command. Cause: a shorted amplifier."""

    sentence = "full coil current at {at}"
    example = "f16_elevator_coil_hardover"

    kind: Literal["coil_hardover"]
    direction: Literal["high", "low"] = quantity("", "direction in which it drives the surface", "high")

    @property
    def effect(self) -> Effect:
        """The full current."""
        return Effect(Act.SET, 1.0 if self.direction == "high" else -1.0, part=Part.ADDED, uncommanded=True)


class Lvdt(_OfChannels):
    """A channel's position sensor has an offset or a scale error, or is stuck. Causes: a loose core, a bad supply."""

    sizes = ("offset", "factor")
    sentence = "position sensor wrong from {at} on"
    example = "b737_aileron_lvdt"

    kind: Literal["lvdt"]
    offset: float | None = quantity("rad", "added to the measured position", None)
    factor: float | None = quantity("1", "factor on the measured position", None)
    stuck: bool = quantity("", "true: the measured position stays at its last value", False)
    ramp_s: float = quantity("s", "its effect grows linearly from nothing over this time", 0.0, ge=0)

    @model_validator(mode="after")
    def _one_way(self) -> Lvdt:
        if not self.stuck:
            require_one(self, "offset", "factor")
        elif self.offset is not None or self.factor is not None:
            raise ValueError("stuck: not allowed together with offset or factor")
        return self

    @property
    def effect(self) -> Effect:
        """An offset, a scale, or the last value."""
        if self.stuck:
            return Effect(Act.SET, 1.0, part=Part.STUCK)
        if self.factor is not None:
            return Effect(Act.SCALE, self.factor, part=Part.FACTOR)
        return Effect(Act.ADD, self.offset or 0.0, part=Part.OFFSET)

    @property
    def magnitude(self) -> Size | None:
        """Return how far the offset is from 0, or the factor from 1."""
        return super().magnitude if self.factor is None else Size(abs(1.0 - self.factor), False)


class SovStuck(_OfChannels):
    """A channel's shut-off valve is stuck: an isolated channel still drives the spool. Cause: a stuck solenoid."""

    act = Effect(Act.SET, 1.0, part=Part.VALVE_STUCK)
    sentence = "shut-off valve stuck at {at}"
    unseen = "the channel was not shut off"
    example = "b747_rudder_sov_stuck"

    kind: Literal["sov_stuck"]


class OscillatoryFailure(_OfChannels):
    """A channel's current oscillates, which loads the structure. Cause: a failed component of the servo loop.

    `liquid`: the oscillation is added to the commanded current. `solid`: it replaces the commanded current.
    """

    sizes = ("amplitude",)
    sentence = "coil current oscillating from {at} on"
    example = "b747_elevator_oscillatory_failure"

    kind: Literal["oscillatory_failure"]
    mode: Literal["liquid", "solid"] = quantity("", "added to the commanded current, or in its place", "liquid")
    amplitude: float = quantity("1", "fraction of the full current", gt=0, le=2)
    frequency_hz: float = quantity("Hz", "frequency of the oscillation", gt=0, le=500)

    @property
    def effect(self) -> Effect:
        """A sine, with the current or instead of it."""
        solid = self.mode == "solid"
        return Effect(Act.OSCILLATE, self.amplitude, frequency_hz=self.frequency_hz, part=Part.ADDED, uncommanded=solid)


class SpoolJam(_OfAll):
    """The spool is stuck, and the ram moves at the rate of its opening. Causes: a metal chip, ice."""

    act = Effect(Act.SET, 1.0, part=Part.JAMMED)
    sentence = "spool jammed at {at}"
    example = "f16_elevator_spool_jam"

    kind: Literal["spool_jam"]


class Leak(_OfAll):
    """A fraction of the flow does not reach the ram. Cause: a worn seal."""

    sizes = ("share",)
    sentence = "leak from {at} on"
    example = "b737_rudder_leak"

    kind: Literal["leak"]
    share: float = quantity("1", "fraction of the flow that is lost", gt=0, le=1)
    ramp_s: float = quantity("s", "the loss grows linearly from zero over this time", 0.0, ge=0)

    @property
    def effect(self) -> Effect:
        """Return what is left of the flow."""
        return Effect(Act.SCALE, 1.0 - self.share, part=Part.LEFT)


class HydraulicLoss(_OfAll):
    """A hydraulic system loses pressure, for all surfaces. Causes: a burst line, a failed pump."""

    sites: ClassVar[tuple[Site, ...]] = ("hydraulics",)
    sizes = ("share",)
    sentence = "pressure lost at {at}"
    example = "f16_hydraulic_loss"

    kind: Literal["hydraulic_loss"]
    share: float = quantity("1", "fraction of the pressure that is lost", 1.0, gt=0, le=1)
    ramp_s: float = quantity("s", "the pressure falls linearly over this time", 0.0, ge=0)

    @property
    def effect(self) -> Effect:
        """Return what is left of the pressure."""
        return Effect(Act.SCALE, 1.0 - self.share, part=Part.PRESSURE)
