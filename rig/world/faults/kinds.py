"""Kinds of faults that change a value: effect and physical cause, in SI units.

x is the value before the fault, y the value after it, t the time since the onset [s].
y stays within the range of the sensor or the stops of the surface.
"""

from __future__ import annotations

from typing import Final, Literal

from pydantic import ValidationInfo, model_validator

from rig.world.faults.effects import Act, Effect
from rig.world.faults.fault_settings import Corrupted, Ramped, Size, one_form, quantity, require_one, threshold_quantity
from rig.world.faults.places import Site, places_of
from rig.world.faults.trigger import DutyCycle, Pulses

WITH_SURFACE: Final[tuple[Site, ...]] = ("channel", "inertial", "reference", "surface")
_MOST_TIMES: Final = 64


class Offset(Ramped):
    """y = x + offset. Causes: a bent vane, a bad calibration, a misrigged control rod."""

    sites, act, sizes, trials_draw = WITH_SURFACE, Act.ADD, ("offset",), True
    sentence = "offset of {error} at {at}"
    example = "f16_pull_up_load_factor_offset"

    kind: Literal["offset"]
    offset: float | None = quantity("signal", "added to the value", None)
    offset_thresholds: float | None = threshold_quantity("offset")

    _one_form = one_form("offset")


class Drift(Corrupted):
    """y = x + rate t, or x + settles_at (1 - exp(-t / time_constant)). Causes: a gyro warming up, a pressure leak."""

    sites, act, sizes, trials_draw = WITH_SURFACE, Act.DRIFT, ("rate_per_s", "settles_at"), True
    sentence = "drift of up to {error} from {at} on"
    example = "b747_static_pressure_drift"

    kind: Literal["drift"]
    rate_per_s: float | None = quantity("signal/s", "steady drift: rate of the error", None)
    rate_thresholds_per_s: float | None = threshold_quantity("rate_per_s")
    settles_at: float | None = quantity("signal", "exponential drift: final error", None)
    settles_at_thresholds: float | None = threshold_quantity("settles_at")
    time_constant_s: float | None = quantity(
        "s", "exponential drift: the error reaches 63 % of `settles_at` after this time", None, gt=0
    )

    @model_validator(mode="after")
    def _one_law(self) -> Drift:
        require_one(self, "rate_per_s", "rate_thresholds_per_s", "settles_at", "settles_at_thresholds")
        steady = self.rate_per_s is not None or self.rate_thresholds_per_s is not None
        if steady != (self.time_constant_s is None):
            raise ValueError(
                "time_constant_s: required with settles_at or settles_at_thresholds, and allowed only there"
            )
        return self

    @property
    def effect(self) -> Effect:
        """Steady, or towards a bound."""
        if self.time_constant_s is None:
            return self.sized(Act.DRIFT)
        return self.sized(Act.SETTLE, time_constant_s=self.time_constant_s)


class Hardover(Ramped):
    """y = an end of the range. Causes: an open or shorted wire, a failed amplifier, a runaway actuator.

    An angle that wraps has no end of range: y = x + half a turn. `direction` is then the direction of the ramp.
    """

    sites, act, found_at_once = WITH_SURFACE, Act.RANGE_END, True
    sentence = "hardover at {at}"
    example = "f16_pitch_rate_hardover"

    kind: Literal["hardover"]
    direction: Literal["high", "low", "either"] = quantity(
        "", "end of the range; `either`: drawn from the seed", "high"
    )

    @property
    def effect(self) -> Effect:
        """The direction as +1, -1, or 0 for what is still to be drawn."""
        return Effect(Act.RANGE_END, {"high": 1.0, "low": -1.0, "either": 0.0}[self.direction])


class Scale(Ramped):
    """y = factor x. Causes: a wrong excitation, a cracked bellows; on a surface: loss of effectiveness."""

    sites, act, sizes, trials_draw = WITH_SURFACE, Act.SCALE, ("factor",), True
    sentence = "scale error of up to {error} from {at} on"
    example = "b737_roll_rate_scale"

    kind: Literal["scale"]
    factor: float = quantity("1", "factor on the value: 1 changes nothing, 0 gives zero")

    @property
    def magnitude(self) -> Size:
        """The factor's distance from 1."""
        return Size(abs(1.0 - self.factor), False)


class SignReversal(Corrupted):
    """y = -x. Causes: wires or pneumatic lines swapped in maintenance, crossed control cables."""

    sites, act = WITH_SURFACE, Effect(Act.SCALE, -1.0)
    sentence = "wrong sign from {at} on, an error of up to {error}"
    example = "f16_lateral_load_factor_sign_reversal"

    kind: Literal["sign_reversal"]


