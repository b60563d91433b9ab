"""Drift and false alarms, drawn a block at a time: bias instability, random walk, structural mode, alarms.

    bias instability   b <- exp(-dt / T) b + std sqrt(1 - exp(-2 dt / T)) w     from its stationary spread
    rate random walk   b <- b + K sqrt(dt) w                                    from 0
    structural mode    x'' + 2 damping omega x' + omega^2 x = white noise, sampled exactly; one for all channels
    false alarm        of an in-line monitor: memoryless, each of a given length

w is standard normal.  Every process of every signal has an independent stream, so that one more shifts no other,
and the draws do not depend on the length of the blocks.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from math import exp, pi, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence
from numpy.typing import NDArray

from rig.core.frame import CHANNELS, SIGNALS, S, to_frame
from rig.core.kernels import kernel
from rig.core.settings import Settings
from rig.world.sensors.data_sheet import Sensor
from rig.world.sensors.noise_file import Recorded
from rig.world.sensors.params import transition

Floats = NDArray[np.float64]
Process = Callable[[Any], None]  # adds its next rows to an (n, 4) array
_NEVER: Final = int(np.iinfo(np.int64).max)


class Drift:
    """The drifting part of every signal; ``seeds`` has a sequence for each of PROCESSES.

    signals : (S,) True for each that drifts at all
    """

    def __init__(self, suite: Settings, rate_hz: float, seeds: dict[str, SeedSequence]) -> None:
        """Raise BadInput when a noise file cannot be used."""
        self._processes: list[tuple[int, Process]] = [
            (s, effect.make(getattr(suite, signal.name), signal.name, rate_hz, _stream(seeds[name], s)))
            for s, signal in enumerate(SIGNALS)
            for name, effect in PROCESSES.items()
            if getattr(getattr(suite, signal.name), effect.setting) not in (0.0, None)
        ]
        self.signals = np.isin(np.arange(S), [s for s, _ in self._processes])
        self.rows = np.zeros((0, S, CHANNELS))

    def prepare(self, frames: int) -> None:
        """Draw the next ``frames`` rows; all the others stay 0."""
        if len(self.rows) < frames and self._processes:
            self.rows = np.zeros((frames, S, CHANNELS))
        for s in {s for s, _ in self._processes}:
            self.rows[:frames, s] = 0.0
        for s, process in self._processes:
            process(self.rows[:frames, s])


def _stream(parent: SeedSequence, s: int) -> Generator:
    """Return the generator of signal ``s``: the parent's child of that number, as SeedSequence.spawn makes it."""
    return Generator(SFC64(SeedSequence(parent.entropy, spawn_key=(*parent.spawn_key, s))))


def _bias_instability(sensor: Sensor, name: str, rate_hz: float, rng: Generator) -> Process:
    keep = exp(-1.0 / (rate_hz * sensor.bias_correlation_s))
    std = sensor.bias_instability_std
    return _first_order(keep, std * sqrt(1.0 - keep**2), std * rng.standard_normal(CHANNELS), rng)


def _random_walk(sensor: Sensor, name: str, rate_hz: float, rng: Generator) -> Process:
    return _first_order(1.0, sensor.rate_random_walk / sqrt(rate_hz), np.zeros(CHANNELS), rng)


def _recorded(sensor: Sensor, name: str, rate_hz: float, rng: Generator) -> Process:
    return Recorded(sensor, name, rate_hz, rng).add


def _first_order(keep: float, drive: float, state: Floats, rng: Generator) -> Process:
    def add(out: Any) -> None:
        walk(rng.standard_normal((len(out), CHANNELS)), keep, drive, state, out)

    return add


def _mode(sensor: Sensor, name: str, rate_hz: float, rng: Generator) -> Process:
    """Scale x by rms and x' by omega rms to unit variance: the noise of a frame is what the transition loses."""
    omega = 2.0 * pi * sensor.mode_frequency_hz
    step = transition(omega, sensor.mode_damping, 1.0 / rate_hz) * np.array([[1.0, omega], [1.0 / omega, 1.0]])
    lost = [1.0 - step[0, 0] ** 2 - step[0, 1] ** 2, 1.0 - step[1, 0] ** 2 - step[1, 1] ** 2]
    both = -(step[0, 0] * step[1, 0] + step[0, 1] * step[1, 1])
    first = sqrt(max(lost[0], 0.0))
    second = both / first if first > 0 else 0.0
    push = np.array([[first, 0.0], [second, sqrt(max(lost[1] - second**2, 0.0))]])
    state = rng.standard_normal(2)

    def add(out: Any) -> None:
        ring(rng.standard_normal((len(out), 2)), step, push, state, sensor.mode_rms, out)

    return add


