"""The Kalman filter on the pitch angle, the drift b and scale error s of the pitch gyros, and the path's offset d.

    theta' = ((1 + s) q - b) cos phi - (r - b_r) sin phi + noise     b' = noise     d' = noise     s' = 0
    path   = theta + d + gust     climb rate, airspeed, angles of attack and sideslip (flight_path.py)
    sensor = theta + noise        only where the sensor is trusted, and never for its own reference

A gust lasts as long as its length takes to fly through, 533 m / V, so one sample of the path counts with
2 x 533 m / (V dt) times the gusts' variance, which is learned.  The yaw gyros' drift b_r is what the heading
does not confirm.  No aerodynamic derivative enters.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rig.computer.analytic.flight_path import PATH_SIGNALS, VERTICAL, pitching
from rig.core.frame import sig
from rig.core.kernels import kernel
from rig.core.settings import Settings, record
from rig.core.units.angles import wrap


class Noise(Settings):
    """Assumed noise of the voted signals, and uncertainty of the filter's states at the start."""

    rate_noise_rad_sqrt_s: float = Field(default=6.3e-5, gt=0.0, le=1e3)  # random walk of the integrated rates
    drift_sigma_rad_s: float = Field(default=0.003, ge=0.0, le=1e3)  # of the pitch gyros' vote, at the start
    scale_sigma: float = Field(default=0.002, ge=0.0, le=1e3)  # the same of its scale
    drift_walk_rad_s_sqrt_s: float = Field(default=2e-6, ge=0.0, le=1e3)
    path_walk_rad_sqrt_s: float = Field(default=3e-5, ge=0.0, le=1e3)


STATES: Final = 4
PARAM: Final = np.dtype(
    [
        ("dt", "f8"),
        ("rate_density", "f8"),  # process noise a second: rad^2, (rad/s)^2, rad^2
        ("drift_density", "f8"),
        ("path_density", "f8"),
        ("drift_variance", "f8"),  # at the start
        ("scale_variance", "f8"),
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("vertical", VERTICAL),
        ("theta", "f8"),  # pitch angle, drift of the pitch gyros, offset of the path, scale error of the gyros
        ("drift", "f8"),
        ("path", "f8"),
        ("scale", "f8"),
        ("p", "f8", (STATES, STATES)),  # covariance of these
        ("g", "f8", (STATES,)),  # workspace
        ("rate", "f8"),  # of the pitch angle, last frame
        ("heading", "f8"),  # last frame; NaN when unknown
        ("yaw_drift", "f8"),
        ("yaw_seconds", "f8"),  # for which it has been learned
        ("gust_variance", "f8"),
        ("path_seconds", "f8"),
        ("gyros", "i8"),  # how many are in the vote, pitch and yaw
        ("frames", "i8"),
    ],
    align=True,
)
# The mean apart from its covariance, so that a second one can go along with the same gains.
MEAN: Final = np.dtype([(name, "f8") for name in ("theta", "drift", "path", "scale", "rate")], align=True)
# All that the estimate is made of.
PARTNERS: Final = ("pitch_rate", "yaw_rate", "heading", *PATH_SIGNALS)
_LENGTH_M: Final = 533.4  # scale of vertical turbulence above 2000 ft (MIL-F-8785C)
_LEAST_GUST_RAD: Final = 0.001  # the path is never taken as better than this
_FIRST_GUST_RAD: Final = 0.01
_GUST_S: Final = 30.0  # in which the gusts' variance is learned
_GUST_START_S: Final = 3.0
_YAW_S: Final = 60.0  # the same of the drift of the yaw gyros
_YAW_START_S: Final = 5.0
_CLIP: Final = 3.0  # sigma; a path farther off counts as that
_FIRST_PATH_RAD: Final = 0.008
_STEEP_BANK_RAD: Final = 1.0  # beyond it the heading says little of the yaw rate


def parameters(noise: Noise, rate_hz: float) -> NDArray[Any]:
    """Return the PARAM record of a ``noise``."""
    return record(
        PARAM,
        dt=1.0 / rate_hz,
        rate_density=noise.rate_noise_rad_sqrt_s**2,
        drift_density=noise.drift_walk_rad_s_sqrt_s**2,
        path_density=noise.path_walk_rad_sqrt_s**2,
        drift_variance=noise.drift_sigma_rad_s**2,
        scale_variance=noise.scale_sigma**2,
    )


@kernel
def begin(c, e, theta, sigma):
    """Begin with a first pitch angle and its ``sigma`` [rad]; c, e : a PARAM and a STATE record."""
    e["theta"], e["heading"] = theta, math.nan
    e["gust_variance"] = _FIRST_GUST_RAD * _FIRST_GUST_RAD
    forget(c, e, sigma)


