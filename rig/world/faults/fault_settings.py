"""Settings of every entry of ``[[faults]]``, and the declarations of a kind.

An entry has a name, a trigger, a duration, repetitions and a place.  A kind is a class with a ``kind`` in kinds.py,
data_path.py or systems.py.  The class declares everything that other modules need of the kind: see ``Triggered``.
A magnitude is given in the unit of the signal or in thresholds of its monitor, in one of the two forms.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Final, NamedTuple

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from rig.core import fault_names
from rig.core.frame import CHANNELS
from rig.core.settings import Settings
from rig.world.faults.effects import Act, Effect, Flag
from rig.world.faults.expression import parse
from rig.world.faults.places import CHANNELLED, FLIGHT, WITH_THRESHOLD, Places, Point, Site, places_of, refuse_unknown
from rig.world.faults.trigger import Pulses, Transition


def quantity(unit: str, meaning: str, default: Any = ..., **bounds: Any) -> Any:
    """Return a setting with its unit (``signal``: the unit of the signal) and its meaning, for the catalogue."""
    return Field(default, description=meaning, json_schema_extra={"unit": unit}, **bounds)


def in_thresholds(key: str) -> str:
    """Return the key that gives the magnitude ``key`` in thresholds."""
    return f"{key.removesuffix('_per_s')}_thresholds_per_s" if key.endswith("_per_s") else f"{key}_thresholds"


def threshold_quantity(key: str, **bounds: Any) -> Any:
    """Return the setting of the magnitude ``key`` in thresholds."""
    unit = "thresholds/s" if key.endswith("_per_s") else "thresholds"
    return quantity(unit, f"instead of `{key}`: in thresholds of the signal's monitor", None, **bounds)


def _distinct(channels: list[int]) -> list[int]:
    if any(not 1 <= channel <= CHANNELS for channel in channels) or len(set(channels)) < len(channels):
        raise ValueError(f"channels must be different numbers from 1 to {CHANNELS}, got {channels}")
    return channels


Channels = Annotated[list[int], AfterValidator(_distinct)]  # different numbers from 1 on


_TRIGGERS: Final = ("when", "on", "after", "rate_per_hour")


class Size(NamedTuple):
    """Magnitude of a fault, as given in its settings."""

    value: float
    thresholds: bool  # in thresholds of the signal's monitor, else in the unit of its setting


class Triggered(Settings):
    """A name, one trigger, the duration and the repetitions of a fault.

    A kind declares its effect (``act``, or ``effect`` if it depends on settings; ``pulses``; ``flag``), the settings
    of its size, the sentence of a report, and the bundled scenario that shows it.
    """

    act: ClassVar[Act | Effect]  # done by its size, or an effect that no setting changes
    sizes: ClassVar[tuple[str, ...]] = ()  # settings that say how large it is: the one that is given does
    trials_draw: ClassVar[bool] = False  # whether open-loop trials may draw the size: it is the kernel's ``value``
    found_at_once: ClassVar[bool] = False  # whether its error is beyond any threshold from the onset on
    hidden_at_rest: ClassVar[bool] = False  # whether there is no error until the value moves
    # {where}, {at}; {value}: the sample in the frame of the decision; {error}: the largest injected error
    sentence: ClassVar[str] = "{kind} from {at} on, an error of up to {error}"
    unseen: ClassVar[str] = ""  # why it was not detected, if not because no threshold was exceeded
    changes_samples: ClassVar[bool] = True  # else there is nothing to fail a channel for
    takes_channels: ClassVar[bool] = False  # whether the other computers get no samples through the one it sits on
    example: ClassVar[str]

    id: str | None = quantity("", "name in events, in tables and for `after`", None, pattern=r"^[^\x00-\x1f]+$")
    start_s: float | None = quantity(
        "s",
        "trigger: onset at this time; with `when`, `on`, `rate_per_hour`: the trigger is armed from here",
        None,
        ge=0,
    )
    when: str | None = quantity("", "trigger: a condition on voted and `true.` quantities", None)
    for_s: float | None = quantity("s", "hold time of the condition", None, gt=0)
    on: Transition | None = quantity(
        "",
        "trigger: a change of the autopilot, or of the level, pattern, decided_by, source or channel state of a signal",
        None,
    )
    after: str | None = quantity("", "trigger: the onset of the fault with this id", None)
    delay_s: float | None = quantity("s", "delay from the trigger to the onset; with `when`, `on`, `after`", None, ge=0)
    rate_per_hour: float | None = quantity(
        "1/h", "trigger: at random, with this mean rate per flight hour", None, gt=0, le=3.6e5
    )
    end_s: float | None = quantity("s", "flight time at which the fault ends finally", None, gt=0)
    duration_s: float | None = quantity("s", "duration from the onset; if not given: until the end", None, gt=0)
    repeat_every_s: float | None = quantity("s", "repeat interval, onset to onset", None, gt=0)
    repeats: int | None = quantity("", "number of repeats; if not given: until the end", None, ge=1)

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
            raise ValueError("for_s: allowed only with when")
        if self.delay_s is not None and trigger not in ("when", "on", "after"):
            raise ValueError("delay_s: allowed only with when, on or after")
        if self.start_s is not None and trigger == "after":
            raise ValueError("start_s: not allowed with after; use delay_s")
        return self

    @model_validator(mode="after")
    def _ordered(self) -> Triggered:
        if self.end_s is not None and self.end_s <= (self.start_s or 0.0):
            raise ValueError(f"end_s ({self.end_s:g}) must be after start_s ({self.start_s or 0.0:g})")
        if self.repeats is not None and self.repeat_every_s is None:
            raise ValueError("repeats: allowed only with repeat_every_s")
        if self.repeat_every_s is not None:
            if self.rate_per_hour is not None:
                raise ValueError("repeat_every_s: not allowed with rate_per_hour, which already repeats the fault")
            if self.duration_s is None or self.duration_s >= self.repeat_every_s:
                raise ValueError("repeat_every_s: requires a duration_s shorter than repeat_every_s")
        return self

    @property
    def label(self) -> str:
        """The fault's name in events and tables."""
        return fault_names.label(dict(self))

    @property
    @abstractmethod
    def points(self) -> list[Point]:
        """The values that it acts on."""

    @property
    def drives(self) -> tuple[str, int] | None:
        """Surface and channel from 1 of a servo that a fault elsewhere drives wrongly; None: it drives none."""
        return None

    @property
    def targets(self) -> list[Point]:
        """The values that get a separate record for the kernel."""
        return self.points

    @property
    def size(self) -> Size | None:
        """The size, with its sign; None for a kind without one."""
        for key in self.sizes:
            for name, thresholds in ((key, False), (in_thresholds(key), True)):
                value = getattr(self, name, None)
                if value is not None:
                    return Size(float(value), thresholds)
        return None

    @property
    def magnitude(self) -> Size | None:
        """The size without its sign, for tables."""
        return None if self.size is None else self.size._replace(value=abs(self.size.value))

    @property
    def effect(self) -> Effect:
        """The effect for the kernel: ``act``, an operation by the size."""
        return self.act if isinstance(self.act, Effect) else self.sized(self.act)

    def effect_on(self, point: Point) -> Effect:
        """Return the effect on one of its ``targets``: the same on all."""
        return self.effect

    def sized(self, act: Act, **more: Any) -> Effect:
        """Return the effect of the size that is given, with what else ``act`` needs."""
        size = self.size
        return Effect(act, **more) if size is None else Effect(act, *size, **more)

    @property
    def flag(self) -> Flag:
        """The effect on the in-line monitors of its channels."""
        return Flag.BAD if getattr(self, "seen_by_ilm", False) else Flag.LEAVE

    @property
    def pulses(self) -> Pulses:
        """The pulses in which it acts: always."""
        return Pulses()

    def check_fitted(self, fitted: Mapping[str, int], places: Places = FLIGHT) -> None:
        """Raise ValueError where it names channels that are not ``fitted``: number by signal and discrete."""
        for place, channel in self.points:
            if channel is not None and channel > fitted.get(place, CHANNELS):
                raise ValueError(f"channels: {place} has {fitted[place]} channels, got [{channel}]")
        on = self.on
        if on is not None and on.signal is not None and on.channel is not None and on.channel > fitted[on.signal]:
            raise ValueError(f"on.channel: {on.signal} has {fitted[on.signal]} channels, got {on.channel}")


