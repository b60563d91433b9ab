"""One frame of the control law: signals in, outer loops, inner loops, surfaces out."""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic.flight_path import SLOWEST
from rig.computer.control import backup, degraded, laws
from rig.computer.control.airdata import (
    equivalent_airspeed,
    flight_path_angle,
    mach_number,
    true_airspeed,
)
from rig.computer.control.laws import clamp, move
from rig.computer.control.source import select
from rig.computer.control.state import PATH, STICK
from rig.computer.fdi.monitor import monitor_pitch_angle
from rig.computer.gain_schedule import look_up
from rig.frame import COMMANDS, DEMANDS, DISCRETE_INDEX, SURFACES, Law, S, Source, sig
from rig.kernels import kernel
from rig.units.angles import wrap
from rig.units.atmosphere import pressure_altitude, temperature
from rig.units.constants import GRAVITY, TWO_PI

_ENGAGED: Final = DISCRETE_INDEX["autopilot_engaged"]
_WHEELS, _GEAR = DISCRETE_INDEX["weight_on_wheels"], DISCRETE_INDEX["gear_down"]
_DEMANDS, _SURFACES, _COMMANDS = len(DEMANDS), len(SURFACES), len(COMMANDS)
_BRAKING: Final = 0.3  # share of the allowed load factor change that a change of altitude plans with
_ALPHA_APPROACH_1_S: Final = 2.0  # pitch rate allowed per angle left to the alpha limit
(
    _C_Q, _C_P, _C_BETA, _C_THETA, _C_PHI, _C_ALTITUDE, _C_PSI, _C_SPEED, _C_PRESSURE_ALTITUDE, _C_EAS, _C_GAMMA
) = range(_COMMANDS)  # fmt: skip


@kernel
def control_law(bus, fcc, data):
    """Fly one frame: signals to surfaces.

    bus, fcc : the row's BUS and FCC records; reads demand, inertial, voted, level, reference, reference_usable,
               discrete_voted; writes source, command, surface, law, estimate, trust, lie
    data : ControlData
    A signal that is not finite keeps its last value; before the first one the surfaces stay at trim.
    """
    s = data.state[0]
    param, state, gain = data.param, data.state, data.gain
    law = Law.AUTOPILOT if fcc["discrete_voted"][_ENGAGED] == 1 else Law.STICK
    source, measured, command = fcc["source"], s["measured"], s["command"]
    keep_demand(bus["demand"], state)
    lost = select(fcc, param, state)
    if lost > 0:
        if s["started"] == 0:
            look_up(data.pressures, data.table, measured[sig.Q_BAR], gain)
        degraded.substitute(fcc, param, state, gain)
    if complete(measured):
        if data.fdi_param[0]["on"] != 0:
            monitor_pitch_angle(bus["inertial"], fcc, data.fdi_param, data.fdi, measured)
        air_data(measured, command)
        fresh = s["started"] == 0 or law != s["law"]
        lifted = modes(fcc["discrete_voted"], state)
        filter_slow(param, state, measured, command, s["started"] == 0)
        look_up(data.pressures, data.table, s["schedule_pressure"], gain)
        if fresh or law == Law.STICK:
            capture(state, gain, measured, command)
        elif lifted:
            begin_path(state, gain, measured)
        degraded.follow(param, state)
        if lost == 0 and s["ground"] == 0:
            degraded.learn(param, state, gain, command)
        outer(param, state, gain, measured, command, law)
        inner(param, state, gain, measured, command, source, law, fresh)
        s["started"], s["law"] = 1, law
    fcc["law"] = law if s["backup"] == backup.NOT_NEEDED else Law.BACKUP
    for i in range(_COMMANDS):
        fcc["command"][i] = s["command"][i]
    for i in range(_SURFACES):
        fcc["surface"][i] = s["surface"][i]


@kernel
def modes(voted, state):
    """Set the modes that the voted discretes ask for; returns whether the aircraft has just left the ground."""
    s = state[0]
    before = s["ground"]
    s["ground"] = 1 if voted[_WHEELS] == 1 else 0
    s["approach"] = 1 if voted[_GEAR] == 1 else 0
    return before != 0 and s["ground"] == 0


@kernel
def keep_demand(demand, state):
    """Keep every finite demand."""
    kept = state[0]["demand"]
    for i in range(_DEMANDS):
        if math.isfinite(demand[i]):
            kept[i] = demand[i]


@kernel
def complete(measured):
    """Return True if every signal has a value."""
    missing = 0
    for i in range(S):
        missing += 0 if math.isfinite(measured[i]) else 1
    return missing == 0


