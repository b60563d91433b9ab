"""The stage of the sensors: samples from the truth of a frame and the memory of the channels."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, Block, Ilm, S
from rig.core.kernels import kernel
from rig.core.settings import Settings
from rig.core.units.angles import difference, limit
from rig.world.sensors.data_sheet import discrete_channels
from rig.world.sensors.draws import PROCESSES, Alarms, Drift
from rig.world.sensors.params import fixed

# The order is part of every recorded flight: append, never insert.
STREAMS: Final = ("calibration", "noise", "misalignment", "g_sensitivity", *PROCESSES, "monitor")
# What the sensors of one signal remember from frame to frame.
MEMORY: Final = np.dtype(
    [
        ("frames", "i8"),  # measured so far
        ("truth", "f8"),
        ("cross_axis", "f8", (CHANNELS,)),  # of other signals
        ("lagged", "f8", (CHANNELS,)),
        ("passed", "f8", (CHANNELS,)),  # the low pass, and its rate
        ("speed", "f8", (CHANNELS,)),
    ],
    align=True,
)


class SensorData(NamedTuple):
    """Data of the sensors besides the row; the draws are those of a block of n rows."""

    params: NDArray[Any]  # (S,) PARAMS
    noise: NDArray[np.float32]  # (n, S, CHANNELS), standard normal
    drift: NDArray[np.float64]  # (n, S, CHANNELS), unit of the signal
    memory: NDArray[Any]  # (S,) MEMORY, in place
    line: NDArray[np.float64]  # (S, CHANNELS, frames), the latency's ring, in place
    discretes: NDArray[np.int64]  # (D,) channels of each discrete
    alarms: NDArray[np.uint8]  # (n, S, CHANNELS), false alarms of in-line monitors


class Sensors:
    """Truth to channels.  ``seeds`` gives every purpose an independent stream, so none shifts another."""

    def __init__(self, suite: Settings, rate_hz: float, seeds: SeedSequence) -> None:
        """Raise BadInput when a noise file cannot be used."""
        streams: dict[str, SeedSequence] = dict(zip(STREAMS, seeds.spawn(len(STREAMS)), strict=True))
        self.params = fixed(suite, rate_hz, streams)
        self._drift = Drift(suite, rate_hz, streams)
        self.params["drifts"] = self._drift.signals
        self._alarms = Alarms(suite, rate_hz, streams["monitor"])
        self._noise_rng = Generator(SFC64(streams["noise"]))  # the quickest of numpy's
        self._noise = np.zeros((0, S, CHANNELS), np.float32)  # single precision draws in half the time
        self._memory = np.zeros(S, MEMORY)
        self._line = np.zeros((S, CHANNELS, int(self.params["delay"].max()) + 2))
        self._discretes = discrete_channels(suite)

    @property
    def data(self) -> SensorData:
        """The data of ``measure`` besides the row; the same arrays until the next ``prepare``."""
        draws = self._noise, self._drift.rows
        return SensorData(self.params, *draws, self._memory, self._line, self._discretes, self._alarms.rows)

    def prepare(self, block: Block) -> None:
        """Draw the noise of the rows of ``block``; the streams do not depend on the block's length."""
        if len(self._noise) < len(block):
            self._noise = np.zeros((len(block), S, CHANNELS), np.float32)
        self._noise_rng.standard_normal(out=self._noise[: len(block)], dtype=np.float32)
        self._drift.prepare(len(block))
        self._alarms.prepare(len(block))


