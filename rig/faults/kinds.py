"""Kinds of faults that change a value: what they do, what causes them, in SI units.

x is the value as it stands when the fault's turn comes, y what becomes of it, t the time since the onset [s].
What a fault makes of a value stays within the range of its sensor or the stops of its surface.
"""

from __future__ import annotations

from typing import Literal

from pydantic import model_validator

from rig.faults.settings import Act, Effect, Pulses, Ramped, Rhythm, Spoiled, quantity

_WITH_SURFACE = ("channel", "inertial", "reference", "surface")
_MOST_TIMES = 64


class Offset(Ramped):
    """y = x + offset. A shifted zero: a bent vane, a bad calibration, a misrigged control rod."""

    sites = _WITH_SURFACE
    kind: Literal["offset"]
    offset: float = quantity("signal", "added to the value")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.ADD, self.offset)


class Drift(Spoiled):
    """y = x + rate t, or x + settles_at (1 - exp(-t / time_constant)). A gyro warming up, a leaking pressure line."""

    sites = _WITH_SURFACE
    kind: Literal["drift"]
    rate_per_s: float | None = quantity("signal/s", "steady: how fast the error grows", None)
    settles_at: float | None = quantity("signal", "exponential: the error in the end", None)
    time_constant_s: float | None = quantity("s", "exponential: 63 % of it are there after this time", None, gt=0)

    @model_validator(mode="after")
    def _one_law(self) -> Drift:
        if (self.settles_at is None) != (self.time_constant_s is None):
            raise ValueError("settles_at and time_constant_s: go together")
        if (self.rate_per_s is None) == (self.settles_at is None):
            raise ValueError("either rate_per_s, or settles_at and time_constant_s")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        if self.settles_at is not None and self.time_constant_s is not None:
            return Effect(Act.SETTLE, self.settles_at, self.time_constant_s)
        return Effect(Act.DRIFT, self.rate_per_s or 0.0)


class Hardover(Ramped):
    """y = an end of the range. An open or shorted wire, a failed amplifier, a runaway actuator."""

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


class SignReversal(Spoiled):
    """y = -x. Wires or pneumatic lines swapped in maintenance, crossed control cables."""

    sites = _WITH_SURFACE
    kind: Literal["sign_reversal"]

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.SCALE, -1.0)


class Stuck(Ramped):
    """y = the last value before the onset, or a given one. A frozen vane, a hung processor, a jammed actuator."""

    sites = _WITH_SURFACE
    kind: Literal["stuck"]
    value: float | None = quantity(
        "signal", "where it sticks; not given: where it is (a surface: its true position)", None
    )

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.HOLD) if self.value is None else Effect(Act.SET, self.value)


class Noise(Ramped):
    """y = x + std n, n white and normal, of its own on every channel. A worn bearing, a failing supply."""

    kind: Literal["noise"]
    std: float = quantity("signal", "standard deviation of what is added to each sample", gt=0)

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.NOISE, self.std)


class Oscillation(Ramped):
    """y = x + A sin(2 pi f t), or the last value instead of x. An unstable servo loop, a loose connection that hums."""

    sites = _WITH_SURFACE
    kind: Literal["oscillation"]
    amplitude: float = quantity("signal", "A", gt=0)
    frequency_hz: float = quantity("Hz", "f", gt=0, le=500)
    replacing: bool = quantity(
        "", "it takes the place of the value, about the last one, instead of adding to it", False
    )

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.SWING if self.replacing else Act.OSCILLATE, self.amplitude, self.frequency_hz)


class Spikes(Spoiled):
    """y = x + amplitude, or a given value, for moments. Corrupted data words, lightning, a wiper off its track."""

    kind: Literal["spikes"]
    amplitude: float | None = quantity("signal", "added to the value; either this or `value`", None)
    value: float | None = quantity("signal", "takes the place of the value", None)
    times_s: list[float] | None = quantity("s", f"when, from the onset; at most {_MOST_TIMES}", None, min_length=1)
    rate_per_s: float | None = quantity("1/s", "or at random, so often a second on average", None, gt=0)
    width_s: float | None = quantity("s", "how long each lasts; not given: one frame", None, gt=0)

    @model_validator(mode="after")
    def _chosen(self) -> Spikes:
        if (self.amplitude is None) == (self.value is None):
            raise ValueError("either amplitude or value")
        if (self.times_s is None) == (self.rate_per_s is None):
            raise ValueError("either times_s or rate_per_s")
        if any(time < 0.0 for time in self.times_s or ()) or len(self.times_s or ()) > _MOST_TIMES:
            raise ValueError(f"times_s: at most {_MOST_TIMES} times, none below zero")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.ADD, self.amplitude) if self.amplitude is not None else Effect(Act.SET, self.value or 0.0)

    @property
    def pulses(self) -> Pulses:
        """At given times, or after pauses that are exponentially distributed."""
        width = self.width_s or 0.0
        if self.rate_per_s is None:
            return Pulses(Rhythm.TIMES, on_s=width, times_s=sorted(self.times_s or ()))
        return Pulses(Rhythm.RANDOM, on_s=width, off_s=1.0 / self.rate_per_s)


