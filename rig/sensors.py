"""Sensors: the truth of one frame becomes four channels, each with its own errors.

Per signal and channel, in this order: skew (the channel samples a little earlier than the frame),
first-order lag, scale error and bias (drawn once per flight from a tolerance), white noise,
quantisation, end of range.  Angles on the circle wrap instead of saturating.
"""

from __future__ import annotations

from math import exp
from typing import Any, Final

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence
from numpy.typing import NDArray
from pydantic import Field, create_model, model_validator

from rig.angles import difference, limit
from rig.frame import CHANNELS, SIGNALS, Block, D, Ilm, S, Signal
from rig.kernels import kernel
from rig.settings import Settings


class Sensor(Settings):
    """One signal's sensor, the same type on every channel; values in the unit of the signal."""

    noise_std: float = Field(ge=0)  # white, per sample
    bias_tolerance: float = Field(ge=0)  # each channel's bias is uniform within +- this
    scale_tolerance: float = Field(ge=0, lt=1)  # likewise, relative
    lag_s: float = Field(ge=0)  # time constant
    quantum: float = Field(ge=0)  # least significant bit; 0: none
    skew_frames: float = Field(ge=0, le=1)  # each channel samples up to this much earlier
    channels: int = Field(default=CHANNELS, ge=2, le=CHANNELS)
    low: float | None = None  # range; as in frame.SIGNALS when not given
    high: float | None = None

    def limits(self, signal: Signal) -> tuple[float, float]:
        """Lowest and highest sample."""
        low = signal.low if self.low is None else self.low
        return low, signal.high if self.high is None else self.high


def _whole(suite: Settings) -> Settings:
    """Refuse a sensor whose range is empty."""
    for signal in SIGNALS:
        low, high = getattr(suite, signal.name).limits(signal)
        if low >= high:
            raise ValueError(f"{signal.name}: low ({low:g}) must be below high ({high:g})")
    return suite


_FIELDS: dict[str, Any] = {signal.name: (Sensor, ...) for signal in SIGNALS}
_CHECKS: dict[str, Any] = {"whole": model_validator(mode="after")(_whole)}
Suite = create_model(
    "Suite",
    __base__=Settings,
    __doc__="A full set, the ``[sensors.<signal>]`` tables: one Sensor for every signal of the frame.",
    __validators__=_CHECKS,
    **_FIELDS,
)


def ranges(suite: Settings) -> NDArray[np.float64]:
    """(S, 2) lowest and highest sample of each signal."""
    return np.array([getattr(suite, signal.name).limits(signal) for signal in SIGNALS])


def channels(suite: Settings) -> NDArray[np.int64]:
    """(S,) number of channels of each signal."""
    return np.array([getattr(suite, signal.name).channels for signal in SIGNALS])


PARAMS: Final = np.dtype(
    [
        ("bias", "f8", (CHANNELS,)),
        ("gain", "f8", (CHANNELS,)),  # 1 + scale error
        ("skew", "f8", (CHANNELS,)),  # frames
        ("noise_std", "f8"),
        ("blend", "f8"),  # share of a new sample that passes the lag in one frame
        ("quantum", "f8"),
        ("low", "f8"),
        ("high", "f8"),
        ("wraps", "u1"),
        ("channels", "u1"),
    ],
    align=True,
)
_GOOD: Final = int(Ilm.GOOD)
_NO_MONITOR: Final = int(Ilm.ABSENT)
_DISCRETES: Final = D


class Sensors:
    """Truth to channels.  ``seeds`` gives two independent streams: calibration and noise."""

    def __init__(self, suite: Settings, rate_hz: float, seeds: SeedSequence) -> None:
        calibration, noise = seeds.spawn(2)
        self.params = _params(suite, rate_hz, np.random.default_rng(calibration))
        self._noise_rng = Generator(SFC64(noise))  # the quickest of numpy's
        self._noise = np.zeros((0, S, CHANNELS), np.float32)  # single precision draws in half the time
        self._last_truth = np.full(S, np.nan)
        self._lagged = np.zeros((S, CHANNELS))

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What ``measure`` needs besides the row; the same arrays until the next ``prepare``."""
        return self.params, self._noise, self._last_truth, self._lagged

    def prepare(self, block: Block) -> None:
        """Draw the noise of the rows of ``block``; the stream does not depend on the block's length."""
        if len(self._noise) < len(block):
            self._noise = np.zeros((len(block), S, CHANNELS), np.float32)
        self._noise_rng.standard_normal(out=self._noise[: len(block)], dtype=np.float32)

    def step(self, block: Block, k: int) -> None:
        """Write channels, valid, ilm and discrete_channels of row k."""
        measure(block, k, *self.arguments)


def _params(suite: Settings, rate_hz: float, rng: Generator) -> NDArray[np.void]:
    """The (S,) PARAMS records; every channel's errors are drawn whether it is fitted or not."""
    params = np.zeros(S, PARAMS)
    for signal, row in zip(SIGNALS, params, strict=True):
        sensor = getattr(suite, signal.name)
        draw = rng.uniform(-1.0, 1.0, (3, CHANNELS))
        row["bias"] = sensor.bias_tolerance * draw[0]
        row["gain"] = 1.0 + sensor.scale_tolerance * draw[1]
        row["skew"] = sensor.skew_frames * (draw[2] + 1.0) / 2.0
        row["noise_std"], row["quantum"] = sensor.noise_std, sensor.quantum
        row["blend"] = 1.0 if sensor.lag_s == 0 else 1.0 - exp(-1.0 / (rate_hz * sensor.lag_s))
        row["low"], row["high"] = sensor.limits(signal)
        row["wraps"], row["channels"] = signal.wraps, sensor.channels
    return params


@kernel
def measure(block, k, params, noise, last_truth, lagged):
    """All channels of row k from the truth of this frame and the last.

    x = truth - skew (truth - last truth);  y += blend (x - y);  sample = round(gain y + bias + noise)

    block : FRAME records; params : (S,) PARAMS; noise : (n, S, 4) standard normal
    last_truth : (S,) and lagged : (S, 4), state; NaN in last_truth marks the first frame
    """
    row = block[k]
    truth, channels = row["truth"], row["channels"]
    valid, ilm = row["valid"], row["ilm"]
    for s in range(len(params)):
        p = params[s]
        wraps = p["wraps"]
        gain, bias, skew = p["gain"], p["bias"], p["skew"]
        first = last_truth[s] != last_truth[s]
        moved = 0.0 if first else difference(truth[s], last_truth[s], wraps)
        for c in range(CHANNELS):
            if c >= p["channels"]:
                channels[s, c] = np.nan
                valid[s, c] = 0
                ilm[s, c] = _NO_MONITOR
                continue
            x = truth[s] - skew[c] * moved
            if first:
                lagged[s, c] = x
            else:
                y = lagged[s, c] + p["blend"] * difference(x, lagged[s, c], wraps)
                lagged[s, c] = limit(y, p["low"], p["high"], wraps) if wraps != 0 else y
            sample = gain[c] * lagged[s, c] + bias[c] + p["noise_std"] * noise[k, s, c]
            if p["quantum"] > 0.0:
                sample = np.floor(sample / p["quantum"] + 0.5) * p["quantum"]
            channels[s, c] = limit(sample, p["low"], p["high"], wraps)
            valid[s, c] = 1
            ilm[s, c] = _GOOD
        last_truth[s] = truth[s]
    discrete_truth, discrete_channels = row["discrete_truth"], row["discrete_channels"]
    for d in range(_DISCRETES):
        for c in range(CHANNELS):
            discrete_channels[d, c] = discrete_truth[d]
