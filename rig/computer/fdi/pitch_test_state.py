"""The test of the pitch-angle sensor: its settings, ``[control.tolerant]``, its parameters and its state."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rig.computer.analytic import pitch_filter
from rig.computer.analytic.pitch_filter import MEAN, Noise
from rig.computer.analytic.unit_bank import UNIT
from rig.core.settings import Settings, numbers, record


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


KEPT: Final = 4
BOTH, UNIT_ALONE, GYROS_ALONE = range(3)  # whose rates are in order
PARAM: Final = np.dtype(
    [
        ("filter", pitch_filter.PARAM),
        ("on", "i8"),  # whether the fault-tolerant law flies
        *numbers(Config),
        ("sensor_variance", "f8"),  # rad^2 of one sample that gives the lag of the estimate
        ("return_frames", "i8"),
        ("fade_frames", "i8"),
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("filter", pitch_filter.STATE),
        ("turning", "f8"),  # |q| + |r|, smoothed over the lag
        ("innovation", "f8"),  # sensor less estimate, before the sensor is used
        ("sigma", "f8"),
        ("recent", "f8"),  # the innovation, smoothed
        ("worst", "f8"),  # the largest of it since the sensor is not trusted
        ("cusum", "f8"),  # sigma seconds
        ("sensor_off_path", "f8"),  # smoothed
        ("theta_off_path", "f8"),
        ("kept", "f8", (KEPT, 2)),  # drift and path as they were, every few seconds, the oldest last
        ("kept_s", "f8"),
        ("effectiveness", "f8"),
        ("offset", "f8"),
        ("fault_covariance", "f8", (3,)),  # covariance of the two: variances, then between them
        ("misfit", "f8"),  # of the sensor to the two, smoothed
        ("fade", "f8"),  # rad, taken out after the reversion
        ("fade_left", "i8"),  # frames
        ("jump_frames", "i8"),  # frames running with too large an innovation
        ("agreed", "i8"),
        ("trust", "i8"),  # frame.Trust
        ("unit", UNIT),
        ("second", MEAN),  # of the filter, were it driven by the inertial unit
        ("second_innovation", "f8"),
        ("bank_effect", "f8"),  # rad, what the unit's bank angle instead of the voted one would add to the second mean
        ("bank_difference", "f8"),  # rad, voted bank angle less that by the unit, smoothed
        ("bank_suspected", "i8"),  # whether the gyros were rejected for the bank angle alone
        ("second_jump_frames", "i8"),  # frames running in which it alone is too large
        ("rate_difference", "f8"),  # rad/s, rate of the pitch angle by the gyros less that by the unit, smoothed
        ("usual_rate_difference", "f8"),  # what it is while both are in order
        ("usual_rate_seconds", "f8"),  # for which it has been learned
        ("usual_frames", "i8"),  # frames running in which apart is as usual
        ("unusual", "i8"),  # whether apart has been unusual since the gyros were rejected
        ("rates", "i8"),  # which rates are in order: BOTH, UNIT_ALONE or GYROS_ALONE
    ],
    align=True,
)


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
