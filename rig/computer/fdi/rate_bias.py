"""Isolate a biased rate: the voted gyros against the inertial unit.

One mean of the filter integrates the gyros, a second one the inertial unit's rates; the same sensor and path correct
both with the same gain.  A fault of the pitch-angle sensor moves both residuals, a biased rate only one of them:

    BOTH         no rate is suspected; a sensor fault is declared when both residuals show it
    UNIT_ALONE   the gyros' residual alone was too large: a voted rate, the bank angle or the heading is wrong, and the
                 filter integrates the unit's rates
    GYROS_ALONE  the unit's residual alone was too large, or the unit gives no number: as without a unit

Back to BOTH when the two rates have differed by no more than usual for ``return_frames``, in straight flight: in a turn
a wrong bank angle or heading may look like that.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic import unit_bank
from rig.computer.analytic.flight_path import pitching
from rig.computer.analytic.pitch_filter import carry, move, path_innovation, predict_by
from rig.computer.fdi.pitch_test_state import BOTH, GYROS_ALONE, KEPT, UNIT_ALONE
from rig.core.frame import Trust, sig
from rig.core.kernels import kernel
from rig.core.units.angles import wrap

_AGREES: Final = 0.5  # ratio of the two residuals from which on they show the same fault
_DIFFERS: Final = 0.25  # the ratio below which they do not; between the two more must be seen
_BANK_RAD: Final = 0.04  # farther from the unit's bank angle the voted one is not used
SUDDEN: Final = 0.5  # share of the residual that must be new for a jump
_SAME_BANK_RAD: Final = 0.012  # the two bank angles are nearly always nearer without a fault
_BANK_ERROR: Final = 0.05  # rad, of the unit's bank angle: of the rate of turn when it is used


@kernel
def turn(c, w, rates_voted, heading_voted, inertial, x, gyros):
    """Propagate both means by their rates; c, w : a PARAM and a STATE record.

    rates_voted, heading_voted : rates and bank are voted, and so is the heading
    inertial : quantities of frame.INERTIAL; x : (S,) signals
    gyros : which are in the vote, any number that changes with it
    """
    e, u, m, dt = w["filter"], w["unit"], w["second"], c["filter"]["dt"]
    valid = unit_bank.finite(inertial)
    if w["rates"] == GYROS_ALONE or e["frames"] == 0:
        u["roll_angle"], u["settled"] = x[sig.PHI], 0.0
    if valid:
        unit_bank.follow_unit(inertial, x, e["theta"], heading_voted and w["rates"] == BOTH, dt, u)
    else:
        lose_unit(w)
    if valid and rates_voted:
        compare_banks(w, x[sig.PHI], dt)
    bank = unit_bank.bank_by(u)
    phi = x[sig.PHI] if w["rates"] != UNIT_ALONE and bank_agrees(w, x) else bank
    rate = pitching(x[sig.Q], x[sig.R] - e["yaw_drift"], x[sig.PHI])
    other = pitching(u["pitch_rate"], u["yaw_rate"], phi)
    if valid and rates_voted:
        compare(c, w, rate - other)
    bank_effect = pitching(u["pitch_rate"], u["yaw_rate"], bank) - other
    w["bank_effect"] += dt * (bank_effect - w["bank_effect"] / max(c["lag_s"], dt))
    last = m["rate"] if e["frames"] > 0 else other
    carry(dt, m, other, last, dt * math.cos(phi), dt * math.cos(phi) * u["pitch_rate"])
    m["rate"] = other
    if w["rates"] == UNIT_ALONE:
        predict_by(c["filter"], e, other, u["pitch_rate"], phi, gyros)
    else:
        predict_by(c["filter"], e, rate, x[sig.Q], x[sig.PHI], gyros)


@kernel
def lose_unit(w):
    """Integrate the gyros, as the unit gives no number."""
    if w["rates"] == UNIT_ALONE:
        drive(w, w["rate_difference"], w["usual_rate_difference"])
    w["rates"], w["usual_frames"], w["unit"]["started"] = GYROS_ALONE, 0, 0


@kernel
def bank_agrees(w, x):
    """Return True if the voted bank angle is near that of the unit."""
    return abs(wrap(x[sig.PHI] - unit_bank.bank_by(w["unit"]))) < _BANK_RAD


@kernel
def bank_error(w, x):
    """Return what the bank angle adds to the error of the rates, as a share of the rate of turn."""
    alone = w["rates"] == UNIT_ALONE or (w["rates"] == BOTH and not bank_agrees(w, x))
    return _BANK_ERROR if alone else 0.0


@kernel
def compare_banks(w, voted, dt):
    """Smooth the difference of the ``voted`` bank angle [rad] from that by the unit, and learn the usual one."""
    u = w["unit"]
    unit_bank.learn_bank(u, wrap(voted - u["roll_angle"]), w["rates"] == BOTH and w["trust"] == Trust.TRUSTED, dt)
    w["bank_difference"] += dt / (unit_bank.SMOOTH_S + dt) * (wrap(voted - unit_bank.bank_by(u)) - w["bank_difference"])


@kernel
def returning(w):
    """Return True if rates as usual prove that they are in order: in straight flight, or when a bank angle agrees."""
    agrees = w["bank_suspected"] != 0 and abs(w["bank_difference"]) < _SAME_BANK_RAD
    return w["rates"] != UNIT_ALONE or agrees or abs(w["unit"]["roll_angle"]) < unit_bank.STRAIGHT_RAD


@kernel
def compare(c, w, difference):
    """Smooth the ``difference`` of the two rates [rad/s], learn the usual one, count the frames that are as usual."""
    dt = c["filter"]["dt"]
    w["rate_difference"] += dt / (unit_bank.SMOOTH_S + dt) * (difference - w["rate_difference"])
    off = w["rate_difference"] - w["usual_rate_difference"]
    if abs(off) >= unit_bank.SAME_RAD_S:
        w["usual_frames"], w["unusual"] = 0, 1
    else:
        w["usual_frames"] = w["usual_frames"] + 1 if returning(w) else 0
    if w["rates"] == BOTH:
        w["usual_rate_seconds"] += dt
        w["usual_rate_difference"] += unit_bank.learned(off, w["usual_rate_seconds"], dt)


@kernel
def second_opinion(w):
    """Return the second residual [rad]: with the voted bank angle or with the unit's, whichever shows less of a fault.

    A sudden fault is no error of the bank angle, so that the voted one is enough.
    """
    first, second = w["innovation"], w["second_innovation"]
    if abs(first - w["recent"]) >= SUDDEN * abs(first):
        return second
    return min(second, second - w["bank_effect"]) if first > 0.0 else max(second, second - w["bank_effect"])


@kernel
def confirmed(w):
    """Return True if the second residual confirms a sensor fault that the first one shows, or cannot be asked."""
    first = w["innovation"]
    return w["rates"] != BOTH or first * second_opinion(w) >= _AGREES * first * first


@kernel
def refuted(w):
    """Return True if the second residual shows too little of what the first one does."""
    first = w["innovation"]
    return first * second_opinion(w) < _DIFFERS * first * first


@kernel
def follow(e, w, path):
    """Correct the second mean by the path, after the filter's own; e : the filter's STATE record."""
    move(e["g"], w["second"], path_innovation(e, w["second"], path))


@kernel
def settle(c, w, rates_voted):
    """End a frame: isolate the unit, return to BOTH, and align the second mean while it is not asked."""
    size = abs(w["second_innovation"])
    if w["rates"] == BOTH and w["trust"] == Trust.TRUSTED and rates_voted:
        alone = w["innovation"] * w["second_innovation"] < _AGREES * size * size
        w["second_jump_frames"] = w["second_jump_frames"] + 1 if alone and size > c["jump_sigma"] * w["sigma"] else 0
        if w["second_jump_frames"] >= c["persistence"]:
            w["rates"], w["usual_frames"] = GYROS_ALONE, 0
    elif w["rates"] != BOTH and w["usual_frames"] >= c["return_frames"]:
        if w["rates"] == UNIT_ALONE:
            drive(w, w["rate_difference"], w["usual_rate_difference"])
            w["filter"]["p"][0, 0] += w["innovation"] * w["innovation"]  # the unit's bank angle was less accurate
        w["rates"], w["second_jump_frames"], w["bank_effect"] = BOTH, 0, 0.0
        align(w, w["rate_difference"])
    if w["rates"] != BOTH or w["trust"] != Trust.TRUSTED or not rates_voted:
        align(w, w["usual_rate_difference"] if w["rates"] == BOTH else 0.0)


@kernel
def reject_gyros(w):
    """Continue with the second mean: the first residual alone shows a fault."""
    e, m, first = w["filter"], w["second"], w["innovation"]
    e["theta"], e["path"], e["scale"], e["rate"] = m["theta"], m["path"], m["scale"], m["rate"]
    w["bank_suspected"] = 1 if first * w["second_innovation"] >= _DIFFERS * first * first else 0
    if w["bank_suspected"] != 0:
        e["theta"] += w["bank_effect"]
    drive(w, m["drift"] - e["drift"], -w["usual_rate_difference"])
    w["unusual"] = 0 if abs(w["rate_difference"] - w["usual_rate_difference"]) < unit_bank.SAME_RAD_S else 1
    w["rates"], w["usual_frames"], w["jump_frames"], w["cusum"], w["recent"] = UNIT_ALONE, 0, 0, 0.0, 0.0


@kernel
def biased(w):
    """Return True if a voted rate is biased: rejected for a trusted sensor, and further from the unit's than usual."""
    return w["rates"] == UNIT_ALONE and w["trust"] == Trust.TRUSTED and w["unusual"] != 0


@kernel
def drive(w, change, usual):
    """Shift the drift by ``change`` [rad/s] for another source of rates, and the kept ones by ``usual`` [rad/s]."""
    w["filter"]["drift"] += change
    for i in range(KEPT):
        w["kept"][i, 0] += usual


@kernel
def align(w, difference):
    """Set the second mean to the filter's, its drift less by the ``difference`` of the two rates [rad/s]."""
    e, m = w["filter"], w["second"]
    m["theta"], m["path"], m["scale"], m["drift"] = e["theta"], e["path"], e["scale"], e["drift"] - difference