class Stuck(Ramped):
    """y = the last value before the onset, or a given one. Causes: a frozen vane, a jammed actuator."""

    sites, act, hidden_at_rest = (*WITH_SURFACE, "discrete"), Act.HOLD, True
    sentence = "stuck at {value} at {at}"
    example = "b747_angle_of_attack_stuck"

    kind: Literal["stuck"]
    value: float | None = quantity(
        "signal", "held value (a discrete: 0 or 1); if not given: the last value (a surface: its position)", None
    )

    @model_validator(mode="after")
    def _of_a_discrete(self, info: ValidationInfo) -> Stuck:
        if places_of(info).site(self.signal) == "discrete" and self.value not in (None, 0.0, 1.0):
            raise ValueError(f"value: {self.signal} is a discrete, allowed: 0, 1; got {self.value:g}")
        return self

    @property
    def effect(self) -> Effect:
        """Held in place, or at a given value."""
        return Effect(Act.HOLD) if self.value is None else Effect(Act.SET, self.value)


class Noise(Ramped):
    """y = x + std n, n white, normal, independent by channel. Causes: a worn bearing, a failing supply."""

    act, sizes, trials_draw = Act.NOISE, ("std",), True
    sentence = "noise of up to {error} from {at} on"
    example = "b737_yaw_rate_noise"

    kind: Literal["noise"]
    std: float | None = quantity("signal", "standard deviation of the added noise", None, gt=0)
    std_thresholds: float | None = threshold_quantity("std", gt=0)

    _one_form = one_form("std")


class BiasInstability(Corrupted):
    """y = x + b, b a first-order Gauss-Markov process, independent by channel. Causes: an ageing gyro, loose glue.

    b <- b exp(-dt / T) + std sqrt(1 - exp(-2 dt / T)) n, n white and normal, from b = 0 at the onset. After t the
    standard deviation of b is std sqrt(1 - exp(-2 t / T)). Well before T it is a random walk.
    """

    act, sizes, trials_draw = Act.GAUSS_MARKOV, ("std",), True
    sentence = "unstable bias of up to {error} from {at} on"
    example = "b747_pitch_angle_bias_instability"

    kind: Literal["bias_instability"]
    std: float | None = quantity("signal", "standard deviation of the bias, long after the onset", None, gt=0)
    std_thresholds: float | None = threshold_quantity("std", gt=0)
    time_constant_s: float = quantity("s", "T, correlation time", gt=0)

    _one_form = one_form("std")

    @property
    def effect(self) -> Effect:
        """Correlated over its time constant."""
        return self.sized(Act.GAUSS_MARKOV, time_constant_s=self.time_constant_s)


class Oscillation(Ramped):
    """y = x + A sin(2 pi f t), or with the last value instead of x. Causes: an unstable servo loop, a loose contact."""

    sites, act, sizes, trials_draw = WITH_SURFACE, Act.OSCILLATE, ("amplitude",), True
    sentence = "oscillation of up to {error} from {at} on"
    example = "f16_normal_load_factor_oscillation"

    kind: Literal["oscillation"]
    amplitude: float | None = quantity("signal", "A, amplitude", None, gt=0)
    amplitude_thresholds: float | None = threshold_quantity("amplitude", gt=0)
    frequency_hz: float = quantity("Hz", "f, frequency", gt=0, le=500)
    replacing: bool = quantity("", "true: oscillate about the last value before the onset, instead of about x", False)

    _one_form = one_form("amplitude")

    @property
    def effect(self) -> Effect:
        """About the value, or about the last one."""
        return self.sized(Act.SWING if self.replacing else Act.OSCILLATE, frequency_hz=self.frequency_hz)


class Spikes(Corrupted):
    """y = x + amplitude, or a given value, in short pulses. Causes: corrupted data words, lightning, a worn wiper."""

    act, sizes, trials_draw = Act.ADD, ("amplitude",), True
    sentence = "spikes of up to {error} from {at} on"
    example = "f16_angle_of_attack_spikes"

    kind: Literal["spikes"]
    amplitude: float | None = quantity("signal", "added to the value; give this or `value`", None)
    amplitude_thresholds: float | None = threshold_quantity("amplitude")
    value: float | None = quantity("signal", "replaces the value", None)
    times_s: list[float] | None = quantity(
        "s", f"times of the pulses after the onset; at most {_MOST_TIMES}", None, min_length=1
    )
    rate_per_s: float | None = quantity("1/s", "mean rate of random pulses; give this or `times_s`", None, gt=0)
    width_s: float | None = quantity("s", "length of a pulse; if not given: one frame", None, gt=0)

    @model_validator(mode="after")
    def _chosen(self) -> Spikes:
        require_one(self, "amplitude", "amplitude_thresholds", "value")
        if (self.times_s is None) == (self.rate_per_s is None):
            raise ValueError("give either times_s or rate_per_s")
        if any(time < 0.0 for time in self.times_s or ()) or len(self.times_s or ()) > _MOST_TIMES:
            raise ValueError(f"times_s: at most {_MOST_TIMES} times, none below zero")
        return self

    @property
    def effect(self) -> Effect:
        """Added, or in the place of the value."""
        return self.sized(Act.ADD) if self.value is None else Effect(Act.SET, self.value)

    @property
    def pulses(self) -> Pulses:
        """At given times, or after pauses that are exponentially distributed."""
        width = self.width_s or 0.0
        if self.rate_per_s is None:
            return Pulses(DutyCycle.TIMES, on_s=width, times_s=sorted(self.times_s or ()))
        return Pulses(DutyCycle.RANDOM, on_s=width, off_s=1.0 / self.rate_per_s)
