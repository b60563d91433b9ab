"""The error of a faulty sensor: sensor = F theta + o.

Recursive least squares on effectiveness F and offset o, with the estimate as theta.  At one angle the two
cannot be told apart; a flight that pitches tells.  While the fault still grows nothing is learned for good.
"""

from __future__ import annotations

import math
from typing import Final

from rig.core.frame import SensorFault
from rig.core.kernels import kernel

_FIRST_EFFECTIVENESS: Final = 0.6  # sigma of what is not known at the start
_FIRST_OFFSET_RAD: Final = 0.05
_WALK_EFFECTIVENESS: Final = 0.02  # a root second
_WALK_OFFSET_RAD: Final = 0.001
_COLOUR_S: Final = 1.0  # an error of the estimate lasts so long
_MISFIT_S: Final = 0.3
_SURE: Final = 3.0  # sigma


@kernel
def suspect(w):
    """Begin with a fault of unknown kind; w : a STATE record."""
    w["effectiveness"], w["offset"], w["misfit"] = 1.0, 0.0, 0.0
    reopen(w)


@kernel
def reopen(w):
    """Allow any effectiveness and any offset again."""
    p = w["fault_covariance"]
    p[0] = max(p[0], _FIRST_EFFECTIVENESS * _FIRST_EFFECTIVENESS)
    p[1] = max(p[1], _FIRST_OFFSET_RAD * _FIRST_OFFSET_RAD)
    p[2] = 0.0


@kernel
def clear(w):
    """Forget the fault: the sensor is good."""
    p = w["fault_covariance"]
    w["effectiveness"], w["offset"] = 1.0, 0.0
    p[0] = p[1] = p[2] = 0.0


@kernel
def learn(c, w, measured):
    """Move the least squares by a frame with the angle ``measured`` [rad]; an old misfit opens them again."""
    p, dt, theta = w["fault_covariance"], c["filter"]["dt"], w["filter"]["theta"]
    off = measured - w["effectiveness"] * theta - w["offset"]
    w["misfit"] += dt / (_MISFIT_S + dt) * (off - w["misfit"])
    if abs(w["misfit"]) > _SURE * c["innovation_floor_rad"]:
        reopen(w)
    p[0] += dt * _WALK_EFFECTIVENESS * _WALK_EFFECTIVENESS
    p[1] += dt * _WALK_OFFSET_RAD * _WALK_OFFSET_RAD
    gf, go = p[0] * theta + p[2], p[2] * theta + p[1]
    total = gf * theta + go + w["sigma"] * w["sigma"] * _COLOUR_S / dt
    w["effectiveness"] += gf / total * off
    w["offset"] += go / total * off
    p[0] -= gf * gf / total
    p[1] -= go * go / total
    p[2] -= gf * go / total


@kernel
def name(w):
    """Return a ``frame.SensorFault``: which of the two is off for certain."""
    p = w["fault_covariance"]
    if p[0] <= 0.0 or p[1] <= 0.0:
        return SensorFault.NONE
    scaled = abs(w["effectiveness"] - 1.0) > _SURE * math.sqrt(p[0])
    shifted = abs(w["offset"]) > _SURE * math.sqrt(p[1])
    if scaled and shifted:
        return SensorFault.BOTH
    if scaled:
        return SensorFault.EFFECTIVENESS
    return SensorFault.OFFSET if shifted else SensorFault.UNDETERMINED
