"""The back-up law of the elevator: for flight without a pitch rate, from one sensor alone.

An observer of the short period (angle of attack, pitch rate, elevator, all from the commanded
equilibrium) is corrected by the normal load factor, or by the angle of attack when that is lost:

    a' = Z_a a + Z_q q + Z_e e + L_a i      elevator = w - K_a a - K_q q
    q' = M_a a + M_q q + M_e e + L_q i      w' = -K_i error
    e' = (elevator - w - e) / lag           i  = measured - expected

The integral w is the elevator of equilibrium.  It follows a load factor, which the outer loops or the
stick ask as a pitch rate.  Without either sensor the elevator stays at w: then a stable aircraft flies on,
an unstable one departs.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic.flight_path import SLOWEST
from rig.computer.control import laws
from rig.computer.control.degraded import lift_angle
from rig.computer.control.law_state import C_Q
from rig.computer.control.laws import move
from rig.computer.control.modes import ALTITUDE, PITCH
from rig.computer.control.source import carry
from rig.core.frame import Law, Source, sig
from rig.core.kernels import clamp, kernel
from rig.core.units.constants import GRAVITY

NOT_NEEDED, LOAD, ALPHA, BLIND = 0, 1, 2, 3  # what the back-up law flies on
_DAMPING: Final = 0.9  # of the altitude loop
_RELEASE_S: Final = 0.5  # how fast a blind law lets the elevator go to its integral


@kernel
def needed(source, param):
    """Return what the back-up law must fly on; NOT_NEEDED while the pitch rate can be had."""
    if source[sig.Q] != Source.DEGRADED:
        return NOT_NEEDED
    attitude = source[sig.THETA] != Source.DEGRADED and source[sig.PHI] != Source.DEGRADED
    if attitude and param[0]["rates_from_attitude"] != 0:
        return NOT_NEEDED
    if source[sig.N_Z] != Source.DEGRADED:
        return LOAD
    return ALPHA if source[sig.ALPHA] != Source.DEGRADED else BLIND


@kernel
def elevator(sensor, law, param, state, gain, measured, command):
    """Fly one frame by the back-up law: write the elevator, its integral and the observer in ``state``.

    sensor : LOAD, ALPHA or BLIND; gain (G,) : scheduled gains; command (C,) : reads the pitch rate
    """
    s, c = state[0], param[0]
    dt, g = c["dt"], gain
    per_load = GRAVITY / max(s["airspeed"], SLOWEST)
    asked, upright = wanted_load(law, param, state, measured, command)
    k, slope = (laws.BACKUP_ALPHA if sensor == ALPHA else laws.BACKUP_LOAD), max(g[laws.LOAD_ALPHA], 1.0)
    error = measured[sig.ALPHA] - lift_angle(asked, g) - s["lift_error"]
    if sensor == LOAD:
        error = (measured[sig.N_Z] - asked) / slope
    fresh = sensor != s["backup"]
    if s["backup"] == NOT_NEEDED:
        s["backup_alpha"], s["backup_pitch_rate"] = error, measured[sig.Q] - (asked - upright) * per_load
    a, q, e = s["backup_alpha"], s["backup_pitch_rate"], s["backup_elevator"]
    proportional = g[k] * a + g[k + 1] * q
    change = -dt * g[k + 2] * error if sensor != BLIND and s["ground"] == 0 else 0.0
    integral = move(s["elevator_integral"], change, proportional, 0, c, s["surface"], fresh)
    s["elevator_integral"] = integral
    if fresh:
        e = s["surface"][0] - integral
    correct = error - a
    if sensor == LOAD:
        expected = g[laws.LOAD_ALPHA] * a + g[laws.LOAD_Q] * q + g[laws.LOAD_ELEVATOR] * e
        correct = measured[sig.N_Z] - asked - expected
    s["backup_alpha"] += dt * (
        g[laws.ALPHA_ALPHA] * a + g[laws.ALPHA_Q] * q + g[laws.ALPHA_ELEVATOR] * e + g[k + 3] * correct
    )
    s["backup_pitch_rate"] += dt * (g[laws.Q_ALPHA] * a + g[laws.Q_Q] * q + g[laws.Q_ELEVATOR] * e + g[k + 4] * correct)
    s["backup_elevator"] = e + dt / c["lag_s"][0] * (s["surface"][0] - integral - e)
    if sensor == BLIND:
        s["backup_alpha"], s["backup_pitch_rate"] = a - dt / _RELEASE_S * a, q - dt / _RELEASE_S * q
    s["backup"] = sensor
    carry(sig.Q, s["backup_pitch_rate"] + (asked - upright) * per_load, Source.DEGRADED, state)


@kernel
def wanted_load(law, param, state, measured, command):
    """Return the load factor [g] to fly, and that which keeps the attitude: n = cos(theta) cos(phi) + V q / g.

    By stick what the pitch rate command asks; engaged what brings climb rate and altitude to their references,
    n = n_turn + (2 D w (climb_r - climb) + w^2 (altitude_r - altitude)) / g, the altitude only if it is held.
    Both within ``backup_load_change`` of a level turn.
    """
    s, c = state[0], param[0]
    speed = max(s["airspeed"], SLOWEST)
    theta, phi, most, w = measured[sig.THETA], measured[sig.PHI], c["backup_load_factor_change"], c["backup_path_rad_s"]
    upright = math.cos(theta) * math.cos(phi)
    turn = speed / GRAVITY * laws.turn_pitch_rate(phi, theta, speed)
    change = speed / GRAVITY * command[C_Q] - turn
    if law == Law.AUTOPILOT and c["vertical"] == ALTITUDE:
        change = 2.0 * _DAMPING * w * (s["altitude_rate"] - s["climb_rate"])
        change = (change + w * w * (s["altitude_reference"] - s["altitude_estimate"])) / GRAVITY
    elif law == Law.AUTOPILOT and c["vertical"] == PITCH:
        change = -2.0 * _DAMPING * w * s["climb_rate"] / GRAVITY
    return upright + turn + clamp(change, -most, most), upright
