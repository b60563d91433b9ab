"""Kinds of faults that act for moments: spikes, gaps, repeated messages; x, y and t as in kinds.py."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import model_validator

from rig.faults.magnitude import require_one, sized, threshold_quantity
from rig.faults.places import site
from rig.faults.settings import Act, Corrupted, DutyCycle, Effect, Pulses, quantity

_MOST_TIMES = 64


class Spikes(Corrupted):
    """y = x + amplitude, or a given value, for moments. Corrupted data words, lightning, a wiper off its track."""

    kind: Literal["spikes"]
    amplitude: float | None = quantity("signal", "added to the value; either this or `value`", None)
    amplitude_thresholds: float | None = threshold_quantity("amplitude")
    value: float | None = quantity("signal", "takes the place of the value", None)
    times_s: list[float] | None = quantity("s", f"when, from the onset; at most {_MOST_TIMES}", None, min_length=1)
    rate_per_s: float | None = quantity("1/s", "or at random, so often a second on average", None, gt=0)
    width_s: float | None = quantity("s", "how long each lasts; not given: one frame", None, gt=0)

    @model_validator(mode="after")
    def _chosen(self) -> Spikes:
        require_one(self, "amplitude", "amplitude_thresholds", "value")
        if (self.times_s is None) == (self.rate_per_s is None):
            raise ValueError("either times_s or rate_per_s")
        if any(time < 0.0 for time in self.times_s or ()) or len(self.times_s or ()) > _MOST_TIMES:
            raise ValueError(f"times_s: at most {_MOST_TIMES} times, none below zero")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return sized(self, Act.ADD, "amplitude") if self.value is None else Effect(Act.SET, self.value)

    @property
    def pulses(self) -> Pulses:
        """At given times, or after pauses that are exponentially distributed."""
        width = self.width_s or 0.0
        if self.rate_per_s is None:
            return Pulses(DutyCycle.TIMES, on_s=width, times_s=sorted(self.times_s or ()))
        return Pulses(DutyCycle.RANDOM, on_s=width, off_s=1.0 / self.rate_per_s)


class Intermittent(Corrupted):
    """In gaps the value does not get through. A loose connector under vibration, a chafed wire."""

    sites = ("channel", "inertial", "reference", "discrete")
    kind: Literal["intermittent"]
    gap_s: float = quantity("s", "how long a gap lasts; it begins with one", gt=0)
    contact_s: float = quantity("s", "how long the contact holds between two", gt=0)
    random: bool = quantity("", "both are means of exponentially distributed times", False)
    in_gaps: Literal["last", "invalid", "no number", "high", "low"] = quantity("", "what is said in a gap", "last")

    @model_validator(mode="after")
    def _of_a_discrete(self) -> Intermittent:
        if site(self.signal) == "discrete" and self.in_gaps == "no number":
            raise ValueError(f"in_gaps: {self.signal} is a discrete, allowed: last, invalid, high, low")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        if self.in_gaps in ("high", "low"):
            return Effect(Act.END, 1.0 if self.in_gaps == "high" else -1.0)
        if self.in_gaps == "last":
            return Effect(Act.HOLD)
        return Effect(Act.NOTHING, invalid=True) if self.in_gaps == "invalid" else Effect(Act.NO_NUMBER)

    @property
    def pulses(self) -> Pulses:
        """Gap and contact in turn."""
        return Pulses(DutyCycle.TELEGRAPH if self.random else DutyCycle.CYCLE, self.gap_s, self.contact_s)


class DuplicateFrame(Corrupted):
    """y = x of the frame before, now and then. A sender slower than its reader: the old message is read again."""

    kind: Literal["duplicate_frame"]
    every_s: float | None = quantity("s", "regularly: from one duplicate to the next", None, gt=0)
    rate_per_s: float | None = quantity("1/s", "or at random, so often a second on average", None, gt=0)
    effect: ClassVar[Effect] = Effect(Act.REPEAT)

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
