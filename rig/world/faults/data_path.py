"""Kinds of faults on the way of a sample from its sensor to the computer; x, y and t as in kinds.py."""

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
    """In gaps the value does not get through. A loose connector under vibration, a chafed wire."""

    sites, act, sizes = ("channel", "inertial", "reference", "discrete"), Act.HOLD, ("gap_s",)
    example = "b747_heading_intermittent"

    kind: Literal["intermittent"]
    gap_s: float = quantity("s", "how long a gap lasts; it begins with one", gt=0)
    contact_s: float = quantity("s", "how long the contact holds between two", gt=0)
    random: bool = quantity("", "both are means of exponentially distributed times", False)
    in_gaps: Literal["last", "invalid", "no number", "high", "low"] = quantity("", "what is said in a gap", "last")

    @model_validator(mode="after")
    def _of_a_discrete(self, info: ValidationInfo) -> Intermittent:
        if places_of(info).site(self.signal) == "discrete" and self.in_gaps == "no number":
            raise ValueError(f"in_gaps: {self.signal} is a discrete, allowed: last, invalid, high, low")
        return self

    @property
    def effect(self) -> Effect:
        """The value in a gap."""
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
    """No value. A broken link: the sensor flags it invalid or, not flagged, says what is no number.

    The inertial unit and the references have no flag: there it is no number either way.
    """

    sites, act, found_at_once = ("channel", "inertial", "reference", "discrete"), Act.VALID_ONLY, True
    sentence = "no valid sample from {at} on"
    example = "f16_lost_sticks"

    kind: Literal["dropout"]
    flagged: bool = quantity("", "marked invalid, the value stays; else no number", True)

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
    """y = x of so long ago. A congested bus, a computer that falls behind, a blocked pneumatic line."""

    sites, act, sizes = WITH_SURFACE, Act.DELAY, ("latency_s",)
    example = "b737_static_pressure_delay"

    kind: Literal["delay"]
    latency_s: float = quantity("s", "in whole frames, rounded up", gt=0, le=10)

    @property
    def effect(self) -> Effect:
        """The schedule makes frames of the time, rounded up."""
        return self.sized(Act.DELAY, whole_frames=True)


class FrameSkew(Corrupted):
    """y = x between two frames, so much earlier. Channels that are not synchronised sample at different moments."""

    sites, act, sizes = ("channel", "inertial"), Act.DELAY, ("skew_s",)
    example = "f16_pitch_rate_frame_skew"

    kind: Literal["frame_skew"]
    skew_s: float = quantity("s", "how much earlier than the others; a part of a frame or several", gt=0, le=1)


class Quantisation(Corrupted):
    """y = step round(x / step). Lost bits of a converter or of a data word."""

    act, sizes, trials_draw = Act.QUANTISE, ("step",), True
    example = "b747_dynamic_pressure_quantisation"

    kind: Literal["quantisation"]
    step: float | None = quantity("signal", "the coarse step", None, gt=0)
    step_thresholds: float | None = threshold_quantity("step", gt=0)

    _one_form = one_form("step")


class CrossTalk(Ramped):
    """y = x + gain s, s another signal on the same channel. Coupling between wires, a damaged shield."""

    act, sizes = Act.CROSS_TALK, ("gain",)
    example = "f16_stick_roll_cross_talk"

    kind: Literal["cross_talk"]
    source: str = quantity("", "the place of s, of the same sort as the fault's own")
    gain: float = quantity("signal/source", "how much of it comes over")

    @property
    def effect(self) -> Effect:
        """From the source."""
        return self.sized(Act.CROSS_TALK, source_place=self.source)

    def check_fitted(self, fitted: Mapping[str, int], places: Places = FLIGHT) -> None:
        """Raise ValueError, too, unless it comes from another place of the same sort, on channels a fitted one."""
        super().check_fitted(fitted, places)
        alike = self.source in places.index and places.site(self.source) == places.site(self.signal)
        if not alike or self.source == self.signal:
            raise ValueError(f"source: {self.source!r} must be another place of the sort of {self.signal}")
        beyond = [channel for channel in self.channels if channel > fitted[self.source]]
        if beyond:
            raise ValueError(f"source: {self.source} has {fitted[self.source]} channels, got {beyond}")


class DuplicateFrame(Corrupted):
    """y = x of the frame before, now and then. A sender slower than its reader: the old message is read again."""

    act = Act.REPEAT
    example = "b737_roll_angle_duplicate_frame"

    kind: Literal["duplicate_frame"]
    every_s: float | None = quantity("s", "regularly: from one duplicate to the next", None, gt=0)
    rate_per_s: float | None = quantity("1/s", "or at random, so often a second on average", None, gt=0)

    @model_validator(mode="after")
    def _one_duty_cycle(self) -> DuplicateFrame:
        if (self.every_s is None) == (self.rate_per_s is None):
            raise ValueError("either every_s or rate_per_s")
        return self

    @property
    def pulses(self) -> Pulses:
        """One frame each."""
        if self.rate_per_s is not None:
            return Pulses(DutyCycle.RANDOM, off_s=1.0 / self.rate_per_s)
        return Pulses(DutyCycle.CYCLE, on_s=0.0, off_s=self.every_s or 0.0)
