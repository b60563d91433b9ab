"""The stage: parameters, state and the draws of a block."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.random import SFC64, Generator, SeedSequence

from rig.frame import CHANNELS, Block, S, nested
from rig.sensors.alarms import Alarms
from rig.sensors.drift import PROCESSES, Drift
from rig.sensors.kernel import MEMORY, SensorData, measure
from rig.sensors.params import fixed
from rig.sensors.settings import discrete_channels
from rig.settings import Settings

# The order is part of every recorded flight: append, never insert.
STREAMS: Final = ("calibration", "noise", "misalignment", "g_sensitivity", *PROCESSES, "monitor")


class Sensors:
    """Truth to channels.  ``seeds`` gives every purpose a stream of its own, so none shifts another."""

    def __init__(self, suite: Settings, rate_hz: float, seeds: SeedSequence) -> None:
        """BadInput when a noise file cannot be used."""
        streams: dict[str, SeedSequence] = dict(zip(STREAMS, seeds.spawn(len(STREAMS)), strict=True))
        self.params = fixed(suite, rate_hz, streams)
        self._drift = Drift(suite, rate_hz, streams)
        self._alarms = Alarms(suite, rate_hz, streams["monitor"])
        self._noise_rng = Generator(SFC64(streams["noise"]))  # the quickest of numpy's
        self._noise = np.zeros((0, S, CHANNELS), np.float32)  # single precision draws in half the time
        self._memory = np.zeros(S, MEMORY)
        self._line = np.zeros((S, CHANNELS, int(self.params["delay"].max()) + 2))
        self._discretes = discrete_channels(suite)

    @property
    def data(self) -> SensorData:
        """What ``measure`` needs besides the row; the same arrays until the next ``prepare``."""
        draws = self._noise, self._drift.rows
        return SensorData(self.params, *draws, self._memory, self._line, self._discretes, self._alarms.rows)

    def prepare(self, block: Block) -> None:
        """Draw the noise of the rows of ``block``; the streams do not depend on the block's length."""
        if len(self._noise) < len(block):
            self._noise = np.zeros((len(block), S, CHANNELS), np.float32)
        self._noise_rng.standard_normal(out=self._noise[: len(block)], dtype=np.float32)
        self._drift.prepare(len(block))
        self._alarms.prepare(len(block))

    def step(self, block: Block, k: int) -> None:
        """Write channels, valid and ilm of row k, of signals and discretes."""
        row = nested(block)[k]
        measure(row["truth"], row["bus"], k, self.data)
