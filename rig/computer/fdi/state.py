"""What the decision keeps: its fixed parameters and its state, one record each."""

from __future__ import annotations

from typing import Final

import numpy as np

from rig.computer.analytic import pitch_filter
from rig.computer.analytic.pitch_mean import MEAN
from rig.computer.analytic.unit_bank import UNIT

KEPT: Final = 4
BOTH, UNIT_ALONE, GYROS_ALONE = range(3)  # whose rates are in order
PARAM: Final = np.dtype(
    [
        ("filter", pitch_filter.PARAM),
        ("on", "i8"),  # whether the fault-tolerant law flies
        ("lag_s", "f8"),  # of the estimate behind a trusted sensor
        ("sensor_variance", "f8"),  # rad^2 of one sample that gives this lag
        ("innovation_floor_rad", "f8"),
        ("timing_s", "f8"),
        ("turn_error", "f8"),
        ("jump_sigma", "f8"),
        ("ramp_sigma", "f8"),
        ("ramp_s", "f8"),
        ("max_correction_rad", "f8"),
        ("return_rad", "f8"),
        ("persistence", "i8"),
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
        ("lie", "f8", (3,)),  # covariance of the two: variances, then between them
        ("misfit", "f8"),  # of the sensor to the two, smoothed
        ("fade", "f8"),  # rad, taken out after the reversion
        ("fade_left", "i8"),  # frames
        ("over", "i8"),  # frames running with too large an innovation
        ("agreed", "i8"),
        ("trust", "i8"),  # frame.Trust
        ("unit", UNIT),
        ("second", MEAN),  # of the filter, were it driven by the inertial unit
        ("second_innovation", "f8"),
        ("tilt", "f8"),  # rad, what the unit's bank angle instead of the voted one would add to the second mean
        ("bank_apart", "f8"),  # rad, voted bank angle less that by the unit, smoothed
        ("bank_suspected", "i8"),  # whether the gyros were rejected for the bank angle alone
        ("second_over", "i8"),  # frames running in which it alone is too large
        ("apart", "f8"),  # rad/s, rate of the pitch angle by the gyros less that by the unit, smoothed
        ("usual", "f8"),  # what it is while both are in order
        ("usual_seconds", "f8"),  # for which it has been learned
        ("similar", "i8"),  # frames running in which apart is as usual
        ("differ", "i8"),  # whether apart has been unusual since the gyros were rejected
        ("rates", "i8"),  # which rates are in order: BOTH, UNIT_ALONE or GYROS_ALONE
    ],
    align=True,
)
