"""One frame of the pitch-angle monitor: move the estimate, test the sensor, substitute a faulty one."""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic.flight_path import PATH_SIGNALS, climb, path_pitch_angle
from rig.computer.analytic.pitch_filter import begin, correct, follow_path, learn_yaw_drift
from rig.computer.analytic.pitch_mean import move
from rig.computer.fdi import fault_estimate, rate_bias
from rig.computer.fdi.decision import decide, innovate
from rig.frame import INDEX, Lie, Source, Trust, sig
from rig.kernels import kernel

_PATH: Final = tuple(INDEX[name] for name in PATH_SIGNALS)
_FIRST_THETA_RAD: Final = 0.001  # sigma of what the sensor says at the start


@kernel
def monitor_pitch_angle(inertial, fcc, param, state, measured):
    """Replace the pitch angle in ``measured`` by its estimate while the sensor is declared faulty; write the status.

    inertial : quantities of frame.INERTIAL; fcc : an FCC record, reads source and level; writes estimate, trust, lie
    measured : (S,) signals, all finite; param, state : one record of PARAM and of STATE; state in place
    A healthy sensor is passed on bit for bit.
    """
    c, w, source, levels = param[0], state[0], fcc["source"], fcc["level"]
    e, of_filter = w["filter"], c["filter"]
    said, usable = measured[sig.THETA], source[sig.THETA] == Source.VOTED
    if w["trust"] == Trust.NONE:
        begin(of_filter, e, said, _FIRST_THETA_RAD)
        w["trust"], w["effectiveness"] = Trust.TRUSTED, 1.0
        rate_bias.align(w, 0.0)
    known = source[sig.Q] == Source.VOTED and source[sig.R] == Source.VOTED and source[sig.PHI] == Source.VOTED
    headed = known and source[sig.PSI] == Source.VOTED
    learn_yaw_drift(headed, of_filter, e, measured)
    rate_bias.turn(c, w, known, headed, inertial, measured, 8 * levels[sig.Q] + levels[sig.R])
    climb(measured, e["theta"], of_filter["dt"], e["vertical"])
    path, heard = path_pitch_angle(measured, e["vertical"]), voted(source)
    if usable:
        innovate(c, w, said, measured)
        decide(known, heard, c, w, said, path)
        if w["trust"] == Trust.CORRECTED:
            fault_estimate.learn(c, w, said)
        elif w["over"] == 0:
            correct(e, said - e["theta"], 0.0, c["sensor_variance"])
            move(e["g"], w["second"], said - w["second"]["theta"])
    if heard:
        follow_path(of_filter, e, path)
        rate_bias.follow(e, w, path)
    rate_bias.settle(c, w, known and usable)
    if usable:
        measured[sig.THETA] = answer(c, w, said)
    tell(fcc, w)


@kernel
def voted(source):
    """Whether all that the path is made of comes from votes."""
    lost = 0
    for i in _PATH:
        lost += 0 if source[i] == Source.VOTED else 1
    return lost == 0


@kernel
def answer(c, w, said):
    """The pitch angle that the law flies on: what the sensor ``said``, or the estimate within the bound."""
    if w["trust"] == Trust.CORRECTED or (w["over"] > 0 and rate_bias.confirmed(w)):
        return said + min(max(w["filter"]["theta"] - said, -c["max_correction_rad"]), c["max_correction_rad"])
    if w["fade_left"] > 0:
        w["fade_left"] -= 1
        return said + w["fade"] * w["fade_left"] / c["fade_frames"]
    return said


@kernel
def tell(fcc, w):
    """Write estimate, trust and lie of the row; in the order of frame.ESTIMATES."""
    told, e, p = fcc["estimate"], w["filter"], w["lie"]
    told[0], told[1], told[2] = e["theta"], w["effectiveness"], w["offset"]
    told[3], told[4] = math.sqrt(max(p[0], 0.0)), math.sqrt(max(p[1], 0.0))
    told[5], told[6] = w["innovation"], w["sigma"]
    told[7], told[8] = e["drift"], e["path"]
    fcc["trust"], fcc["lie"] = w["trust"], Lie.RATE_BIAS if rate_bias.biased(w) else fault_estimate.name(w)
