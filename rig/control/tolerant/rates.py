"""Whose rates of turn are in order: those of the gyros, of the inertial unit, or of both.

The filter's mean is driven by the gyros, a second mean by the inertial unit, both corrected with the same gain by the
same sensor and path.  A sensor that lies is off both means alike; a rate that is biased moves one mean alone:

    BOTH         the sensor is denied when the first mean denies it and the second one agrees
    UNIT_ALONE   the first denied it and the second did not: a voted rate, the bank angle or the heading is wrong, and
                 the unit drives the filter
    GYROS_ALONE  the second denied it and the first did not, or the unit says nothing: as without a unit

Back to BOTH when the two rates have differed as usual for ``return_frames``.
"""

from __future__ import annotations

import math
from typing import Final

from rig.angles import wrap
from rig.control.tolerant.record import BOTH, GYROS_ALONE, KEPT, UNIT_ALONE
from rig.frame import INDEX, Trust
from rig.inclination.estimate import path_innovation, predict_by
from rig.inclination.mean import carry, move
from rig.inclination.path import pitching
from rig.inclination.unit import SAME_RAD_S, SMOOTH_S, finite, follow_unit, learned
from rig.kernels import kernel

_Q, _R, _PHI = INDEX["pitch_rate"], INDEX["yaw_rate"], INDEX["roll_angle"]
_TRUSTED: Final = int(Trust.TRUSTED)
_AGREES: Final = 0.5  # share of the first innovation from which on the second says the same
_BANK_RAD: Final = 0.06  # farther from the unit's bank angle the voted one is not believed
_BANK_ERROR: Final = 0.05  # rad, of the unit's bank angle: of the rate of turn when it is used


@kernel
def turn(c, w, known, headed, inertial, x, gyros):
    """Move both means by their rates; c, w : a PARAM and a STATE record.

    known, headed : rates and bank are voted, and so is the heading
    inertial : (6,); x : (S,) signals; gyros : which are in the vote, any number that changes with it
    """
    e, u, m, dt = w["filter"], w["unit"], w["second"], c["filter"]["dt"]
    heard = finite(inertial)
    if w["rates"] == GYROS_ALONE or e["frames"] == 0:
        u["roll_angle"] = x[_PHI]
    if heard:
        follow_unit(inertial, x, e["theta"], headed and w["rates"] == BOTH, dt, u)
    else:
        lose_unit(w)
    phi = x[_PHI] if bank_agrees(w, x) else u["roll_angle"]
    rate = pitching(x[_Q], x[_R] - e["yaw_drift"], x[_PHI])
    other = pitching(u["pitch_rate"], u["yaw_rate"], phi)
    if heard and known:
        compare(c, w, rate - other)
    last = m["rate"] if e["frames"] > 0 else other
    carry(dt, m, other, last, dt * math.cos(phi), dt * math.cos(phi) * u["pitch_rate"])
    m["rate"] = other
    if w["rates"] == UNIT_ALONE:
        predict_by(c["filter"], e, other, u["pitch_rate"], phi, gyros)
    else:
        predict_by(c["filter"], e, rate, x[_Q], x[_PHI], gyros)


@kernel
def lose_unit(w):
    """The unit says nothing: the gyros drive the filter."""
    if w["rates"] == UNIT_ALONE:
        drive(w, w["apart"], w["usual"])
    w["rates"], w["similar"], w["unit"]["started"] = GYROS_ALONE, 0, 0


@kernel
def bank_agrees(w, x):
    """Whether the voted bank angle is near that of the unit."""
    return abs(wrap(x[_PHI] - w["unit"]["roll_angle"])) < _BANK_RAD


@kernel
def bank_error(w, x):
    """What the bank angle adds to the error of the rates, of the rate of turn."""
    alone = w["rates"] == UNIT_ALONE or (w["rates"] == BOTH and not bank_agrees(w, x))
    return _BANK_ERROR if alone else 0.0


@kernel
def compare(c, w, difference):
    """Smooth the ``difference`` of the two rates [rad/s], learn the usual one, count the frames that are as usual."""
    dt = c["filter"]["dt"]
    w["apart"] += dt / (SMOOTH_S + dt) * (difference - w["apart"])
    off = w["apart"] - w["usual"]
    w["similar"] = w["similar"] + 1 if abs(off) < SAME_RAD_S else 0
    if w["rates"] == BOTH:
        w["usual_seconds"] += dt
        w["usual"] += learned(off, w["usual_seconds"], dt)


@kernel
def denied(w):
    """Whether what the first mean says against the sensor is said by the second one too, or by nobody else."""
    first, second = w["innovation"], w["second_innovation"]
    return w["rates"] != BOTH or first * second >= _AGREES * first * first


@kernel
def follow(e, w, path):
    """The second mean by the path, after the filter's; e : the filter's STATE record."""
    move(e["g"], w["second"], path_innovation(e, w["second"], path))


@kernel
def settle(c, w, known):
    """At the end of a frame: who is in order, and the second mean that follows the first when it is not asked."""
    size = abs(w["second_innovation"])
    if w["rates"] == BOTH and w["trust"] == _TRUSTED and known:
        alone = w["innovation"] * w["second_innovation"] < _AGREES * size * size
        w["second_over"] = w["second_over"] + 1 if alone and size > c["jump_sigma"] * w["sigma"] else 0
        if w["second_over"] >= c["persistence"]:
            w["rates"], w["similar"] = GYROS_ALONE, 0
    elif w["rates"] != BOTH and w["similar"] >= c["return_frames"]:
        if w["rates"] == UNIT_ALONE:
            drive(w, w["apart"], w["usual"])
        w["rates"], w["second_over"] = BOTH, 0
        align(w, w["apart"])
    if w["rates"] != BOTH or w["trust"] != _TRUSTED or not known:
        align(w, w["usual"] if w["rates"] == BOTH else 0.0)


@kernel
def blame_gyros(w):
    """The first mean alone denies the sensor: go on with the second one, driven by the unit."""
    e, m = w["filter"], w["second"]
    e["theta"], e["path"], e["scale"], e["rate"] = m["theta"], m["path"], m["scale"], m["rate"]
    drive(w, m["drift"] - e["drift"], -w["usual"])
    w["rates"], w["similar"], w["over"], w["cusum"], w["recent"] = UNIT_ALONE, 0, 0, 0.0, 0.0


@kernel
def drive(w, change, usual):
    """Others' rates drive the filter: their drift differs by ``change``, and differed by ``usual`` when it was kept."""
    w["filter"]["drift"] += change
    for i in range(KEPT):
        w["kept"][i, 0] += usual


@kernel
def align(w, apart):
    """Put the second mean where the filter's is; its drift is less by what the two rates are ``apart`` [rad/s]."""
    e, m = w["filter"], w["second"]
    m["theta"], m["path"], m["scale"], m["drift"] = e["theta"], e["path"], e["scale"], e["drift"] - apart
