"""One frame of the pitch-angle monitor: move the estimate, test the sensor, substitute a faulty one."""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic.flight_path import PATH_SIGNALS, climb, path_pitch_angle
from rig.computer.analytic.pitch_filter import begin, correct, follow_path, learn_yaw_drift, move
from rig.computer.fdi import fault_estimate, rate_bias
from rig.computer.fdi.decision import decide, innovate
from rig.core.frame import INDEX, SensorFault, Source, Trust, sig
from rig.core.kernels import kernel

_PATH: Final = tuple(INDEX[name] for name in PATH_SIGNALS)
_FIRST_THETA_RAD: Final = 0.001  # sigma of the sensor at the start


@kernel
def monitor_pitch_angle(inertial, fcc, param, state, signals):
    """Replace the pitch angle in ``signals`` by its estimate while the sensor is declared faulty; write the status.

    inertial : quantities of frame.INERTIAL; fcc : an FCC record, reads source, level, writes estimate, trust,
    sensor_fault
    signals : (S,), all finite; param, state : one record of PARAM and of STATE; state in place
    A healthy sensor is passed on bit for bit.
    """
    c, w, source, levels = param[0], state[0], fcc["source"], fcc["level"]
    e, of_filter = w["filter"], c["filter"]
    measured, usable = signals[sig.THETA], source[sig.THETA] == Source.VOTED
    if w["trust"] == Trust.NONE:
        begin(of_filter, e, measured, _FIRST_THETA_RAD)
        w["trust"], w["effectiveness"] = Trust.TRUSTED, 1.0
        rate_bias.align(w, 0.0)
    rates_voted = source[sig.Q] == Source.VOTED and source[sig.R] == Source.VOTED and source[sig.PHI] == Source.VOTED
    heading_voted = rates_voted and source[sig.PSI] == Source.VOTED
    learn_yaw_drift(heading_voted, of_filter, e, signals)
    rate_bias.turn(c, w, rates_voted, heading_voted, inertial, signals, 8 * levels[sig.Q] + levels[sig.R])
    climb(signals, e["theta"], of_filter["dt"], e["vertical"])
    path, path_voted = path_pitch_angle(signals, e["vertical"]), all_voted(source)
    if usable:
        innovate(c, w, measured, signals)
        decide(rates_voted, path_voted, c, w, measured, path)
        if w["trust"] == Trust.CORRECTED:
            fault_estimate.learn(c, w, measured)
        elif w["jump_frames"] == 0:
            correct(e, measured - e["theta"], 0.0, c["sensor_variance"])
            move(e["g"], w["second"], measured - w["second"]["theta"])
    if path_voted:
        follow_path(of_filter, e, path)
        rate_bias.follow(e, w, path)
    rate_bias.settle(c, w, rates_voted and usable)
    if usable:
        signals[sig.THETA] = flown_pitch_angle(c, w, measured)
    write_status(fcc, w)


@kernel
def all_voted(source):
    """Return True if all that the path is made of comes from votes."""
    lost = 0
    for i in _PATH:
        lost += 0 if source[i] == Source.VOTED else 1
    return lost == 0


@kernel
def flown_pitch_angle(c, w, measured):
    """Return the pitch angle that the law flies on: ``measured``, or the estimate within the bound."""
    if w["trust"] == Trust.CORRECTED or (w["jump_frames"] > 0 and rate_bias.confirmed(w)):
        return measured + min(max(w["filter"]["theta"] - measured, -c["max_correction_rad"]), c["max_correction_rad"])
    if w["fade_left"] > 0:
        w["fade_left"] -= 1
        return measured + w["fade"] * w["fade_left"] / c["fade_frames"]
    return measured


@kernel
def write_status(fcc, w):
    """Write estimate, trust and sensor_fault of the row; in the order of frame.ESTIMATES."""
    estimate, e, p = fcc["estimate"], w["filter"], w["fault_covariance"]
    estimate[0], estimate[1], estimate[2] = e["theta"], w["effectiveness"], w["offset"]
    estimate[3], estimate[4] = math.sqrt(max(p[0], 0.0)), math.sqrt(max(p[1], 0.0))
    estimate[5], estimate[6] = w["innovation"], w["sigma"]
    estimate[7], estimate[8] = e["drift"], e["path"]
    fcc["trust"], fcc["sensor_fault"] = (
        w["trust"],
        SensorFault.RATE_BIAS if rate_bias.biased(w) else fault_estimate.name(w),
    )
