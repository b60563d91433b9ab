"""The Kalman filter on the pitch angle, the pitch gyros' drift b and the offset d of the path's word on it.

    theta' = (q - b) cos phi - (r - b_r) sin phi + noise       b' = noise       d' = noise
    sensor = theta + noise            while trusted, with so little weight that theta lags by ``lag_s``
    path   = theta + d + gust         always: climb rate, airspeed, angles of attack and sideslip (inclination.py)

A gust lasts as long as its length takes to fly through, 533 m / V, so one sample of the path counts with
2 x 533 m / (V dt) times the gusts' variance, which is learned.  The yaw gyros' drift b_r is what the heading
does not confirm.  No aerodynamic derivative enters.
"""

from __future__ import annotations

import math
from typing import Final

from rig.angles import wrap
from rig.frame import INDEX, Source
from rig.inclination import PATH_SIGNALS, pitching
from rig.kernels import kernel

_Q, _R = INDEX["pitch_rate"], INDEX["yaw_rate"]
_PHI, _PSI = INDEX["roll_angle"], INDEX["heading"]
_PATH: Final = tuple(INDEX[name] for name in PATH_SIGNALS)
_VOTED: Final = int(Source.VOTED)
_LENGTH_M: Final = 533.4  # scale of vertical turbulence above 2000 ft (MIL-F-8785C)
_LEAST_GUST_RAD: Final = 0.001  # the path is never taken as better than this
_FIRST_GUST_RAD: Final = 0.01
_GUST_S: Final = 30.0  # in which the gusts' variance is learned
_YAW_S: Final = 60.0  # likewise the drift of the yaw gyros
_CLIP: Final = 3.0  # sigma; a path farther off counts as that
_FIRST_THETA_RAD: Final = 0.001  # what is not known at the start
_FIRST_DRIFT_RAD_S: Final = 0.003
_FIRST_PATH_RAD: Final = 0.008
_STEEP_BANK_RAD: Final = 1.0  # beyond it the heading says little of the yaw rate


@kernel
def begin(w, said):
    """Nothing is known but what the sensor ``said`` [rad]; w : a STATE record."""
    w["theta"], w["heading"] = said, math.nan
    w["gust_variance"] = _FIRST_GUST_RAD * _FIRST_GUST_RAD
    w["effectiveness"] = 1.0
    forget(w)


@kernel
def forget(w):
    """The covariance of the start."""
    p = w["p"]
    for i in range(3):
        for j in range(3):
            p[i, j] = 0.0
    p[0, 0] = _FIRST_THETA_RAD * _FIRST_THETA_RAD
    p[1, 1], p[2, 2] = _FIRST_DRIFT_RAD_S * _FIRST_DRIFT_RAD_S, _FIRST_PATH_RAD * _FIRST_PATH_RAD


@kernel
def predict(levels, c, w, x):
    """Theta by the body rates, and P = Phi P Phi' + Q.

    levels : (S,) channels in use; c, w : a PARAM and a STATE record; x : (S,) signals
    """
    dt, p = c["dt"], w["p"]
    gyros = 8 * levels[_Q] + levels[_R]
    if gyros != w["gyros"] and w["gyros"] != 0:  # another set in the vote has another drift
        p[1, 1] += _FIRST_DRIFT_RAD_S * _FIRST_DRIFT_RAD_S
    w["gyros"] = gyros
    rate = pitching(x[_Q], x[_R] - w["yaw_drift"], x[_PHI])
    last = w["rate"] if w["vertical"]["started"] != 0 else rate
    share = dt * math.cos(x[_PHI])
    w["theta"] += 0.5 * dt * (rate + last) - share * w["drift"]
    w["rate"] = rate
    w["turning"] += min(dt / c["lag"], 1.0) * (abs(x[_Q]) + abs(x[_R]) - w["turning"])
    for j in range(3):
        p[0, j] -= share * p[1, j]
    for j in range(3):
        p[j, 0] -= share * p[j, 1]
    p[0, 0] += dt * c["rate_density"]
    p[1, 1] += dt * c["drift_density"]
    p[2, 2] += dt * c["path_density"]


@kernel
def learn_yaw_drift(known, c, w, x):
    """r - (psi' cos theta - (q - b) sin phi) / cos phi, averaged; ``known``: rates, bank and heading are voted."""
    if known and abs(x[_PHI]) < _STEEP_BANK_RAD:
        if math.isfinite(w["heading"]):
            turn = wrap(x[_PSI] - w["heading"]) / c["dt"]
            said = (turn * math.cos(w["theta"]) - (x[_Q] - w["drift"]) * math.sin(x[_PHI])) / math.cos(x[_PHI])
            w["yaw_seconds"] = min(w["yaw_seconds"] + c["dt"], _YAW_S)
            w["yaw_drift"] += c["dt"] / (w["yaw_seconds"] + 5.0) * (x[_R] - said - w["yaw_drift"])
        w["heading"] = x[_PSI]
    else:
        w["heading"] = math.nan


@kernel
def correct(w, innovation, of_path, variance):
    """Kalman's update by a measurement of theta + ``of_path`` d with ``innovation`` [rad] and ``variance``."""
    p = w["p"]
    g0, g1, g2 = p[0, 0] + of_path * p[0, 2], p[1, 0] + of_path * p[1, 2], p[2, 0] + of_path * p[2, 2]
    total = g0 + of_path * g2 + variance
    w["theta"] += g0 / total * innovation
    w["drift"] += g1 / total * innovation
    w["path"] += g2 / total * innovation
    p[0, 0] -= g0 * g0 / total
    p[1, 1] -= g1 * g1 / total
    p[2, 2] -= g2 * g2 / total
    p[0, 1] -= g0 * g1 / total
    p[0, 2] -= g0 * g2 / total
    p[1, 2] -= g1 * g2 / total
    p[1, 0], p[2, 0], p[2, 1] = p[0, 1], p[0, 2], p[1, 2]


@kernel
def follow_path(source, c, w, path):
    """The path's word [rad] on theta and on its own offset, and how gusty it is; nothing while a part of it is lost."""
    for i in _PATH:
        if source[i] != _VOTED:
            return
    lasts = _LENGTH_M / w["vertical"]["speed"]
    innovation, size = path - w["theta"] - w["path"], math.sqrt(w["gust_variance"])
    innovation = min(max(innovation, -_CLIP * size), _CLIP * size)
    w["path_seconds"] = min(w["path_seconds"] + c["dt"], _GUST_S)
    w["gust_variance"] += c["dt"] / (w["path_seconds"] + 3.0) * (innovation * innovation - w["gust_variance"])
    w["gust_variance"] = max(w["gust_variance"], _LEAST_GUST_RAD * _LEAST_GUST_RAD)
    correct(w, innovation, 1.0, w["gust_variance"] * 2.0 * lasts / c["dt"])
