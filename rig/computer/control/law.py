"""One frame of the control law: signals in, outer loops, inner loops, surfaces out."""

from __future__ import annotations

import math

from rig.computer.analytic.flight_path import SLOWEST, path_angle
from rig.computer.control import backup_law as backup
from rig.computer.control import degraded, laws, modes
from rig.computer.control.law_state import C_BETA, C_EAS, C_GAMMA, C_P, C_PRESSURE_ALTITUDE, C_Q, C_SPEED
from rig.computer.control.laws import move
from rig.computer.control.modes import AIRSPEED
from rig.computer.control.source import select
from rig.computer.fdi.monitor import monitor_pitch_angle
from rig.computer.gain_schedule import look_up
from rig.core.frame import AUTOPILOT_COMMANDS, COMMANDS, DISCRETE_INDEX, SURFACES, Law, S, Source, sig
from rig.core.kernels import kernel
from rig.core.units.atmosphere import equivalent_airspeed, mach_number, pressure_altitude, temperature, true_airspeed
from rig.core.units.constants import GRAVITY

_ENGAGED, _WHEELS, _GEAR = (DISCRETE_INDEX[name] for name in ("autopilot_engaged", "weight_on_wheels", "gear_down"))
_AUTOPILOT_COMMANDS, _SURFACES, _COMMANDS = len(AUTOPILOT_COMMANDS), len(SURFACES), len(COMMANDS)


@kernel
def control_law(bus, fcc, data):
    """Fly one frame: signals to surfaces.

    bus, fcc : the row's BUS and FCC records; reads autopilot_command, inertial, voted, level, reference,
               reference_usable, discrete_voted; writes source, command, surface, law, estimate, trust, sensor_fault
    data : ControlData
    A signal that is not finite keeps its last value; before the first one the surfaces stay at trim.
    """
    s = data.state[0]
    param, state, gain = data.param, data.state, data.gain
    law = Law.AUTOPILOT if fcc["discrete_voted"][_ENGAGED] == 1 else Law.STICK
    source, measured, command = fcc["source"], s["measured"], s["command"]
    keep_command(bus["autopilot_command"], state)
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
        lifted = on_ground(fcc["discrete_voted"], state)
        filter_slow(param, state, measured, command, s["started"] == 0)
        look_up(data.pressures, data.table, s["schedule_pressure"], gain)
        if fresh or law == Law.STICK:
            capture(state, gain, measured, command)
        elif lifted:
            begin_path(state, gain, measured)
        degraded.follow(param, state)
        if lost == 0 and s["ground"] == 0:
            degraded.learn(param, state, gain, command)
        modes.outer(param, state, gain, measured, command, law)
        inner(param, state, gain, measured, command, source, law, fresh)
        s["started"], s["law"] = 1, law
    fcc["law"] = law if s["backup"] == backup.NOT_NEEDED else Law.BACKUP
    for i in range(_COMMANDS):
        fcc["command"][i] = s["command"][i]
    for i in range(_SURFACES):
        fcc["surface"][i] = s["surface"][i]


@kernel
def on_ground(voted, state):
    """Set ground and approach mode from the voted discretes; return True if the aircraft has just left the ground."""
    s = state[0]
    before = s["ground"]
    s["ground"] = 1 if voted[_WHEELS] == 1 else 0
    s["approach"] = 1 if voted[_GEAR] == 1 else 0
    return before != 0 and s["ground"] == 0


@kernel
def keep_command(autopilot_command, state):
    """Keep every finite autopilot command."""
    kept = state[0]["autopilot_command"]
    for i in range(_AUTOPILOT_COMMANDS):
        if math.isfinite(autopilot_command[i]):
            kept[i] = autopilot_command[i]


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
    command[C_PRESSURE_ALTITUDE] = altitude
    command[C_EAS] = equivalent_airspeed(measured[sig.Q_BAR])
    command[C_SPEED] = true_airspeed(mach, temperature(altitude))
    command[C_GAMMA] = path_angle(measured[sig.THETA], measured[sig.PHI], measured[sig.ALPHA], measured[sig.BETA])


@kernel
def filter_slow(param, state, measured, command, first):
    """Filter dynamic pressure, airspeed and vertical motion; at the start take the sample itself."""
    s, c = state[0], param[0]
    speed, pressure, altitude = command[C_SPEED], measured[sig.Q_BAR], command[C_PRESSURE_ALTITUDE]
    laws.vertical_motion(altitude, vertical_acceleration(measured), c["climb_crossover_rad_s"], c["dt"], state)
    if first:
        s["airspeed"], s["schedule_pressure"] = speed, pressure
        s["altitude_estimate"], s["acceleration_error"] = altitude, 0.0
        s["climb_rate"] = speed * math.sin(command[C_GAMMA])
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
def inner(param, state, gain, measured, command, source, law, fresh):
    """Turn rate, sideslip and airspeed errors into surfaces; ``fresh`` starts the integrators without a jump.

    On the ground the integrators stand still.
    """
    s, c, g = state[0], param[0], gain
    dt, surface = c["dt"] if s["ground"] == 0 else 0.0, s["surface"]
    p = measured[sig.P] - command[C_P]
    r = measured[sig.R] - modes.yaw_rate(law, param, state, gain, measured, command)
    beta = measured[sig.BETA] - command[C_BETA]

    sensor = backup.needed(source, param)
    if sensor != backup.NOT_NEEDED:
        backup.elevator(sensor, law, param, state, gain, measured, command)
    else:
        q = measured[sig.Q] - command[C_Q]
        proportional = g[laws.ELEVATOR_ALPHA] * (measured[sig.ALPHA] - g[laws.TRIM_ALPHA]) + g[laws.ELEVATOR_Q] * q
        change = -dt * g[laws.ELEVATOR_INTEGRAL] * q
        over = fresh or s["backup"] != backup.NOT_NEEDED
        s["elevator_integral"] = move(s["elevator_integral"], change, proportional, 0, c, surface, over)
        s["backup"] = backup.NOT_NEEDED

    change = -dt * g[laws.AILERON_INTEGRAL] * p
    s["aileron_integral"] = move(s["aileron_integral"], change, g[laws.AILERON_P] * p, 1, c, surface, fresh)

    proportional = g[laws.RUDDER_BETA] * beta + g[laws.RUDDER_R] * r
    proportional -= g[laws.RUDDER_COMMAND] * command[C_BETA]
    change = -dt * g[laws.RUDDER_INTEGRAL] * beta
    s["rudder_integral"] = move(s["rudder_integral"], change, proportional, 2, c, surface, fresh)

    if law == Law.AUTOPILOT and c["speed"] == AIRSPEED and source[sig.Q_BAR] != Source.DEGRADED:
        error = s["airspeed"] - command[C_SPEED]
        change, proportional = -dt * g[laws.THROTTLE_INTEGRAL] * error, g[laws.THROTTLE_SPEED] * error
        s["throttle_integral"] = move(s["throttle_integral"], change, proportional, 3, c, surface, fresh)
