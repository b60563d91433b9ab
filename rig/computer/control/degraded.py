"""Degraded modes: what replaces a signal that is lost and has no usable reference.

    pitch, roll and yaw rate    from the rates of the attitude angles, smoothed (``estimate``); attitude lost too:
                                roll and yaw rate are the model's alone, and the back-up law needs no pitch rate
    angle_of_attack             from the load factor and the designed lift slope; lost too: that of 1 g flight
    normal_load_factor          from the angle of attack as well; lost too: that of level flight
    lateral, longitudinal load  0; the sine of the pitch angle
    angle_of_sideslip           what is asked, so the rudder follows the pedal and damps yaw
    static_pressure             reckoned on from the climb angle and the airspeed; attitude lost too: held
    dynamic_pressure            held: gains and limits stay as they are, so does the throttle
    sticks, pedal               neutral
    pitch_angle                 integral of the rates, drawn to angle of attack plus climb angle
    roll_angle                  integral of the rates, drawn to the bank that the turn asks for
    heading                     what is asked: wings level

The error of a substitute is learned while every signal is available: lift, bank of a turn, climb angle.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic.flight_path import SLOWEST, path_angle, pitch_rate_of, pitching, roll_rate_of, yaw_rate_of
from rig.computer.control import laws
from rig.computer.control.law_state import C_GAMMA, C_PSI
from rig.computer.control.source import carry, put
from rig.core.frame import Source, sig
from rig.core.kernels import clamp, kernel
from rig.core.units.angles import wrap
from rig.core.units.constants import GRAVITY

_FLATTEST: Final = 0.5  # cosine; divisions by the cosine of an attitude take at least this
_HASTE: Final = 0.3  # of the time in which an estimated bank is erected, when the roll rate is the model's alone
# Pitch, roll and yaw rate are signals 0, 1 and 2, and so are the surfaces that move them.
_MODEL: Final = (laws.Q_ALPHA, laws.P_BETA, laws.R_BETA)  # the first of three gains of each axis
_LEAST_SLOPE: Final = 1.0  # g per rad; divisions by the lift slope take at least this


@kernel
def substitute(fcc, param, state, gain):
    """Give every lost signal of ``fcc`` its substitute, except the pitch rate when the back-up law is needed.

    A substitute is made from this frame's measurements of the others, or from their own substitutes of the last frame.
    param, state : one record of PARAM and of STATE; gain (G,) : the scheduled gains of the last frame
    """
    s, source = state[0], fcc["source"]
    measured, command = s["measured"], s["command"]
    body_rates(fcc, param, state, gain)
    for i in (sig.D_P, sig.D_R, sig.D_Y, sig.N_Y):
        if source[i] == Source.DEGRADED:
            put(i, 0.0, Source.DEGRADED, param, state)
    for i in (sig.P_S, sig.Q_BAR):
        if source[i] == Source.DEGRADED:
            carry(i, measured[i], Source.DEGRADED, state)
    if source[sig.THETA] == Source.DEGRADED:
        carry(sig.THETA, pitch_angle(source, param, state), Source.DEGRADED, state)
    if source[sig.PHI] == Source.DEGRADED:
        carry(sig.PHI, roll_angle(source, param, state), Source.DEGRADED, state)
    if source[sig.PSI] == Source.DEGRADED:
        put(sig.PSI, command[C_PSI], Source.DEGRADED, param, state)
    if source[sig.ALPHA] == Source.DEGRADED:
        put(sig.ALPHA, angle_of_attack(source, gain, state), Source.DEGRADED, param, state)
    if source[sig.BETA] == Source.DEGRADED:
        put(sig.BETA, -measured[sig.D_Y] * gain[laws.MAX_SIDESLIP], Source.DEGRADED, param, state)
    if source[sig.N_X] == Source.DEGRADED:
        put(sig.N_X, math.sin(measured[sig.THETA]), Source.DEGRADED, param, state)
    if source[sig.N_Z] == Source.DEGRADED:
        put(sig.N_Z, load_factor(source, gain, state), Source.DEGRADED, param, state)
    attitude = source[sig.THETA] != Source.DEGRADED and source[sig.PHI] != Source.DEGRADED
    if attitude and source[sig.P_S] == Source.DEGRADED:
        carry(sig.P_S, static_pressure(param, state), Source.DEGRADED, state)


@kernel
def body_rates(fcc, param, state, gain):
    """Estimate lost body rates from their references, or without them from the rates of the attitude angles.

    Without a heading the turn counts as coordinated; without an attitude the rates are unknown.
    """
    source, reference, s = fcc["source"], fcc["reference"], state[0]
    if source[sig.Q] == Source.VOTED and source[sig.P] == Source.VOTED and source[sig.R] == Source.VOTED:
        return
    measured, tau = s["measured"], param[0]["attitude_filter_s"] + param[0]["dt"]
    theta, phi, speed = measured[sig.THETA], measured[sig.PHI], max(s["airspeed"], SLOWEST)
    rate_of_pitch = (theta - s["smooth_pitch_angle"]) / tau
    rolling = wrap(phi - s["smooth_roll_angle"]) / tau
    turning = wrap(measured[sig.PSI] - s["smooth_heading"]) / tau
    if source[sig.PSI] == Source.DEGRADED:
        turning = GRAVITY / speed * math.sin(phi) / max(math.cos(phi), _FLATTEST)
    attitude = source[sig.THETA] != Source.DEGRADED and source[sig.PHI] != Source.DEGRADED
    if not attitude or param[0]["rates_from_attitude"] == 0:
        rate_of_pitch = math.nan
    pitch, yaw = pitch_rate_of(rate_of_pitch, turning, theta, phi), yaw_rate_of(rate_of_pitch, turning, theta, phi)
    roll = roll_rate_of(rolling, turning, theta) + 0.0 * rate_of_pitch
    for i, rate in ((sig.Q, pitch), (sig.P, roll), (sig.R, yaw)):
        if source[i] == Source.REFERENCE:
            estimate(i, reference[i], Source.REFERENCE, param, state, gain)
        elif source[i] == Source.DEGRADED and (i != sig.Q or math.isfinite(rate)):
            estimate(i, rate, Source.DEGRADED, param, state, gain)


@kernel
def estimate(i, other, source, param, state, gain):
    """Estimate signal ``i``, a body rate, by its ``other`` source: attitude or reference (NaN: nothing).

    A rate from attitudes or from a reference is noisy, and a filter that is slow enough for the surfaces costs the loop
    its phase.  The designed model of the axis bridges it: an observer with an unknown constant,

        x' = K_i incidence + K_x x + K_s surface + b + 2 w (other - x)      b' = w^2 (other - x)

    incidence is the angle of attack or of sideslip, surface the commanded one behind its actuator's lag.  The estimate
    continues from the last measurement; without another source the model continues alone.
    """
    s, c = state[0], param[0]
    measured, surface, bias, deflection = s["measured"], s["surface"], s["rate_bias"], s["deflection"]
    x, k = measured[i], _MODEL[i]
    if not math.isfinite(x):
        x = other if math.isfinite(other) else 0.0
    model = gain[k] * measured[sig.ALPHA if i == 0 else sig.BETA] + gain[k + 1] * x
    if s["source"][i] == Source.VOTED or s["started"] == 0:
        deflection[i] = surface[i]
        bias[i] = -model - gain[k + 2] * deflection[i]
    model += gain[k + 2] * deflection[i] + bias[i]
    deflection[i] += min(c["dt"] / c["lag_s"][i], 1.0) * (surface[i] - deflection[i])
    w = c["rate_bandwidth_rad_s"]
    if math.isfinite(other):
        bias[i] += c["dt"] * w * w * (other - x)
        model += 2.0 * w * (other - x)
    carry(i, x + c["dt"] * model, source, state)


@kernel
def pitch_angle(source, param, state):
    """Return the pitch angle [rad] by the rates' integral, drawn to angle of attack plus climb angle."""
    s, c = state[0], param[0]
    measured = s["measured"]
    phi = measured[sig.PHI]
    climb = s["path_error"]
    if source[sig.P_S] != Source.DEGRADED:
        climb += s["climb_rate"] / max(s["airspeed"], SLOWEST)
    rate = pitching(measured[sig.Q], measured[sig.R], phi)
    drawn = measured[sig.ALPHA] * math.cos(phi) + climb
    theta = measured[sig.THETA]
    if not math.isfinite(theta):
        return drawn
    return theta + c["dt"] * (rate + (drawn - theta) / c["attitude_erection_s"])


