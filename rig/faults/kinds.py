"""Kinds of faults that change a value: what they do, what causes them, in SI units.

x is the value as it stands when the fault's turn comes, y what becomes of it, t the time since the onset [s].
What a fault makes of a value stays within the range of its sensor or the stops of its surface.
"""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import model_validator

from rig.faults.magnitude import one_form, require_one, sized, threshold_quantity
from rig.faults.places import site
from rig.faults.settings import Act, Corrupted, Effect, Ramped, quantity

_WITH_SURFACE = ("channel", "inertial", "reference", "surface")


class Offset(Ramped):
    """y = x + offset. A shifted zero: a bent vane, a bad calibration, a misrigged control rod."""

    sites = _WITH_SURFACE
    kind: Literal["offset"]
    offset: float | None = quantity("signal", "added to the value", None)
    offset_thresholds: float | None = threshold_quantity("offset")

    _one_form = one_form("offset")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return sized(self, Act.ADD, "offset")


class Drift(Corrupted):
    """y = x + rate t, or x + settles_at (1 - exp(-t / time_constant)). A gyro warming up, a leaking pressure line."""

    sites = _WITH_SURFACE
    kind: Literal["drift"]
    rate_per_s: float | None = quantity("signal/s", "steady: how fast the error grows", None)
    rate_thresholds_per_s: float | None = threshold_quantity("rate_per_s")
    settles_at: float | None = quantity("signal", "exponential: the error in the end", None)
    settles_at_thresholds: float | None = threshold_quantity("settles_at")
    time_constant_s: float | None = quantity("s", "exponential: 63 % of it are there after this time", None, gt=0)

    @model_validator(mode="after")
    def _one_law(self) -> Drift:
        require_one(self, "rate_per_s", "rate_thresholds_per_s", "settles_at", "settles_at_thresholds")
        steady = self.rate_per_s is not None or self.rate_thresholds_per_s is not None
        if steady != (self.time_constant_s is None):
            raise ValueError("time_constant_s: goes with settles_at or settles_at_thresholds, which need it")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        if self.time_constant_s is not None:
            return sized(self, Act.SETTLE, "settles_at", self.time_constant_s)
        return sized(self, Act.DRIFT, "rate_per_s")


class Hardover(Ramped):
    """y = an end of the range. An open or shorted wire, a failed amplifier, a runaway actuator.

    An angle on the circle has no ends: y = x + half a turn, the furthest from where it should be; the direction is
    that of the ramp.
    """

    sites = _WITH_SURFACE
    kind: Literal["hardover"]
    direction: Literal["high", "low", "either"] = quantity("", "either: one of both, drawn from the seed", "high")

    @property
    def effect(self) -> Effect:
        """For the kernel; +1, -1, or 0 for what is still to be drawn."""
        return Effect(Act.END, {"high": 1.0, "low": -1.0, "either": 0.0}[self.direction])


class Scale(Ramped):
    """y = factor x. A wrong excitation, a cracked bellows; on a surface, a part of it lost (loss of effectiveness)."""

    sites = _WITH_SURFACE
    kind: Literal["scale"]
    factor: float = quantity("1", "what is left of the value: 1 nothing lost, 0 all")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.SCALE, self.factor)


class SignReversal(Corrupted):
    """y = -x. Wires or pneumatic lines swapped in maintenance, crossed control cables."""

    sites = _WITH_SURFACE
    kind: Literal["sign_reversal"]
    effect: ClassVar[Effect] = Effect(Act.SCALE, -1.0)


class Stuck(Ramped):
    """y = the last value before the onset, or a given one. A frozen vane, a hung processor, a jammed actuator."""

    sites = (*_WITH_SURFACE, "discrete")
    kind: Literal["stuck"]
    value: float | None = quantity(
        "signal", "where it sticks (a discrete: 0 or 1); not given: where it is (a surface: its true position)", None
    )

    @model_validator(mode="after")
    def _of_a_discrete(self) -> Stuck:
        if site(self.signal) == "discrete" and self.value not in (None, 0.0, 1.0):
            raise ValueError(f"value: {self.signal} is a discrete, allowed: 0, 1; got {self.value:g}")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.HOLD) if self.value is None else Effect(Act.SET, self.value)


class Noise(Ramped):
    """y = x + std n, n white and normal, of its own on every channel. A worn bearing, a failing supply."""

    kind: Literal["noise"]
    std: float | None = quantity("signal", "standard deviation of what is added to each sample", None, gt=0)
    std_thresholds: float | None = threshold_quantity("std", gt=0)

    _one_form = one_form("std")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return sized(self, Act.NOISE, "std")


class Oscillation(Ramped):
    """y = x + A sin(2 pi f t), or the last value instead of x. An unstable servo loop, a loose connection that hums."""

    sites = _WITH_SURFACE
    kind: Literal["oscillation"]
    amplitude: float | None = quantity("signal", "A", None, gt=0)
    amplitude_thresholds: float | None = threshold_quantity("amplitude", gt=0)
    frequency_hz: float = quantity("Hz", "f", gt=0, le=500)
    replacing: bool = quantity(
        "", "it takes the place of the value, about the last one, instead of adding to it", False
    )

    _one_form = one_form("amplitude")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return sized(self, Act.SWING if self.replacing else Act.OSCILLATE, "amplitude", self.frequency_hz)


class Dropout(Corrupted):
    """No value. A broken link: the sensor flags it invalid or, not flagged, says what is no number.

    The inertial unit and the references have no flag: there it is no number either way.
    """

    sites = ("channel", "inertial", "reference", "discrete")
    kind: Literal["dropout"]
    flagged: bool = quantity("", "marked invalid, the value stays; else no number", True)

    @model_validator(mode="after")
    def _of_a_discrete(self) -> Dropout:
        if site(self.signal) == "discrete" and not self.flagged:
            raise ValueError(f"flagged: {self.signal} is a discrete, which is always 0 or 1; must be true")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.NOTHING, invalid=True) if self.flagged else Effect(Act.NO_NUMBER)


class Delay(Corrupted):
    """y = x of so long ago. A congested bus, a computer that falls behind, a blocked pneumatic line."""

    sites = _WITH_SURFACE
    kind: Literal["delay"]
    latency_s: float = quantity("s", "in whole frames, rounded up", gt=0, le=10)

    @property
    def effect(self) -> Effect:
        """For the kernel; the schedule makes frames of the time."""
        return Effect(Act.DELAY, self.latency_s, 1.0)


class FrameSkew(Corrupted):
    """y = x between two frames, so much earlier. Channels that are not synchronised sample at different moments."""

    sites = ("channel", "inertial")
    kind: Literal["frame_skew"]
    skew_s: float = quantity("s", "how much earlier than the others; a part of a frame or several", gt=0, le=1)

    @property
    def effect(self) -> Effect:
        """For the kernel; the schedule makes frames of the time."""
        return Effect(Act.DELAY, self.skew_s, 0.0)


class Quantisation(Corrupted):
    """y = step round(x / step). Lost bits of a converter or of a data word."""

    kind: Literal["quantisation"]
    step: float | None = quantity("signal", "the coarse step", None, gt=0)
    step_thresholds: float | None = threshold_quantity("step", gt=0)

    _one_form = one_form("step")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return sized(self, Act.QUANTISE, "step")


class CrossTalk(Ramped):
    """y = x + gain s, s another signal on the same channel. Coupling between wires, a damaged shield."""

    kind: Literal["cross_talk"]
    source: str = quantity("", "the place of s, of the same sort as the fault's own")
    gain: float = quantity("signal/source", "how much of it comes over")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.CROSS_TALK, self.gain, source=self.source)
