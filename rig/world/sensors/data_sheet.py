"""A sensor's data sheet as settings: the ``[sensors.<signal>]`` tables.

Values are in the unit of the signal, per second, hertz, g, rad or Pa as their names show.  A tolerance
is drawn once a flight for each channel, uniform within plus and minus it.
"""

from __future__ import annotations

from math import hypot, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, create_model, model_serializer, model_validator
from pydantic_core.core_schema import SerializerFunctionWrapHandler

from rig.core.frame import CHANNELS, DISCRETES, INDEX, SIGNALS, Signal
from rig.core.kept import kept
from rig.core.settings import Settings

# Three sensors at right angles in one box: each sees a little of what the others measure.
GYROS: Final = tuple(INDEX[name] for name in ("roll_rate", "pitch_rate", "yaw_rate"))
ACCELEROMETERS: Final = tuple(
    INDEX[name] for name in ("longitudinal_load_factor", "lateral_load_factor", "normal_load_factor")
)
# What a noise file replaces.
NOISE_KEYS: Final = ("noise_std", "noise_density", "bias_instability_std", "bias_correlation_s", "rate_random_walk")
FILE_KEYS: Final = ("noise_file", "noise_rate_hz", "noise_sha256")


class Monitor(Settings):
    """The in-line monitor of a stick or pedal: the sum of the two coils of its LVDT.

    At position x the coils give (1 + x) / 2 and (1 - x) / 2 of the full voltage: their difference is x, their sum
    stays.  An error of one coil is in both alike.
    """

    coverage: float = Field(ge=0, le=1)  # share of the electrical faults that are ahead of the sum
    tolerance: float = Field(gt=0)  # of the sum, unit of the signal
    frames: int = Field(ge=1)  # in a row beyond it until the monitor says bad
    false_alarm_per_hour: float = Field(ge=0, le=3600)  # of one channel
    false_alarm_s: float = Field(gt=0)  # how long one lasts