class Drawn(NamedTuple):
    """One drawn effect: the setting that asks for it, and what makes its process for one signal."""

    setting: str  # of Sensor
    make: Callable[[Sensor, str, float, Generator], Process]  # of sensor, signal, rate_hz and stream


# To add one: its settings (data_sheet.py), its row here; the order is part of every recorded flight: append only.
PROCESSES: Final = {
    "bias_instability": Drawn("bias_instability_std", _bias_instability),
    "random_walk": Drawn("rate_random_walk", _random_walk),
    "mode": Drawn("mode_rms", _mode),
    "recorded": Drawn("noise_file", _recorded),
}


@kernel
def walk(w, keep, drive, state, out):
    """Add a first-order process to ``out`` (n, 4): state <- keep state + drive w; w (n, 4), state (4,) in place."""
    for k in range(len(out)):
        for c in range(CHANNELS):
            state[c] = keep * state[c] + drive * w[k, c]
            out[k, c] += state[c]


@kernel
def ring(w, step, push, state, rms, out):
    """Add rms x to every column of ``out`` (n, 4): state <- step state + push w; w (n, 2), state (2,) in place."""
    for k in range(len(out)):
        x = step[0, 0] * state[0] + step[0, 1] * state[1] + push[0, 0] * w[k, 0]
        rate = step[1, 0] * state[0] + step[1, 1] * state[1] + push[1, 0] * w[k, 0] + push[1, 1] * w[k, 1]
        state[0], state[1] = x, rate
        for c in range(CHANNELS):
            out[k, c] += rms * x


class Alarms:
    """``rows`` (n, S, 4): 1 if the monitor of a channel raises a false alarm, from an independent stream each."""

    def __init__(self, suite: Settings, rate_hz: float, seeds: SeedSequence) -> None:
        self._suite, self._rate_hz, self._seeds = suite, rate_hz, seeds.spawn(S)
        self.rows = np.zeros((0, S, CHANNELS), np.uint8)
        self._frame = self._next = 0  # the first ``prepare`` looks who is next
        self._marked = False

    @cached_property
    def _channels(self) -> list[_Channel]:
        """Those that may raise one: streams are dear to make, and trials of one signal draw none."""
        channels: list[_Channel] = []
        for s, (signal, child) in enumerate(zip(SIGNALS, self._seeds, strict=True)):
            monitor = getattr(self._suite, signal.name).monitor
            if monitor is not None and monitor.false_alarm_per_hour > 0:
                chance = 1.0 - exp(-monitor.false_alarm_per_hour / (3600.0 * self._rate_hz))
                length = max(1, to_frame(monitor.false_alarm_s, self._rate_hz))
                streams = map(np.random.default_rng, child.spawn(CHANNELS))
                channels += [_Channel(s, c, chance, length, rng) for c, rng in enumerate(streams)]
        return channels

    def prepare(self, frames: int) -> None:
        """Draw the next ``frames`` rows; what is drawn does not depend on the length of the blocks."""
        if len(self.rows) < frames and self._channels:
            self.rows, self._marked = np.zeros((frames, S, CHANNELS), np.uint8), False
        if self._marked:
            self.rows[:] = 0
        first, self._frame = self._frame, self._frame + frames
        self._marked = self._next < self._frame
        if self._marked:
            for channel in self._channels:
                channel.mark(self.rows, first, self._frame)
            self._next = min((channel.begin for channel in self._channels), default=_NEVER)


class _Channel:
    """The next false alarm of the in-line monitor of channel c of signal s."""

    def __init__(self, s: int, c: int, chance: float, length: int, rng: Generator) -> None:
        self._place, self._chance, self._length, self._rng = (s, c), chance, length, rng
        self.begin = int(rng.geometric(chance)) - 1

    def mark(self, rows: np.ndarray, first: int, last: int) -> None:
        """Write the alarms of the frames from ``first`` to before ``last``."""
        while self.begin < last:
            end = self.begin + self._length
            rows[(slice(max(self.begin - first, 0), min(end, last) - first), *self._place)] = 1
            if end > last:
                return
            self.begin = end + int(self._rng.geometric(self._chance)) - 1