@kernel
def roll_angle(source, param, state):
    """Return the roll angle [rad] without its sensor: the rates' integral, drawn to the bank of the present turn.

    sin(bank) = V (r - p tan(alpha)) / g in coordinated flight; without a yaw rate it is drawn to wings level.
    """
    s, c = state[0], param[0]
    measured = s["measured"]
    bank = 0.0
    if source[sig.R] != Source.DEGRADED:
        bank = math.asin(clamp(turn_sine(state) - s["turn_error"], -1.0, 1.0))
    phi, theta = measured[sig.PHI], measured[sig.THETA]
    if not math.isfinite(phi):
        return bank
    rate = measured[sig.P]
    if math.isfinite(theta):
        rate += (measured[sig.Q] * math.sin(phi) + measured[sig.R] * math.cos(phi)) * math.tan(clamp(theta, -1.0, 1.0))
    erection = c["attitude_erection_s"] * (_HASTE if source[sig.P] == Source.DEGRADED else 1.0)
    return phi + c["dt"] * (rate + wrap(bank - phi) / erection)


@kernel
def turn_sine(state):
    """Return the sine of the bank at which the present yaw rate is that of a coordinated turn."""
    s = state[0]
    measured = s["measured"]
    turn = measured[sig.R] - measured[sig.P] * math.tan(measured[sig.ALPHA])
    return max(s["airspeed"], SLOWEST) * turn / GRAVITY


