"""The ``[control.tolerant]`` table: how sure the fault-tolerant law must be, and how far it may go."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rig.computer.analytic.pitch_filter import Noise, fill
from rig.computer.fdi.state import PARAM
from rig.settings import Settings


class Config(Settings):
    """Tests of the pitch-angle sensor, and the noise that the estimate counts with."""

    jump_sigma: float = Field(default=6.0, gt=0.0)  # innovation over its sigma
    persistence: int = Field(default=2, ge=1)  # frames running
    ramp_sigma: float = Field(default=1.5, gt=0.0)  # what a CUSUM takes off every innovation
    ramp_s: float = Field(default=1.0, gt=0.0)  # sigma seconds beyond it
    lag_s: float = Field(default=5.0, gt=0.0)  # how slowly the estimate follows a sensor that is trusted
    max_correction_rad: float = Field(default=0.35, gt=0.0, le=1.57)
    return_rad: float = Field(default=0.003, gt=0.0)  # the sensor is trusted again when it has stayed so near
    return_s: float = Field(default=5.0, gt=0.0)  # for so long
    return_fade_s: float = Field(default=1.0, ge=0.0)
    innovation_floor_rad: float = Field(default=0.0005, gt=0.0)  # noise, quantum and scale of the vote
    timing_s: float = Field(default=0.005, ge=0.0)  # half a frame: channels do not sample at once
    turn_error: float = Field(default=0.001, ge=0.0)  # of the rate of turn: gyro scale, bank angle
    noise: Noise = Noise()


def parameters(config: Config, on: bool, rate_hz: float) -> NDArray[Any]:
    """The PARAM record; ``on`` when the fault-tolerant law flies."""
    param = np.zeros(1, PARAM)
    row, dt = param[0], 1.0 / rate_hz
    row["on"], row["lag"] = on, config.lag_s
    fill(row["filter"], config.noise, rate_hz)
    # The steady gain sqrt(rate_density dt / R) a frame is dt / lag for this R.
    row["sensor_variance"] = (config.noise.rate_noise_rad_sqrt_s * config.lag_s) ** 2 / dt
    row["floor"], row["timing"], row["turn_error"] = config.innovation_floor_rad, config.timing_s, config.turn_error
    row["jump_sigma"], row["persistence"] = config.jump_sigma, config.persistence
    row["ramp_sigma"], row["ramp_s"] = config.ramp_sigma, config.ramp_s
    row["most"], row["near"] = config.max_correction_rad, config.return_rad
    row["return_frames"] = max(1, round(config.return_s * rate_hz))
    row["fade_frames"] = round(config.return_fade_s * rate_hz)
    return param