class Sensor(Settings):
    """One signal's sensor, the same type on every channel."""

    class_: str | None = Field(default=None, alias="class")  # whose figures lie under the other keys
    # Noise and drift, independent on every channel
    noise_std: float = Field(ge=0)  # white, per sample
    noise_density: float = Field(default=0.0, ge=0)  # white, per sqrt(Hz): angle or velocity random walk
    bias_instability_std: float = Field(default=0.0, ge=0)  # first-order Gauss-Markov
    bias_correlation_s: float = Field(default=0.0, ge=0)  # its time constant
    rate_random_walk: float = Field(default=0.0, ge=0)  # per sqrt(s)
    # Fixed for a flight
    bias_tolerance: float = Field(ge=0)  # at turn-on
    scale_tolerance: float = Field(ge=0, lt=1)  # relative
    misalignment_tolerance_rad: float = Field(default=0.0, ge=0, le=0.1)  # towards each other axis of its triad
    g_sensitivity_tolerance: float = Field(default=0.0, ge=0)  # gyros: per g, along each axis
    # Dynamics
    lag_s: float = Field(ge=0)  # time constant of a first-order lag
    bandwidth_hz: float = Field(default=0.0, ge=0, le=1e6)  # -3 dB of a second-order low pass; 0: none
    damping: float = Field(default=0.7071, gt=0, le=2)  # of that low pass
    latency_s: float = Field(default=0.0, ge=0, le=1)  # transport delay, the same on every channel
    skew_frames: float = Field(ge=0, le=1)  # each channel samples up to this much earlier
    # Conversion
    quantum: float = Field(ge=0)  # least significant bit; 0: none
    low: float | None = None  # range; as in frame.SIGNALS when not given
    high: float | None = None
    channels: int = Field(default=CHANNELS, ge=2, le=CHANNELS)
    monitor: Monitor | None = None  # sticks and pedal: their in-line monitor
    # Of the installation, common to all channels
    position_error_per_rad: float = 0.0  # air data: per rad of angle of attack
    position_error_per_pa: float = 0.0  # air data: per Pa of dynamic pressure
    mode_rms: float = Field(default=0.0, ge=0)  # a structural mode in the signal
    mode_frequency_hz: float = Field(default=0.0, ge=0, le=1e6)  # its undamped natural frequency
    mode_damping: float = Field(default=0.02, gt=0, lt=1)
    # Recorded noise instead of the drawn one
    noise_file: str | None = None  # CSV, a column a channel
    noise_rate_hz: float | None = Field(default=None, gt=0)
    noise_sha256: str | None = Field(default=None, pattern="^[0-9a-f]{64}$")  # written when a scenario is loaded

    def limits(self, signal: Signal) -> tuple[float, float]:
        """Return the lowest and highest sample."""
        low = signal.low if self.low is None else self.low
        return low, signal.high if self.high is None else self.high

    def sample_noise_std(self, rate_hz: float) -> float:
        """Return the standard deviation of the white noise of a sample."""
        return hypot(self.noise_std, self.noise_density * sqrt(rate_hz))

    @model_validator(mode="after")
    def _pairs(self) -> Sensor:
        """Refuse keys that only mean something together."""
        if self.bias_instability_std > 0 and self.bias_correlation_s == 0:
            raise ValueError("bias_correlation_s: must be above 0 with bias_instability_std")
        if self.mode_rms > 0 and self.mode_frequency_hz == 0:
            raise ValueError("mode_frequency_hz: must be above 0 with mode_rms")
        if self.noise_file is None:
            if self.noise_rate_hz is not None or self.noise_sha256 is not None:
                raise ValueError("noise_file: must be given with noise_rate_hz")
            return self
        if self.noise_rate_hz is None:
            raise ValueError("noise_rate_hz: must be given with noise_file")
        drawn = [key for key in NOISE_KEYS if getattr(self, key) > 0]
        if drawn:
            raise ValueError(f"{drawn[0]}: must be 0 or left out, noise_file replaces it")
        return self

    @model_serializer(mode="wrap")
    def _by_name(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Write ``class`` under the name that it is read by; Python keeps the word for itself."""
        return {"class" if key == "class_" else key: value for key, value in handler(self).items()}


class DiscreteSensor(Settings):
    """The switches of one discrete: a ``[sensors.<discrete>]`` table."""

    channels: int = Field(default=CHANNELS, ge=2, le=CHANNELS)


def _whole(suite: Settings) -> Settings:
    """Refuse a sensor whose range is empty, and an effect that its signal cannot have."""
    for s, signal in enumerate(SIGNALS):
        sensor = getattr(suite, signal.name)
        low, high = sensor.limits(signal)
        if low >= high:
            raise ValueError(f"{signal.name}: low ({low:g}) must be below high ({high:g})")
        if sensor.misalignment_tolerance_rad > 0 and s not in GYROS + ACCELEROMETERS:
            raise ValueError(f"{signal.name}: misalignment_tolerance_rad: only rates and load factors have a triad")
        if sensor.g_sensitivity_tolerance > 0 and s not in GYROS:
            raise ValueError(f"{signal.name}: g_sensitivity_tolerance: only rates have it")
        if sensor.monitor is not None and signal.group != "stick and pedals":
            raise ValueError(f"{signal.name}: monitor: only sticks and pedal have coils")
        if (sensor.position_error_per_rad or sensor.position_error_per_pa) and signal.group != "air data":
            raise ValueError(f"{signal.name}: position_error: only air data have one")
    return suite


_FIELDS: dict[str, Any] = {
    **{signal.name: (Sensor, ...) for signal in SIGNALS},
    **{discrete.name: (DiscreteSensor, DiscreteSensor()) for discrete in DISCRETES},
}
_CHECKS: dict[str, Any] = {"whole": model_validator(mode="after")(_whole)}
Suite = create_model(
    "Suite",
    __base__=Settings,
    __doc__="The ``[sensors.<name>]`` tables: a Sensor for each signal, a DiscreteSensor for each discrete.",
    __validators__=_CHECKS,
    **_FIELDS,
)


@kept
def ranges(suite: Settings) -> NDArray[np.float64]:
    """Return (S, 2) lowest and highest sample of each signal."""
    return np.array([getattr(suite, signal.name).limits(signal) for signal in SIGNALS])


@kept
def noise_std(suite: Settings, rate_hz: float) -> NDArray[np.float64]:
    """Return (S,) standard deviation of the white noise of a sample, unit of the signal."""
    return np.array([getattr(suite, signal.name).sample_noise_std(rate_hz) for signal in SIGNALS])


class DataSheet(NamedTuple):
    """The figures of a sensor that limit what its channels differ by."""

    noise_std: float  # of a sample, unit of the signal
    bias_tolerance: float  # the same
    scale_tolerance: float  # 1
    skew_frames: float


@kept
def data_sheets(suite: Settings, rate_hz: float, apart_frames: float = 0.0) -> tuple[DataSheet, ...]:
    """Return the figures of each signal's sensor; apart_frames : by which its channels are read at other times."""
    sensors = [getattr(suite, signal.name) for signal in SIGNALS]
    return tuple(
        DataSheet(of.sample_noise_std(rate_hz), of.bias_tolerance, of.scale_tolerance, of.skew_frames + apart_frames)
        for of in sensors
    )


@kept
def channels(suite: Settings) -> NDArray[np.int64]:
    """Return (S,) number of channels of each signal."""
    return np.array([getattr(suite, signal.name).channels for signal in SIGNALS])


@kept
def discrete_channels(suite: Settings) -> NDArray[np.int64]:
    """Return (D,) number of channels of each discrete."""
    return np.array([getattr(suite, discrete.name).channels for discrete in DISCRETES])


def fitted(suite: Settings, most: int) -> Settings:
    """Return the suite with ``most`` channels at most of every signal and discrete."""
    kept = {named.name: getattr(suite, named.name) for named in (*SIGNALS, *DISCRETES)}
    fewer = {name: one.model_copy(update={"channels": min(one.channels, most)}) for name, one in kept.items()}
    return suite.model_copy(update=fewer)