@kernel
def measure(truth, bus, k, data):
    """Measure all channels of row k of a block from the truth of this frame and the last.

    x = truth - skew (truth - last truth), truth with the cross-axis error;  y += blend (x - y)
    y -> low pass -> latency;  sample = round(gain y + bias + noise + drift), within its range

    truth, bus : the row's TRUTH and BUS records; data : SensorData.  Writes channels, valid, ilm, and the discretes'.
    """
    params, noise, drift, memory, line = data.params, data.noise, data.drift, data.memory, data.line
    true, channels, valid, ilm = truth["truth"], bus["channels"], bus["valid"], bus["ilm"]
    for s in range(len(params)):
        p, m = params[s], memory[s]
        wraps, shares, filtered, drifts = p["wraps"], p["shares"], p["filtered"], p["drifts"]
        gain, bias, skew, lagged = p["gain"], p["bias"], p["skew"], m["lagged"]
        first = m["frames"] == 0
        moved = 0.0 if first else difference(true[s], m["truth"], wraps)
        for c in range(CHANNELS):
            if c >= p["channels"]:
                channels[s, c] = np.nan
                valid[s, c] = 0
                ilm[s, c] = Ilm.ABSENT
                continue
            x = true[s] - skew[c] * moved
            if shares != 0:
                x += cross_axis_error(p, m, true, c)
            if first:
                lagged[c] = x
            else:
                y = lagged[c] + p["blend"] * difference(x, lagged[c], wraps)
                lagged[c] = limit(y, p["low"], p["high"], wraps) if wraps != 0 else y
            sample = lagged[c]
            if filtered != 0:
                sample = filter_through(sample, p, m, line[s, c], c)
            sample = gain[c] * sample + bias[c] + p["noise_std"] * noise[k, s, c]
            if drifts != 0:
                sample += drift[k, s, c]
            if p["quantum"] > 0.0:
                sample = np.floor(sample / p["quantum"] + 0.5) * p["quantum"]
            channels[s, c] = limit(sample, p["low"], p["high"], wraps)
            valid[s, c] = 1
            ilm[s, c] = Ilm.BAD if p["alarms"] != 0 and data.alarms[k, s, c] != 0 else Ilm.GOOD
        m["truth"] = true[s]
        m["frames"] += 1
    switch(truth["discrete_truth"], bus, data.discretes)


@kernel
def switch(truth, bus, fitted):
    """Write all channels of the discretes: each switch is where the truth is, valid, its monitor good.

    truth : (D,); fitted : (D,) channels of each; one that is not fitted is 0, not valid, without a monitor
    """
    samples, valid, ilm = bus["discrete_channels"], bus["discrete_valid"], bus["discrete_ilm"]
    for d in range(len(fitted)):
        for c in range(CHANNELS):
            there = c < fitted[d]
            samples[d, c] = truth[d] if there else 0
            valid[d, c] = 1 if there else 0
            ilm[d, c] = Ilm.GOOD if there else Ilm.ABSENT


@kernel
def cross_axis_error(p, m, truth, c):
    """Return the cross-axis error of channel c: position error, misalignment, g-sensitivity.

    sum over the sources of share x truth, at the channel's moment of sampling; p PARAMS, m MEMORY, in place
    """
    source, share, last = p["source"], p["share"], m["cross_axis"]
    now = 0.0
    for j in range(p["shares"]):
        now += share[j, c] * truth[source[j]]
    moved = 0.0 if m["frames"] == 0 else now - last[c]
    last[c] = now
    return now - p["skew"][c] * moved


@kernel
def filter_through(x, p, m, line, c):
    """Pass channel c through low pass and latency; m MEMORY and ``line`` (frames,), the ring, in place.

    With the input held at x over the frame, e = y - x follows the free system: (e, y') <- transition (e, y').
    The latency is between two frames of the ring, interpolated linearly.
    """
    wraps, low, high, tick = p["wraps"], p["low"], p["high"], m["frames"]
    y = x
    if p["low_pass"] != 0:
        passed, speed, step = m["passed"], m["speed"], p["transition"]
        if tick == 0:
            passed[c], speed[c] = x, 0.0
        e, v = difference(passed[c], x, wraps), speed[c]
        y = x + step[0] * e + step[1] * v
        y = limit(y, low, high, wraps) if wraps != 0 else y
        passed[c], speed[c] = y, step[2] * e + step[3] * v
    if p["delayed"] != 0:
        length = len(line)
        if tick == 0:
            for i in range(length):
                line[i] = y
        line[tick % length] = y
        newer, older = line[(tick - p["delay"]) % length], line[(tick - p["delay"] - 1) % length]
        y = newer - p["delay_rest"] * difference(newer, older, wraps)
        y = limit(y, low, high, wraps) if wraps != 0 else y
    return y