@kernel
def lift_angle(load, gain):
    """Return the angle of attack [rad] at which the wing carries ``load`` [g]."""
    return gain[laws.TRIM_ALPHA] + (load - 1.0) / max(gain[laws.LIFT_SLOPE], _LEAST_SLOPE)


@kernel
def angle_of_attack(source, gain, state):
    """Return the angle of attack [rad] from the load factor, of 1 g flight when that is lost too."""
    s = state[0]
    load = s["measured"][sig.N_Z] if source[sig.N_Z] != Source.DEGRADED else 1.0
    return lift_angle(load, gain) + s["lift_error"]


@kernel
def load_factor(source, gain, state):
    """Return the normal load factor [g] from the angle of attack; of level flight when that is lost too."""
    s = state[0]
    measured = s["measured"]
    if source[sig.ALPHA] == Source.DEGRADED:
        return math.cos(measured[sig.THETA]) / max(math.cos(measured[sig.PHI]), _FLATTEST)
    return 1.0 + gain[laws.LIFT_SLOPE] * (measured[sig.ALPHA] - s["lift_error"] - gain[laws.TRIM_ALPHA])


@kernel
def static_pressure(param, state):
    """Return the static pressure [Pa] reckoned on from the climb: p' = -rho g V sin(gamma), rho = 2 q_bar / V^2."""
    s = state[0]
    measured, speed = s["measured"], max(s["airspeed"], SLOWEST)
    gamma = path_angle(measured[sig.THETA], measured[sig.PHI], measured[sig.ALPHA], measured[sig.BETA])
    gamma -= s["path_error"]
    weight = 2.0 * measured[sig.Q_BAR] / speed * GRAVITY
    return measured[sig.P_S] - param[0]["dt"] * weight * math.sin(gamma)


@kernel
def follow(param, state):
    """Filter the attitude, whose rates may be needed in the next frame."""
    s, c = state[0], param[0]
    measured, share = s["measured"], c["dt"] / (c["attitude_filter_s"] + c["dt"])
    first = s["started"] == 0
    if first:
        s["smooth_pitch_angle"], s["smooth_roll_angle"] = measured[sig.THETA], measured[sig.PHI]
        s["smooth_heading"] = measured[sig.PSI]
        return
    s["smooth_pitch_angle"] += share * (measured[sig.THETA] - s["smooth_pitch_angle"])
    s["smooth_roll_angle"] += share * wrap(measured[sig.PHI] - s["smooth_roll_angle"])
    s["smooth_heading"] += share * wrap(measured[sig.PSI] - s["smooth_heading"])


@kernel
def learn(param, state, gain, command):
    """Learn what the substitutes are wrong by, while all signals are known."""
    s, share = state[0], param[0]["learning_share"]
    measured = s["measured"]
    lift = measured[sig.ALPHA] - lift_angle(measured[sig.N_Z], gain)
    turn = turn_sine(state) - math.sin(measured[sig.PHI])
    path = command[C_GAMMA] - s["climb_rate"] / max(s["airspeed"], SLOWEST)
    s["lift_error"] += share * (lift - s["lift_error"])
    s["turn_error"] += share * (turn - s["turn_error"])
    s["path_error"] += share * (path - s["path_error"])
