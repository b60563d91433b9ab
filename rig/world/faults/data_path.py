"""Kinds of faults on the way of a sample from its sensor to the computer. x, y and t are defined in kinds.py."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import ValidationInfo, model_validator

from rig.world.faults.effects import Act, Effect
from rig.world.faults.fault_settings import Corrupted, Ramped, one_form, quantity, threshold_quantity
from rig.world.faults.kinds import WITH_SURFACE
from rig.world.faults.places import FLIGHT, Places, places_of
from rig.world.faults.trigger import DutyCycle, Pulses


class Intermittent(Corrupted):
    """The value is lost in gaps. Causes: a loose connector under vibration, a chafed wire."""

    sites, act, sizes = ("channel", "inertial", "reference", "discrete"), Act.HOLD, ("gap_s",)
    example = "b747_heading_intermittent"

    kind: Literal["intermittent"]
    gap_s: float = quantity("s", "length of a gap; the fault begins with a gap", gt=0)
    contact_s: float = quantity("s", "time between two gaps", gt=0)
    random: bool = quantity("", "true: both times are exponentially distributed with these means", False)
    in_gaps: Literal["last", "invalid", "no number", "high", "low"] = quantity("", "sample during a gap", "last")

    @model_validator(mode="after")
    def _of_a_discrete(self, info: ValidationInfo) -> Intermittent:
        if places_of(info).site(self.signal) == "discrete" and self.in_gaps == "no number":
            raise ValueError(f"in_gaps: {self.signal} is a discrete, allowed: last, invalid, high, low")
        return self

    @property
    def effect(self) -> Effect:
        """The effect in a gap."""
        if self.in_gaps in ("high", "low"):
            return Effect(Act.RANGE_END, 1.0 if self.in_gaps == "high" else -1.0)
        if self.in_gaps == "last":
            return Effect(Act.HOLD)
        return Effect(Act.VALID_ONLY, invalid=True) if self.in_gaps == "invalid" else Effect(Act.NO_NUMBER)

    @property
    def pulses(self) -> Pulses:
        """Gap and contact in turn."""
        return Pulses(DutyCycle.TELEGRAPH if self.random else DutyCycle.CYCLE, self.gap_s, self.contact_s)


class Dropout(Corrupted):
    """No value: the sample is flagged invalid, or it is not a number. Cause: a broken connection.

    The inertial unit and the references have no validity flag. Their value is not a number in both cases.
    """

    sites, act, found_at_once = ("channel", "inertial", "reference", "discrete"), Act.VALID_ONLY, True
    sentence = "no valid sample from {at} on"
    example = "f16_lost_sticks"

    kind: Literal["dropout"]
    flagged: bool = quantity("", "true: flagged invalid, the value stays; false: not a number", True)

    @model_validator(mode="after")
    def _of_a_discrete(self, info: ValidationInfo) -> Dropout:
        if places_of(info).site(self.signal) == "discrete" and not self.flagged:
            raise ValueError(f"flagged: {self.signal} is a discrete, which is always 0 or 1; must be true")
        return self

    @property
    def effect(self) -> Effect:
        """Flagged, or no number."""
        return Effect(Act.VALID_ONLY, invalid=True) if self.flagged else Effect(Act.NO_NUMBER)


class Delay(Corrupted):
    """y = an earlier x. Causes: a congested bus, an overloaded computer, a blocked pneumatic line."""

    sites, act, sizes = WITH_SURFACE, Act.DELAY, ("latency_s",)
    example = "b737_static_pressure_delay"

    kind: Literal["delay"]
    latency_s: float = quantity("s", "age of the value, rounded up to whole frames", gt=0, le=10)

    @property
    def effect(self) -> Effect:
        """A delay in whole frames, rounded up."""
        return self.sized(Act.DELAY, whole_frames=True)


class FrameSkew(Corrupted):
    """y = an earlier x, interpolated between two frames. Cause: channels that are not synchronised."""

    sites, act, sizes = ("channel", "inertial"), Act.DELAY, ("skew_s",)
    example = "f16_pitch_rate_frame_skew"

    kind: Literal["frame_skew"]
    skew_s: float = quantity("s", "age of the value; may be less than a frame", gt=0, le=1)


class Quantisation(Corrupted):
    """y = step round(x / step). Cause: lost bits of a converter or of a data word."""

    act, sizes, trials_draw = Act.QUANTISE, ("step",), True
    example = "b747_dynamic_pressure_quantisation"

    kind: Literal["quantisation"]
    step: float | None = quantity("signal", "step size", None, gt=0)
    step_thresholds: float | None = threshold_quantity("step", gt=0)

    _one_form = one_form("step")


class CrossTalk(Ramped):
    """y = x + gain s, s another signal on the same channel. Causes: coupling between wires, a damaged shield."""

    act, sizes = Act.CROSS_TALK, ("gain",)
    example = "f16_stick_roll_cross_talk"

    kind: Literal["cross_talk"]
    source: str = quantity("", "where s is taken from; a place of the same sort as `signal`")
    gain: float = quantity("signal/source", "gain from the source")

    @property
    def effect(self) -> Effect:
        """From the source."""
        return self.sized(Act.CROSS_TALK, source_place=self.source)

    def check_fitted(self, fitted: Mapping[str, int], places: Places = FLIGHT) -> None:
        """Also raise ValueError unless the source is another place of the same sort with the same channels fitted."""
        super().check_fitted(fitted, places)
        alike = self.source in places.index and places.site(self.source) == places.site(self.signal)
        if not alike or self.source == self.signal:
            raise ValueError(f"source: {self.source!r} must be another place of the same sort as {self.signal}")
        beyond = [channel for channel in self.channels if channel > fitted[self.source]]
        if beyond:
            raise ValueError(f"source: {self.source} has {fitted[self.source]} channels, got {beyond}")


class DuplicateFrame(Corrupted):
    """y = x of the frame before, in single frames. Cause: a sender slower than its reader."""

    act = Act.REPEAT
    example = "b737_roll_angle_duplicate_frame"

    kind: Literal["duplicate_frame"]
    every_s: float | None = quantity("s", "period of regular duplicates; give this or `rate_per_s`", None, gt=0)
    rate_per_s: float | None = quantity("1/s", "mean rate of random duplicates; give this or `every_s`", None, gt=0)

    @model_validator(mode="after")
    def _one_duty_cycle(self) -> DuplicateFrame:
        if (self.every_s is None) == (self.rate_per_s is None):
            raise ValueError("give either every_s or rate_per_s")
        return self

    @property
    def pulses(self) -> Pulses:
        """One frame each."""
        if self.rate_per_s is not None:
            return Pulses(DutyCycle.RANDOM, off_s=1.0 / self.rate_per_s)
        return Pulses(DutyCycle.CYCLE, on_s=0.0, off_s=self.every_s or 0.0)