@kernel
def forget(c, e, sigma):
    """Set the covariance of the start, the pitch angle's with ``sigma`` [rad]."""
    p = e["p"]
    for i in range(STATES):
        for j in range(STATES):
            p[i, j] = 0.0
    p[0, 0] = sigma * sigma
    p[1, 1], p[2, 2], p[3, 3] = c["drift_variance"], _FIRST_PATH_RAD * _FIRST_PATH_RAD, c["scale_variance"]


@kernel
def predict(c, e, x, gyros):
    """Propagate theta by the voted body rates, and P = Phi P Phi' + Q.

    c, e : a PARAM and a STATE record; x : (S,) signals; gyros : which are in the vote, any number that changes with it
    """
    rate = pitching(x[sig.Q], x[sig.R] - e["yaw_drift"], x[sig.PHI])
    predict_by(c, e, rate, x[sig.Q], x[sig.PHI], gyros)


@kernel
def predict_by(c, e, rate, pitch_rate, roll_angle, gyros):
    """Propagate by any ``rate`` of the pitch angle [rad/s], at this pitch rate [rad/s] and roll angle [rad]."""
    dt, p = c["dt"], e["p"]
    if gyros != e["gyros"] and e["frames"] > 0:  # another set has another drift
        p[1, 1] += c["drift_variance"]
    last = e["rate"] if e["frames"] > 0 else rate
    share, moved = dt * math.cos(roll_angle), dt * math.cos(roll_angle) * pitch_rate
    carry(dt, e, rate, last, share, moved)
    e["rate"], e["gyros"] = rate, gyros
    e["frames"] += 1
    for j in range(STATES):
        p[0, j] += moved * p[3, j] - share * p[1, j]
    for j in range(STATES):
        p[j, 0] += moved * p[j, 3] - share * p[j, 1]
    p[0, 0] += dt * c["rate_density"]
    p[1, 1] += dt * c["drift_density"]
    p[2, 2] += dt * c["path_density"]


@kernel
def learn_yaw_drift(voted, c, e, x):
    """Average r - (psi' cos theta - (q - b) sin phi) / cos phi while rates, bank and heading are ``voted``."""
    if voted and abs(x[sig.PHI]) < _STEEP_BANK_RAD:
        if math.isfinite(e["heading"]):
            turn = wrap(x[sig.PSI] - e["heading"]) / c["dt"]
            rate = (turn * math.cos(e["theta"]) - (x[sig.Q] - e["drift"]) * math.sin(x[sig.PHI])) / math.cos(x[sig.PHI])
            e["yaw_seconds"] = min(e["yaw_seconds"] + c["dt"], _YAW_S)
            e["yaw_drift"] += c["dt"] / (e["yaw_seconds"] + _YAW_START_S) * (x[sig.R] - rate - e["yaw_drift"])
        e["heading"] = x[sig.PSI]
    else:
        e["heading"] = math.nan


@kernel
def follow_path(c, e, path):
    """Correct theta by the ``path``'s [rad], and learn how gusty it is."""
    innovation = path_innovation(e, e, path)
    e["path_seconds"] = min(e["path_seconds"] + c["dt"], _GUST_S)
    share = c["dt"] / (e["path_seconds"] + _GUST_START_S)
    e["gust_variance"] += share * (innovation * innovation - e["gust_variance"])
    e["gust_variance"] = max(e["gust_variance"], _LEAST_GUST_RAD * _LEAST_GUST_RAD)
    lasts = _LENGTH_M / e["vertical"]["speed"]
    correct(e, innovation, 1.0, e["gust_variance"] * 2.0 * lasts / c["dt"])


@kernel
def correct(e, innovation, of_path, variance):
    """Update by a measurement of theta + ``of_path`` d with ``innovation`` [rad] and ``variance``.

    Leaves the gain in ``g`` for ``move``.
    """
    p, g = e["p"], e["g"]
    for i in range(STATES):
        g[i] = p[i, 0] + of_path * p[i, 2]
    total = g[0] + of_path * g[2] + variance
    for i in range(STATES):
        for j in range(STATES):
            p[i, j] -= g[i] * g[j] / total
    for i in range(STATES):
        g[i] = g[i] / total
    move(g, e, innovation)


@kernel
def path_innovation(e, mean, path):
    """Return theta [rad] by the path less that by ``mean``, no more than gusts explain; e : a STATE record."""
    most = _CLIP * math.sqrt(e["gust_variance"])
    return min(max(path - mean["theta"] - mean["path"], -most), most)


@kernel
def carry(dt, mean, rate, last, share, moved):
    """Propagate theta of ``mean``, a STATE or a MEAN record: by ``rate``, the ``last`` one, drift and scale error."""
    mean["theta"] += 0.5 * dt * (rate + last) - share * mean["drift"] + moved * mean["scale"]


@kernel
def move(g, mean, innovation):
    """Move ``mean``, a STATE or a MEAN record, by the gain ``g`` (4,) times its ``innovation`` [rad]."""
    mean["theta"] += g[0] * innovation
    mean["drift"] += g[1] * innovation
    mean["path"] += g[2] * innovation
    mean["scale"] += g[3] * innovation
