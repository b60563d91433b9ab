"""What every entry of ``[[faults]]`` has: a name, a trigger, how long and how often it acts, where it sits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, Field, field_validator, model_validator

from rig.faults.expression import parse
from rig.faults.places import CHANNELLED, WITH_THRESHOLD, Point, Site, refuse_unknown, site
from rig.faults.transition import Transition
from rig.frame import CHANNELS
from rig.settings import Settings
from rig.util import fault_names


def quantity(unit: str, meaning: str, default: Any = ..., **bounds: Any) -> Any:
    """A setting with its unit, ``signal`` for that of the signal, and what it means, for the catalogue."""
    return Field(default, description=meaning, json_schema_extra={"unit": unit}, **bounds)


def _distinct(channels: list[int]) -> list[int]:
    if any(not 1 <= channel <= CHANNELS for channel in channels) or len(set(channels)) < len(channels):
        raise ValueError(f"channels are different numbers from 1 to {CHANNELS}, got {channels}")
    return channels


Channels = Annotated[list[int], AfterValidator(_distinct)]  # different numbers from 1 on


class Act(IntEnum):
    """What a kernel does to a value."""

    NOTHING = 0  # to the value; its validity or its in-line monitor are another matter
    ADD = 1
    DRIFT = 2
    SETTLE = 3
    SET = 4
    HOLD = 5
    SCALE = 6
    NOISE = 7
    OSCILLATE = 8
    SWING = 9
    DELAY = 10
    QUANTISE = 11
    CROSS_TALK = 12
    REPEAT = 13
    NO_NUMBER = 14
    LIMIT_RATE = 15
    ICE = 16
    END = 17  # an end of the range, which the schedule makes SET or, for an angle on the circle, TURN
    INVERT = 18  # of a discrete
    TURN = 19  # half a turn away


class DutyCycle(IntEnum):
    """When a fault acts within its time: always, or in pulses."""

    STEADY = 0
    TIMES = 1  # at given times
    RANDOM = 2  # at random times
    CYCLE = 3  # on and off, regularly
    TELEGRAPH = 4  # on and off, at random


class Flag(IntEnum):
    """What a fault does to the in-line monitors of its channels."""

    LEAVE = 0
    BAD = 1
    GOOD = 2
    INVERT = 3


@dataclass(frozen=True, slots=True)
class Effect:
    """What a fault does to each of its values, as numbers for the kernel."""

    act: Act
    value: float = 0.0
    second: float = 0.0
    source: str | None = None  # the place that cross-talk comes from
    invalid: bool = False  # the sensor flags the sample
    thresholds: bool = False  # ``value`` is in thresholds of the signal's monitor


@dataclass(frozen=True, slots=True)
class Pulses:
    """When within its time a fault acts; times in seconds, means of random ones."""

    duty_cycle: DutyCycle = DutyCycle.STEADY
    on_s: float = 0.0  # 0: one frame
    off_s: float = 0.0
    times_s: Sequence[float] = ()


STEADY = Pulses()


_TRIGGERS = ("when", "on", "after", "rate_per_hour")


class Triggered(Settings):
    """A name, one trigger, and how long and how often the fault acts after it."""

    id: str | None = quantity("", "its name in events, tables and `after`", None, pattern=r"^[^\x00-\x1f]+$")
    start_s: float | None = quantity(
        "s", "trigger: this time; with `when`, `on`, `rate_per_hour`: armed from", None, ge=0
    )
    when: str | None = quantity("", "trigger: a condition over voted and `true.` quantities", None)
    for_s: float | None = quantity("s", "the condition must hold for so long", None, gt=0)
    on: Transition | None = quantity(
        "",
        "trigger: a change of the autopilot, or of a signal's level, pattern, resolver, source or channel state",
        None,
    )
    after: str | None = quantity("", "trigger: the onset of the fault of this id", None)
    delay_s: float | None = quantity("s", "from the trigger to the onset, with `when`, `on`, `after`", None, ge=0)
    rate_per_hour: float | None = quantity("1/h", "trigger: at random, so often per flight hour", None, gt=0, le=3.6e5)
    end_s: float | None = quantity("s", "time of the flight at which it ends for good", None, gt=0)
    duration_s: float | None = quantity("s", "how long it acts from its onset", None, gt=0)
    repeat_every_s: float | None = quantity("s", "it acts again so long after its onset", None, gt=0)
    repeats: int | None = quantity("", "how often it acts again; not given: to the end", None, ge=1)

    @field_validator("when")
    @classmethod
    def _readable(cls, text: str | None) -> str | None:
        if text is not None:
            parse(text)
        return text

    @model_validator(mode="after")
    def _triggered_once(self) -> Triggered:
        given = [name for name in _TRIGGERS if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"{' and '.join(given)}: a fault has one trigger")
        if not given and self.start_s is None:
            raise ValueError("a trigger is missing: start_s, when, on, after or rate_per_hour")
        trigger = given[0] if given else "start_s"
        if self.for_s is not None and trigger != "when":
            raise ValueError("for_s: goes with when")
        if self.delay_s is not None and trigger not in ("when", "on", "after"):
            raise ValueError("delay_s: goes with when, on or after")
        if self.start_s is not None and trigger == "after":
            raise ValueError("start_s: does not go with after; use delay_s")
        return self

    @model_validator(mode="after")
    def _ordered(self) -> Triggered:
        if self.end_s is not None and self.end_s <= (self.start_s or 0.0):
            raise ValueError(f"end_s ({self.end_s:g}) must be after start_s ({self.start_s or 0.0:g})")
        if self.repeats is not None and self.repeat_every_s is None:
            raise ValueError("repeats: goes with repeat_every_s")
        if self.repeat_every_s is not None:
            if self.rate_per_hour is not None:
                raise ValueError("repeat_every_s: does not go with rate_per_hour, which repeats by itself")
            if self.duration_s is None or self.duration_s >= self.repeat_every_s:
                raise ValueError("repeat_every_s: needs a duration_s that is shorter")
        return self

    @property
    def label(self) -> str:
        """The fault's name in events and tables."""
        return fault_names.label(dict(self))

    @property
    def flag(self) -> Flag:
        """What happens to the in-line monitors of its channels."""
        return Flag.BAD if getattr(self, "seen_by_ilm", False) else Flag.LEAVE

    @property
    def pulses(self) -> Pulses:
        """When within its time it acts."""
        return STEADY