@kernel
def air_data(measured, command):
    """Write pressure altitude, equivalent and true airspeed, flight-path angle to ``command``."""
    altitude = pressure_altitude(measured[sig.P_S])
    mach = mach_number(measured[sig.P_S], measured[sig.Q_BAR])
    command[_C_PRESSURE_ALTITUDE] = altitude
    command[_C_EAS] = equivalent_airspeed(measured[sig.Q_BAR])
    command[_C_SPEED] = true_airspeed(mach, temperature(altitude))
    command[_C_GAMMA] = flight_path_angle(
        measured[sig.THETA], measured[sig.PHI], measured[sig.ALPHA], measured[sig.BETA]
    )


@kernel
def filter_slow(param, state, measured, command, first):
    """Filter dynamic pressure, airspeed and vertical motion; at the start take the sample itself."""
    s, c = state[0], param[0]
    speed, pressure, altitude = command[_C_SPEED], measured[sig.Q_BAR], command[_C_PRESSURE_ALTITUDE]
    laws.vertical_motion(altitude, vertical_acceleration(measured), c["climb_crossover_rad_s"], c["dt"], state)
    if first:
        s["airspeed"], s["schedule_pressure"] = speed, pressure
        s["altitude_estimate"], s["acceleration_error"] = altitude, 0.0
        s["climb_rate"] = speed * math.sin(command[_C_GAMMA])
    else:
        s["airspeed"] += c["airspeed_share"] * (speed - s["airspeed"])
        s["schedule_pressure"] += c["schedule_share"] * (pressure - s["schedule_pressure"])


@kernel
def vertical_acceleration(measured):
    """Return the upward acceleration [m/s2] from the load factors and the attitude."""
    theta, phi = measured[sig.THETA], measured[sig.PHI]
    load = measured[sig.N_X] * math.sin(theta) - measured[sig.N_Y] * math.sin(phi) * math.cos(theta)
    load += measured[sig.N_Z] * math.cos(phi) * math.cos(theta)
    return GRAVITY * (load - 1.0)


@kernel
def capture(state, gain, measured, command):
    """Take the present flight as what the autopilot will hold."""
    s = state[0]
    s["pitch_angle"], s["roll_angle"], s["heading"] = measured[sig.THETA], measured[sig.PHI], measured[sig.PSI]
    s["altitude"] = s["altitude_estimate"]
    begin_path(state, gain, measured)
    s["held_airspeed"] = s["airspeed"]


@kernel
def begin_path(state, gain, measured):
    """Begin the altitude path at the present altitude and climb rate, with the present pitch attitude."""
    s = state[0]
    s["altitude_reference"], s["altitude_rate"] = s["altitude_estimate"], s["climb_rate"]
    climb = s["climb_rate"] / max(s["airspeed"], SLOWEST)
    s["altitude_integral"] = (1.0 + gain[laws.PATH_PITCH]) * (measured[sig.THETA] - climb)


@kernel
def outer(param, state, gain, measured, command, law):
    """Turn demands or sticks into pitch rate, roll rate and sideslip commands.

    On the ground the autopilot's pitch and roll attitude commands stay as they are.
    """
    s, c = state[0], param[0]
    demand, holds = s["demand"], s["ground"] != 0 and s["started"] != 0
    held_pitch, held_roll = command[_C_THETA], command[_C_PHI]
    speed = max(s["airspeed"], SLOWEST)
    theta, phi = measured[sig.THETA], measured[sig.PHI]
    command[_C_THETA] = s["pitch_angle"]
    command[_C_PHI] = s["roll_angle"]
    command[_C_ALTITUDE] = s["altitude"]
    command[_C_PSI] = s["heading"]
    command[_C_SPEED] = s["held_airspeed"]
    vertical, lateral = STICK, STICK
    if law == Law.AUTOPILOT:
        vertical, lateral = c["vertical"], c["lateral"]
        command[_C_THETA] += demand[0]
        command[_C_PHI] = wrap(command[_C_PHI] + demand[1])
        command[_C_ALTITUDE] += demand[2]
        command[_C_PSI] = (command[_C_PSI] + demand[3]) % TWO_PI
        command[_C_SPEED] += demand[4]
        bank = c["max_bank_rad"] if s["approach"] == 0 else c["gear_max_bank_rad"]
        if lateral == PATH:
            error = command[_C_PSI] - measured[sig.PSI]
            command[_C_PHI] = laws.bank_for_heading(error, gain[laws.HEADING], speed, bank)
        elif s["approach"] != 0:
            command[_C_PHI] = clamp(command[_C_PHI], -bank, bank)
        if holds:
            command[_C_THETA], command[_C_PHI] = held_pitch, held_roll
        elif vertical == PATH:
            steepest = c["max_climb_angle_rad"]
            acceleration = _BRAKING * c["max_load_factor_change"] * GRAVITY
            capture_gain = 0.5 * gain[laws.PATH_ALTITUDE] / gain[laws.PATH_CLIMB]
            highest = speed * math.sin(steepest)
            laws.approach(command[_C_ALTITUDE], capture_gain, highest, acceleration, c["dt"], state)
            command[_C_THETA] = laws.path_pitch(theta, speed, steepest, gain, c["dt"], state)
    pitch_rate(param, state, gain, measured, command, vertical, speed)
    roll_rate(gain, measured, command, lateral)
    command[_C_P] += laws.turn_roll_rate(phi, theta, speed) if lateral != STICK else 0.0
    command[_C_BETA] = -measured[sig.D_Y] * gain[laws.MAX_SIDESLIP]


