"""Sensors and manager of one signal on the truth of a healthy flight, as splitting takes them."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.computer.redundancy.manager import new_state
from rig.errors import BadInput
from rig.frame import INDEX, SIGNALS, D
from rig.reliability.channel_errors import COUNTS_FROM, Ends, ends
from rig.reliability.one_signal import ROW, one_signal
from rig.reliability.recorded import Recording
from rig.reliability.splitting import Held, Particles, Windows
from rig.scenario import Scenario
from rig.sensors.kernel import MEMORY
from rig.sensors.params import calibrate

RUN_IN: Final = 12  # frames
COUNTED: Final = 48
# Key of the threshold by fitted channels.
THRESHOLDS: Final = {4: "threshold", 3: "threshold_triplex", 2: "threshold_duplex"}


class Bench:
    """Sensors and manager of one signal on the truth of a healthy flight.

    BadInput: a sensor that open-loop trials do not know, a manager that fails nobody for good
    """

    def __init__(self, scenario: Scenario, signal: str, recorded: Recording) -> None:
        self._one = one_signal(scenario, signal)
        if not self._one.latches:
            manager = scenario.redundancy.manager
            raise BadInput(f"redundancy.manager: {manager!r}: only cross-channel and cross-voter isolate for good")
        s = INDEX[signal]
        self.signal, self.scenario = signal, scenario
        self._sensor = getattr(scenario.sensors, signal)
        self._series = [np.ascontiguousarray(series[:, s]) for series in recorded]
        self._run_in = RUN_IN + int(np.ceil(5.0 * self._sensor.lag_s * scenario.rate_hz + self._one.params["delay"][0]))
        self._wraps = SIGNALS[s].wraps
        if len(self._series[0]) <= self._run_in + COUNTED:
            raise BadInput(
                f"the flight has {len(self._series[0])} frames: at least {self._run_in + COUNTED + 1} needed"
            )
        self.params = self._one.manager.params[0]

    @property
    def threshold(self) -> float:
        """Of the comparison, with the channels that are fitted."""
        return float(self.params[THRESHOLDS[self.channels]])

    @property
    def channels(self) -> int:
        """Fitted."""
        return int(self.params["fitted"])

    def arrangements(self, least: float = COUNTS_FROM) -> Ends:
        """Ends of the errors; see channel_errors.ends."""
        return ends(self._sensor, self._series[0], self._wraps, least)

    def held(self, errors: NDArray[np.float64]) -> Held:
        """All that particles have in common, with errors (3, E, 4) of E flights."""
        sensors = np.repeat(self._one.params, errors.shape[1])
        calibrate(sensors, self._sensor, errors)
        return Held(
            *self._series,
            sensors=sensors[:, None],
            manager=self._one.manager.data,
            row=np.zeros(1, ROW),
            blank_manager=new_state(self._one.manager.params),
            blank_memory=np.zeros(1, MEMORY),
            no_drift=np.zeros((0, 0, 0)),
            no_alarms=np.zeros((0, 0, 0), np.uint8),
            no_discretes=np.zeros(D, np.int64)[:0],
        )

    def windows(self, first: NDArray[np.int64]) -> Windows:
        """Windows that begin at frames ``first`` of the recording."""
        return Windows(first, self._run_in, COUNTED, *np.zeros((2, len(first)), np.int64))

    def starts(self, count: int, rng: Generator) -> NDArray[np.int64]:
        """Frames in which windows can begin, at random."""
        return rng.integers(0, len(self._series[0]) - self._run_in - COUNTED, count)

    def stretches(self) -> NDArray[np.int64]:
        """Beginnings of windows whose counted frames cover the recording."""
        return np.arange(0, len(self._series[0]) - self._run_in - COUNTED + 1, COUNTED)

    def particles(self, count: int) -> Particles:
        """Places for so many states."""
        whole = [np.zeros(count, np.int64) for _ in range(4)]
        line = np.zeros((count, *self._one.line.shape))
        return Particles(np.zeros(count, MEMORY), line, np.zeros(count, self._one.manager.state.dtype), *whole)
