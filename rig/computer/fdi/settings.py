"""The ``[control.tolerant]`` table: how sure the fault-tolerant law must be, and how far it may go."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray
from pydantic import Field

from rig.computer.analytic import pitch_filter
from rig.computer.analytic.pitch_filter import Noise
from rig.computer.fdi.state import PARAM
from rig.settings import Settings, record


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
    """Return the PARAM record; ``on`` when the fault-tolerant law flies."""
    return record(
        PARAM,
        config,
        on=on,
        filter=pitch_filter.parameters(config.noise, rate_hz)[0],
        # The steady gain sqrt(rate_density dt / R) a frame is dt / lag for this R.
        sensor_variance=(config.noise.rate_noise_rad_sqrt_s * config.lag_s) ** 2 / (1.0 / rate_hz),
        return_frames=max(1, round(config.return_s * rate_hz)),
        fade_frames=round(config.return_fade_s * rate_hz),
    )