class Intermittent(Spoiled):
    """In gaps the value does not get through. A loose connector under vibration, a chafed wire."""

    kind: Literal["intermittent"]
    gap_s: float = quantity("s", "how long a gap lasts; it begins with one", gt=0)
    contact_s: float = quantity("s", "how long the contact holds between two", gt=0)
    random: bool = quantity("", "both are means of exponentially distributed times", False)
    in_gaps: Literal["last", "invalid", "no number", "high", "low"] = quantity("", "what is said in a gap", "last")

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
        return Pulses(Rhythm.TELEGRAPH if self.random else Rhythm.CYCLE, self.gap_s, self.contact_s)


class Dropout(Spoiled):
    """No value. A broken link: the sensor flags it invalid or, not flagged, says what is no number.

    The inertial unit and the references have no flag: there it is no number either way.
    """

    kind: Literal["dropout"]
    flagged: bool = quantity("", "marked invalid, the value stays; else no number", True)

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.NOTHING, invalid=True) if self.flagged else Effect(Act.NO_NUMBER)


class Delay(Spoiled):
    """y = x of so long ago. A congested bus, a computer that falls behind, a blocked pneumatic line."""

    sites = _WITH_SURFACE
    kind: Literal["delay"]
    latency_s: float = quantity("s", "in whole frames, rounded up", gt=0, le=10)

    @property
    def effect(self) -> Effect:
        """For the kernel; the schedule makes frames of the time."""
        return Effect(Act.DELAY, self.latency_s, 1.0, history_s=self.latency_s)


class FrameSkew(Spoiled):
    """y = x between two frames, so much earlier. Channels that are not synchronised sample at different moments."""

    sites = ("channel", "inertial")
    kind: Literal["frame_skew"]
    skew_s: float = quantity("s", "how much earlier than the others; a part of a frame or several", gt=0, le=1)

    @property
    def effect(self) -> Effect:
        """For the kernel; the schedule makes frames of the time."""
        return Effect(Act.DELAY, self.skew_s, 0.0, history_s=self.skew_s)


class Quantisation(Spoiled):
    """y = step round(x / step). Lost bits of a converter or of a data word."""

    kind: Literal["quantisation"]
    step: float = quantity("signal", "the coarse step", gt=0)

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.QUANTISE, self.step)


class CrossTalk(Ramped):
    """y = x + gain s, s another signal on the same channel. Coupling between wires, a damaged shield."""

    kind: Literal["cross_talk"]
    source: str = quantity("", "the place of s, of the same sort as the fault's own")
    gain: float = quantity("signal/source", "how much of it comes over")

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.CROSS_TALK, self.gain, source=self.source)


class DuplicateFrame(Spoiled):
    """y = x of the frame before, now and then. A sender slower than its reader: the old message is read again."""

    kind: Literal["duplicate_frame"]
    every_s: float | None = quantity("s", "regularly: from one duplicate to the next", None, gt=0)
    rate_per_s: float | None = quantity("1/s", "or at random, so often a second on average", None, gt=0)

    @model_validator(mode="after")
    def _one_rhythm(self) -> DuplicateFrame:
        if (self.every_s is None) == (self.rate_per_s is None):
            raise ValueError("either every_s or rate_per_s")
        return self

    @property
    def effect(self) -> Effect:
        """For the kernel."""
        return Effect(Act.REPEAT)

    @property
    def pulses(self) -> Pulses:
        """One frame each."""
        if self.rate_per_s is not None:
            return Pulses(Rhythm.RANDOM, off_s=1.0 / self.rate_per_s)
        return Pulses(Rhythm.CYCLE, on_s=0.0, off_s=self.every_s or 0.0)