@kernel
def pitch_rate(param, state, gain, measured, command, vertical, speed):
    """Command a pitch rate from the stick or the pitch attitude error, within load factor and alpha."""
    c = param[0]
    per_load = GRAVITY / speed
    most, least = c["max_load_factor"] - 1.0, c["min_load_factor"] - 1.0
    if state[0]["approach"] != 0:
        most, least = c["gear_max_load_factor"] - 1.0, c["gear_min_load_factor"] - 1.0
    if vertical == STICK:
        stick = measured[sig.D_P]
        rate = per_load * (stick * most if stick > 0.0 else -stick * least)
    else:
        error = command[_C_THETA] - measured[sig.THETA]
        limit = per_load * c["max_load_factor_change"]
        rate = clamp(gain[laws.PITCH_ANGLE] * error, -limit, limit)
    rate += laws.turn_pitch_rate(measured[sig.PHI], measured[sig.THETA], speed)
    allowed = _ALPHA_APPROACH_1_S * (c["max_alpha_rad"] - measured[sig.ALPHA])
    command[_C_Q] = min(clamp(rate, per_load * least, per_load * most), allowed)


@kernel
def roll_rate(gain, measured, command, lateral):
    """Command a roll rate from the stick or, the short way round, from the roll attitude error."""
    most = gain[laws.MAX_ROLL_RATE]
    if lateral == STICK:
        command[_C_P] = measured[sig.D_R] * most
    else:
        error = wrap(command[_C_PHI] - measured[sig.PHI])
        command[_C_P] = clamp(gain[laws.ROLL_ANGLE] * error, -most, most)


@kernel
def inner(param, state, gain, measured, command, source, law, fresh):
    """Turn rate, sideslip and airspeed errors into surfaces; ``fresh`` starts the integrators without a jump.

    On the ground the integrators stand still.
    """
    s, c = state[0], param[0]
    dt, g = c["dt"] if s["ground"] == 0 else 0.0, gain
    alpha = measured[sig.ALPHA]
    speed = max(s["airspeed"], SLOWEST)
    yaw = laws.turn_yaw_rate(measured[sig.PHI], measured[sig.THETA], speed) + command[_C_P] * math.tan(alpha)
    if law == Law.AUTOPILOT and c["lateral"] == PATH:
        turn = g[laws.HEADING_YAW] * wrap(command[_C_PSI] - measured[sig.PSI])
        yaw += clamp(turn, -c["max_yaw_correction_rad_s"], c["max_yaw_correction_rad_s"])
    p = measured[sig.P] - command[_C_P]
    r = measured[sig.R] - yaw
    beta = measured[sig.BETA] - command[_C_BETA]

    sensor = backup.needed(source, param)
    if sensor != backup.NOT_NEEDED:
        backup.elevator(sensor, law, param, state, gain, measured, command)
    else:
        q = measured[sig.Q] - command[_C_Q]
        proportional = g[laws.ELEVATOR_ALPHA] * (alpha - g[laws.TRIM_ALPHA]) + g[laws.ELEVATOR_Q] * q
        change = -dt * g[laws.ELEVATOR_INTEGRAL] * q
        over = fresh or s["backup"] != backup.NOT_NEEDED
        s["elevator_integral"] = move(s["elevator_integral"], change, proportional, 0, c, s["surface"], over)
        s["backup"] = backup.NOT_NEEDED

    proportional = g[laws.AILERON_P] * p
    change = -dt * g[laws.AILERON_INTEGRAL] * p
    s["aileron_integral"] = move(s["aileron_integral"], change, proportional, 1, c, s["surface"], fresh)

    proportional = g[laws.RUDDER_BETA] * beta + g[laws.RUDDER_R] * r
    proportional -= g[laws.RUDDER_COMMAND] * command[_C_BETA]
    change = -dt * g[laws.RUDDER_INTEGRAL] * beta
    s["rudder_integral"] = move(s["rudder_integral"], change, proportional, 2, c, s["surface"], fresh)

    if law == Law.AUTOPILOT and c["speed"] == 1 and source[sig.Q_BAR] != Source.DEGRADED:
        error = s["airspeed"] - command[_C_SPEED]
        proportional = g[laws.THROTTLE_SPEED] * error
        change = -dt * g[laws.THROTTLE_INTEGRAL] * error
        s["throttle_integral"] = move(s["throttle_integral"], change, proportional, 3, c, s["surface"], fresh)
