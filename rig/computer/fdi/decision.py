"""The trust in the sensor: two tests of its innovation, the way back, and the path as arbiter.

    jump   |e| > n sigma in ``persistence`` frames running
    ramp   the CUSUM of |e| / sigma, at most n, beyond ``ramp_sigma`` exceeds ``ramp_s`` [sigma seconds]: needs no jump
    sigma^2 = P_theta + floor^2 + (theta' timing)^2 + (turning turn_error lag)^2

A ramp has moved the estimate before it is seen, so drift and path offset go back to what they were before.
The sensor is trusted again when it has stayed near the estimate.  When the estimate leaves the path by more
than gusts explain and the sensor does not, the rates are faulty and not the sensor: the correction is withdrawn.
A trip that the inertial unit's rates refute is a fault of the gyros; between the two the tests go on: rate_bias.py.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic.pitch_filter import forget
from rig.computer.fdi import fault_estimate, rate_bias
from rig.computer.fdi.pitch_test_state import KEPT
from rig.core.frame import Trust, sig
from rig.core.kernels import kernel

_RECENT_S: Final = 0.5
_KNOWN_S: Final = 10.0  # after which drift and path offset are known well enough to go back to
_KEEP_S: Final = 10.0
_ARBITER_S: Final = 3.0  # the path's gusts are smoothed over this
_ARBITER_SIGMA: Final = 4.0
_ARBITER_LEAST_RAD: Final = 0.02
_RETURN_SHARE: Final = 0.5  # of the worst innovation, within which the sensor has come back
_STRAY: Final = 3.0  # of ``near``, that one sample may be off while the sensor comes back


@kernel
def innovate(c, w, measured, x):
    """Compute the innovations [rad] of the pitch angle ``measured`` and their sigma.

    c, w : a PARAM and a STATE record; x : (S,) signals
    """
    e, dt = w["filter"], c["filter"]["dt"]
    w["turning"] += min(dt / c["lag_s"], 1.0) * (abs(x[sig.Q]) + abs(x[sig.R]) - w["turning"])
    turn_error = c["turn_error"] + rate_bias.bank_error(w, x)
    timing, turning = e["rate"] * c["timing_s"], w["turning"] * turn_error * c["lag_s"]
    w["innovation"], w["second_innovation"] = measured - e["theta"], measured - w["second"]["theta"]
    floor = c["innovation_floor_rad"]
    w["sigma"] = math.sqrt(e["p"][0, 0] + floor * floor + timing * timing + turning * turning)


@kernel
def decide(rates_voted, path_voted, c, w, measured, path):
    """Move ``trust``.

    rates_voted : rates and bank are; path_voted : all of the path is; measured, path : theta [rad] by sensor and path
    """
    e, dt = w["filter"], c["filter"]["dt"]
    size = abs(w["innovation"]) / w["sigma"]
    share = dt / (_ARBITER_S + dt) if path_voted else 0.0
    w["sensor_off_path"] += share * (path - e["path"] - measured - w["sensor_off_path"])
    w["theta_off_path"] += share * (path - e["path"] - e["theta"] - w["theta_off_path"])
    before = w["recent"]
    w["recent"] += dt / (_RECENT_S + dt) * (w["innovation"] - w["recent"])
    if w["trust"] == Trust.CORRECTED:
        clear_or_withdraw(c, w, measured)
    elif w["trust"] == Trust.WITHDRAWN:
        w["agreed"] = w["agreed"] + 1 if size < c["jump_sigma"] else 0
        if w["agreed"] >= c["return_frames"]:
            w["trust"] = Trust.TRUSTED
    elif not rates_voted:  # nothing can test it: follow the sensor
        w["jump_frames"], w["cusum"], e["theta"] = 0, 0.0, measured
        forget(c["filter"], e, c["innovation_floor_rad"])
    else:
        w["jump_frames"] = w["jump_frames"] + 1 if size > c["jump_sigma"] else 0
        w["cusum"] = max(0.0, w["cusum"] + (min(size, c["jump_sigma"]) - c["ramp_sigma"]) * dt)
        keep(c, w)
        if w["jump_frames"] >= c["persistence"] or w["cusum"] > c["ramp_s"]:
            if rate_bias.confirmed(w):
                declare(w, before)
            elif rate_bias.refuted(w):
                rate_bias.reject_gyros(w)


@kernel
def keep(c, w):
    """Keep drift and path offset as they were before a ramp could have moved them; first they must be known."""
    kept, e = w["kept"], w["filter"]
    if e["frames"] * c["filter"]["dt"] < _KNOWN_S:
        for i in range(KEPT):
            kept[i, 0], kept[i, 1] = e["drift"], e["path"]
    elif w["kept_s"] <= 0.0:
        for i in range(KEPT - 1, 0, -1):
            kept[i, 0], kept[i, 1] = kept[i - 1, 0], kept[i - 1, 1]
        kept[0, 0], kept[0, 1] = e["drift"], e["path"]
        w["kept_s"] = _KEEP_S
    w["kept_s"] -= c["filter"]["dt"]


@kernel
def declare(w, before):
    """Declare a sensor fault; ``before`` : its smoothed innovation before this frame, by which a jump is told."""
    new = abs(w["innovation"] - before)
    if new < rate_bias.SUDDEN * abs(w["innovation"]):
        e = w["filter"]
        e["drift"], e["path"] = w["kept"][KEPT - 1, 0], w["kept"][KEPT - 1, 1]
        e["p"][0, 0] += w["innovation"] * w["innovation"]
    w["trust"], w["agreed"], w["jump_frames"], w["cusum"] = Trust.CORRECTED, 0, 0, 0.0
    w["sensor_off_path"] = w["theta_off_path"] = 0.0
    w["recent"], w["worst"] = w["innovation"], abs(w["innovation"])
    fault_estimate.suspect(w)


@kernel
def clear_or_withdraw(c, w, measured):
    """Revert to the sensor when it has come back, or when the path agrees with it."""
    e = w["filter"]
    margin = max(_ARBITER_LEAST_RAD, _ARBITER_SIGMA * math.sqrt(e["gust_variance"]))
    w["worst"] = max(w["worst"], abs(w["recent"]))
    # A small fault that has not gone away is not a sensor that is good again.
    near = min(c["return_rad"], _RETURN_SHARE * w["worst"])
    back = abs(w["recent"]) < near and abs(w["innovation"]) < _STRAY * c["return_rad"]
    w["agreed"] = w["agreed"] + 1 if back else 0
    if abs(w["theta_off_path"]) > abs(w["sensor_off_path"]) + margin:
        revert(c, w, measured, Trust.WITHDRAWN)
        e["theta"], e["drift"] = measured, 0.0
        forget(c["filter"], e, c["innovation_floor_rad"])
    elif w["agreed"] >= c["return_frames"]:
        revert(c, w, measured, Trust.TRUSTED)


@kernel
def revert(c, w, measured, trust):
    """Let the law fly on the sensor again, faded from the estimate."""
    w["fade"], w["fade_left"] = w["filter"]["theta"] - measured, c["fade_frames"]
    w["trust"], w["agreed"], w["jump_frames"], w["cusum"] = trust, 0, 0, 0.0
    fault_estimate.clear(w)
