"""The sensors and the manager of one signal on the truth of a healthy flight, in the form that splitting needs."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.random import Generator
from numpy.typing import NDArray

from rig.bench.splitting import Held, Particles, Windows
from rig.core.errors import BadInput
from rig.core.frame import INDEX, SIGNALS, D
from rig.core.units.angles import step_sizes
from rig.scenario.scenario import Scenario
from rig.studies.reliability.channel_errors import COUNTS_FROM, Ends, ends
from rig.studies.reliability.one_signal import ROW, Recording, one_signal
from rig.world.sensors.kernel import MEMORY
from rig.world.sensors.params import calibrate

RUN_IN: Final = 12  # frames
COUNTED: Final = 48
_TINY: Final = 1e-300
_LEAST: Final = 0.05  # of the effect of errors: smaller noise does not decide where windows begin
# Key of the threshold by fitted channels.
THRESHOLDS: Final = {4: "threshold", 3: "threshold_triplex", 2: "threshold_duplex"}


class Bench:
    """The sensors and the manager of one signal on the truth of a healthy flight.

    BadInput: a sensor that open-loop trials do not support, or a manager that does not count to an isolation
    """

    def __init__(self, scenario: Scenario, signal: str, recorded: Recording) -> None:
        self._one = one_signal(scenario, signal)
        if not self._one.latches or self._one.manager.baseline is not None:
            manager = scenario.redundancy.manager
            raise BadInput(f"redundancy.manager: {manager!r}: must be cross-channel or cross-voter")
        s = INDEX[signal]
        self.signal, self.scenario = signal, scenario
        self._sensor = getattr(scenario.sensors, signal)
        self._series = [np.ascontiguousarray(series[:, s]) for series in recorded]
        self._run_in = RUN_IN + int(np.ceil(5.0 * self._sensor.lag_s * scenario.rate_hz + self._one.params["delay"][0]))
        self._wraps = SIGNALS[s].wraps
        if len(self._series[0]) <= self._run_in + COUNTED:
            raise BadInput(
                f"the flight has {len(self._series[0])} frames; at least {self._run_in + COUNTED + 1} are needed"
            )
        self.params = self._one.manager.params[0]

    @property
    def threshold(self) -> float:
        """Return the threshold that compares the fitted channels."""
        return float(self.params[THRESHOLDS[self.channels]])

    def sets(self, threshold: float) -> list[str]:
        """Return overrides of the scenario that set another threshold of the comparison."""
        return [f"redundancy.signals.{self.signal}.{THRESHOLDS[self.channels]}={threshold!r}"]

    @property
    def channels(self) -> int:
        """Return the number of fitted channels."""
        return int(self.params["fitted"])

    def arrangements(self, least: float = COUNTS_FROM) -> Ends:
        """Return the ends of the errors; see channel_errors.ends."""
        return ends(self._sensor, self._series[0], self._wraps, least)

    def held(self, errors: NDArray[np.float64]) -> Held:
        """Build the common part of the particles, with errors (3, E, 4) of E flights."""
        sensors = np.repeat(self._one.params, errors.shape[1])
        calibrate(sensors, self._sensor, errors)
        return Held(
            *self._series,
            sensors=sensors[:, None],
            manager=self._one.manager.data,
            row=np.zeros(1, ROW),
            blank_manager=self._one.manager.new_state(),
            blank_memory=np.zeros(1, MEMORY),
            no_drift=np.zeros((0, 0, 0)),
            no_alarms=np.zeros((0, 0, 0), np.uint8),
            no_discretes=np.zeros(D, np.int64)[:0],
        )

    def windows(self, first: NDArray[np.int64]) -> Windows:
        """Build windows that begin at frames ``first`` of the recording."""
        return Windows(first, self._run_in, COUNTED, *np.zeros((2, len(first)), np.int64))

    def starts(self, count: int, rng: Generator) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return frames in which windows begin, with weights: half of them at the largest effect of gain and skew."""
        does = self._doing()
        drawn = np.exp((does - does.max()) / max(float(self._one.params["noise_std"][0]), _LEAST * does.max(), _TINY))
        chances = 0.5 / len(does) + 0.5 * drawn / drawn.sum()
        first = rng.choice(len(does), count, p=chances / chances.sum())
        return first, 1.0 / (len(does) * chances[first])

    def _doing(self) -> NDArray[np.float64]:
        """Return how far gain and skew separate channels, for the persistence, by the first frame of a window."""
        truth, frames = self._series[0], min(int(self.params["persistence"]), COUNTED)
        moved = step_sizes(truth, self._wraps)
        apart = 2.0 * self._sensor.scale_tolerance * np.abs(truth[1:]) + self._sensor.skew_frames * moved
        lasting = sliding_window_view(apart, frames).min(axis=-1)
        windows = sliding_window_view(lasting, COUNTED - frames + 1).max(axis=-1)
        return windows[self._run_in - 1 :] + self._sensor.bias_tolerance

    def stretches(self) -> NDArray[np.int64]:
        """Return the first frames of windows whose counted frames cover the recording."""
        return np.arange(0, len(self._series[0]) - self._run_in - COUNTED + 1, COUNTED)

    def particles(self, count: int) -> Particles:
        """Build places for ``count`` states."""
        whole = [np.zeros(count, np.int64) for _ in range(4)]
        line = np.zeros((count, *self._one.line.shape))
        return Particles(np.zeros(count, MEMORY), line, np.zeros(count, self._one.manager.state.dtype), *whole)
