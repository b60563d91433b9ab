"""Kinds of faults of a servo actuator and of its hydraulics, which ``[actuators] model = "servo"`` has.

A current is a share of the full one.  A fault of channels sits on their coils, position sensors or shut-off valves, one
of the spool or of the ram on what they share.
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
    """A channel's coil has no current. A broken wire, a burnt winding, a failed amplifier.

    The monitor of the wire sees it by its coverage; the one of the current does while much is asked for.
    """

    act = Effect(Act.SET, 0.0, part=Part.ADDED, uncommanded=True, seen_by_wire=True)
    sentence = "coil open at {at}"
    example = "f16_elevator_coil_open"

    kind: Literal["coil_open"]


class CoilHardover(_OfChannels):
    """A channel's coil has the full current, whatever is asked for. A shorted amplifier."""

    sentence = "full coil current at {at}"
    example = "f16_elevator_coil_hardover"

    kind: Literal["coil_hardover"]
    direction: Literal["high", "low"] = quantity("", "which way it drives the surface", "high")

    @property
    def effect(self) -> Effect:
        """The full current."""
        return Effect(Act.SET, 1.0 if self.direction == "high" else -1.0, part=Part.ADDED, uncommanded=True)


class Lvdt(_OfChannels):
    """A channel's position sensor is off, wrong in scale, or stays where it is. A loose core, a bad supply."""

    sizes = ("offset", "factor")
    sentence = "position sensor wrong from {at} on"
    example = "b737_aileron_lvdt"

    kind: Literal["lvdt"]
    offset: float | None = quantity("rad", "added to what it says", None)
    factor: float | None = quantity("1", "what is left of what it says", None)
    stuck: bool = quantity("", "it stays at its last value", False)
    ramp_s: float = quantity("s", "its effect grows linearly from nothing over this time", 0.0, ge=0)

    @model_validator(mode="after")
    def _one_way(self) -> Lvdt:
        if not self.stuck:
            require_one(self, "offset", "factor")
        elif self.offset is not None or self.factor is not None:
            raise ValueError("stuck: does not go with offset or factor")
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
    """A channel's shut-off valve stays where it is: once failed, the channel drives the spool on. A stuck solenoid."""

    act = Effect(Act.SET, 1.0, part=Part.VALVE_STUCK)
    sentence = "shut-off valve stuck at {at}"
    unseen = "the channel was not shut off"
    example = "b747_rudder_sov_stuck"

    kind: Literal["sov_stuck"]


class OscillatoryFailure(_OfChannels):
    """A channel's current oscillates. A failed component of the servo loop, which loads the structure.

    liquid: it is added to the current that is asked for; solid: it takes its place.
    """

    sizes = ("amplitude",)
    sentence = "coil current oscillating from {at} on"
    example = "b747_elevator_oscillatory_failure"

    kind: Literal["oscillatory_failure"]
    mode: Literal["liquid", "solid"] = quantity("", "added to the current, or in its place", "liquid")
    amplitude: float = quantity("1", "share of the full current", gt=0, le=2)
    frequency_hz: float = quantity("Hz", "of the oscillation", gt=0, le=500)

    @property
    def effect(self) -> Effect:
        """A sine, with the current or instead of it."""
        solid = self.mode == "solid"
        return Effect(Act.OSCILLATE, self.amplitude, frequency_hz=self.frequency_hz, part=Part.ADDED, uncommanded=solid)


class SpoolJam(_OfAll):
    """The spool stays where it is, and the ram moves at its opening. A chip, ice."""

    act = Effect(Act.SET, 1.0, part=Part.JAMMED)
    sentence = "spool jammed at {at}"
    example = "f16_elevator_spool_jam"

    kind: Literal["spool_jam"]


class Leak(_OfAll):
    """A share of the flow does not reach the ram. A worn seal."""

    sizes = ("share",)
    sentence = "leak from {at} on"
    example = "b737_rudder_leak"

    kind: Literal["leak"]
    share: float = quantity("1", "of the flow that is lost", gt=0, le=1)
    ramp_s: float = quantity("s", "it grows linearly from nothing over this time", 0.0, ge=0)

    @property
    def effect(self) -> Effect:
        """Return what is left of the flow."""
        return Effect(Act.SCALE, 1.0 - self.share, part=Part.LEFT)


class HydraulicLoss(_OfAll):
    """A hydraulic system loses pressure, for all surfaces. A burst line, a failed pump."""

    sites: ClassVar[tuple[Site, ...]] = ("hydraulics",)
    sizes = ("share",)
    sentence = "pressure lost at {at}"
    example = "f16_hydraulic_loss"

    kind: Literal["hydraulic_loss"]
    share: float = quantity("1", "of the pressure that is lost", 1.0, gt=0, le=1)
    ramp_s: float = quantity("s", "it falls linearly over this time", 0.0, ge=0)

    @property
    def effect(self) -> Effect:
        """Return what is left of the pressure."""
        return Effect(Act.SCALE, 1.0 - self.share, part=Part.PRESSURE)