class Placed(Triggered):
    """A fault on channels of one signal or discrete, or on one value of the inertial unit, a reference or a surface.

    Every kind says what it does as ``effect`` and, when it acts in pulses, ``pulses``.
    """

    sites: ClassVar[tuple[Site, ...]] = ("channel", "inertial", "reference")

    signal: Annotated[str, AfterValidator(refuse_unknown)] = quantity(
        "", "where it sits: <signal>, <discrete>, inertial.<quantity>, reference.<signal>, surface.<name>"
    )
    channels: Channels = quantity("", "of a signal or discrete, counted from 1; nothing else has any", [])

    @model_validator(mode="after")
    def _placed(self) -> Placed:
        where = site(self.signal)
        if where not in self.sites:
            on = f"{self.signal}, a discrete" if where == "discrete" else self.signal
            raise ValueError(f"signal: {dict(self)['kind']} cannot sit on {on}, allowed: {', '.join(self.sites)}")
        if where in CHANNELLED and not self.channels:
            raise ValueError("channels: at least 1 is needed")
        if where not in CHANNELLED and self.channels:
            raise ValueError(f"channels: {self.signal} has none, got {self.channels}")
        if where not in CHANNELLED and getattr(self, "seen_by_ilm", False):
            raise ValueError(f"seen_by_ilm: {self.signal} has no in-line monitor")
        if where == "discrete" and getattr(self, "ramp_s", 0.0) > 0:
            raise ValueError(f"ramp_s: {self.signal} is a discrete, which has no values between 0 and 1")
        return self

    @model_validator(mode="after")
    def _has_a_threshold(self) -> Placed:
        for key in type(self).model_fields:
            if "_thresholds" in key and getattr(self, key) is not None and site(self.signal) not in WITH_THRESHOLD:
                raise ValueError(f"{key}: {self.signal} has no threshold, give {key.replace('_thresholds', '')}")
        return self

    @property
    def points(self) -> list[Point]:
        """The values that it acts on."""
        return [Point(self.signal, channel) for channel in self.channels] or [Point(self.signal)]


class Corrupted(Placed):
    """A fault of the value itself; the channel's in-line monitor may see it."""

    seen_by_ilm: bool | None = quantity(
        "",
        "true: the in-line monitors of its channels say bad while it acts; false: they do not; not given: those of "
        "sticks and pedal measure, no other sees anything",
        None,
    )


class Ramped(Corrupted):
    """A fault that may come on gradually."""

    ramp_s: float = quantity("s", "its effect grows linearly from nothing over this time", 0.0, ge=0)