class Placed(Triggered):
    """A fault on channels of one signal or discrete, or on one value of the inertial unit, a reference or a surface."""

    sites: ClassVar[tuple[Site, ...]] = ("channel", "inertial", "reference")
    on_channels: ClassVar[bool | None] = None  # None: where the place has channels

    signal: Annotated[str, AfterValidator(refuse_unknown)] = quantity(
        "", "place: <signal>, <discrete>, inertial.<quantity>, reference.<signal>, surface.<name> and so on"
    )
    channels: Channels = quantity("", "channels of a signal, a discrete or an actuator, from 1", [])

    @model_validator(mode="after")
    def _placed(self, info: ValidationInfo) -> Placed:
        where = places_of(info).site(self.signal)
        if where not in self.sites:
            on = f"{self.signal}, a discrete" if where == "discrete" else self.signal
            raise ValueError(f"signal: {dict(self)['kind']} cannot act on {on}, allowed: {', '.join(self.sites)}")
        channelled = where in CHANNELLED if self.on_channels is None else self.on_channels
        if channelled and not self.channels:
            raise ValueError("channels: at least 1 is needed")
        if not channelled and self.channels:
            kind, shared = dict(self)["kind"], f"a part that all channels of {self.signal} share"
            why = f"{kind} acts on {shared}, give none" if where == "actuator" else f"{self.signal} has none"
            raise ValueError(f"channels: {why}, got {self.channels}")
        if where not in CHANNELLED and getattr(self, "seen_by_ilm", False):
            raise ValueError(f"seen_by_ilm: {self.signal} has no in-line monitor")
        if where == "discrete" and getattr(self, "ramp_s", 0.0) > 0:
            raise ValueError(f"ramp_s: {self.signal} is a discrete, which has no values between 0 and 1")
        return self

    @model_validator(mode="after")
    def _has_a_threshold(self, info: ValidationInfo) -> Placed:
        where = places_of(info).site(self.signal)
        for key in type(self).model_fields:
            if "_thresholds" in key and getattr(self, key) is not None and where not in WITH_THRESHOLD:
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
        "true: the in-line monitors of its channels report bad while it acts; false: they do not; if not given: only "
        "those of sticks and pedal respond, by their measurement",
        None,
    )


class Ramped(Corrupted):
    """A fault that may come on gradually."""

    ramp_s: float = quantity("s", "the effect grows linearly from zero over this time", 0.0, ge=0)


def require_one(fault: Placed, *keys: str) -> None:
    """Raise ValueError unless exactly one of ``keys`` is given."""
    if sum(getattr(fault, key) is not None for key in keys) != 1:
        raise ValueError(f"give either {' or '.join(keys)}")


def one_form(key: str) -> Any:
    """Return a validator of a kind: the magnitude ``key`` is given in one of its two forms."""

    def check(fault: Placed) -> Placed:
        require_one(fault, key, in_thresholds(key))
        return fault

    return model_validator(mode="after")(check)
