"""The modes of the control law: what each axis follows, one row each, and the outer loops that make rates of them.

To add one: its row, its kernel and a branch in ``command_pitch`` or ``command_bank``.  A new setting is a field
of autopilot.Config, which kernels find in ``param``.  Kernels compare a mode by its place in its table.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from rig.computer.analytic.flight_path import SLOWEST
from rig.computer.control import laws
from rig.computer.control.law_state import C_ALTITUDE, C_BETA, C_P, C_PHI, C_PSI, C_Q, C_SPEED, C_THETA
from rig.computer.fdi.monitor import monitor_pitch_angle
from rig.core.frame import Law, sig
from rig.core.kernels import clamp, kernel
from rig.core.units.angles import wrap
from rig.core.units.constants import GRAVITY, TWO_PI

_BRAKING: Final = 0.3  # share of the allowed load factor change that a change of altitude plans with
_ALPHA_APPROACH_1_S: Final = 2.0  # pitch rate allowed per angle left to the alpha limit


class Mode(NamedTuple):
    """One mode; the keys of ``[control]`` name it."""

    name: str
    description: str
    limits: tuple[str, ...] = ()  # settings of [control] that bound it
    kernel: Any = None  # that commands the attitude, or tests a sensor; None: nothing beyond stick or autopilot command
    tested: tuple[str, ...] = ()  # signals whose common faults it finds by itself: the manager only reports them


@kernel
def hold_altitude(param, state, gain, measured, command):
    """Command the pitch attitude that brings the aircraft to the altitude commanded, along a smooth reference."""
    s, c = state[0], param[0]
    speed, steepest = max(s["airspeed"], SLOWEST), c["max_climb_angle_rad"]
    acceleration = _BRAKING * c["max_load_factor_change"] * GRAVITY
    capture_gain = 0.5 * gain[laws.PATH_ALTITUDE] / gain[laws.PATH_CLIMB]
    highest = speed * math.sin(steepest)
    laws.approach(command[C_ALTITUDE], capture_gain, highest, acceleration, c["dt"], state)
    command[C_THETA] = laws.path_pitch(measured[sig.THETA], speed, steepest, gain, c["dt"], state)


@kernel
def hold_roll(param, state, command):
    """Keep the roll attitude commanded; with the gear down within its bank."""
    s, bank = state[0], param[0]["gear_max_bank_rad"]
    if s["approach"] != 0:
        command[C_PHI] = clamp(command[C_PHI], -bank, bank)


@kernel
def hold_heading(param, state, gain, measured, command):
    """Command the roll attitude that turns to the heading commanded."""
    s, c = state[0], param[0]
    bank = c["max_bank_rad"] if s["approach"] == 0 else c["gear_max_bank_rad"]
    error = command[C_PSI] - measured[sig.PSI]
    command[C_PHI] = laws.bank_for_heading(error, gain[laws.HEADING], max(s["airspeed"], SLOWEST), bank)


VERTICAL: Final = (
    Mode("stick", "stick to load factor", ("gear_down_min_load_factor", "gear_down_max_load_factor")),
    Mode("pitch", "pitch attitude", ("max_load_factor_change",)),
    Mode("altitude", "altitude", ("max_load_factor_change", "max_climb_angle_rad"), hold_altitude),
)
LATERAL: Final = (
    Mode("stick", "stick to roll rate"),
    Mode("roll", "roll attitude", ("gear_down_max_bank_rad",), hold_roll),
    Mode("heading", "heading", ("max_bank_rad", "gear_down_max_bank_rad", "max_yaw_correction_rad_s"), hold_heading),
)
SPEED: Final = (Mode("off", "throttle stays"), Mode("airspeed", "true airspeed by throttle"))
LAWS: Final = (
    Mode("autopilot", "sensors as voted"),
    Mode(
        "fault-tolerant",
        "pitch-angle sensor tested, its estimate flown while it is faulty",
        kernel=monitor_pitch_angle,
        tested=("pitch_angle",),
    ),
)
STICK, PITCH, ALTITUDE = range(len(VERTICAL))
_, ROLL, HEADING = range(len(LATERAL))
OFF, AIRSPEED = range(len(SPEED))


def names(modes: tuple[Mode, ...]) -> tuple[str, ...]:
    """Return the names of a table, in its order: a mode's number is its place."""
    return tuple(mode.name for mode in modes)


if TYPE_CHECKING:
    Vertical = Lateral = Speed = LawName = str
else:
    Vertical, Lateral, Speed, LawName = (Literal[names(modes)] for modes in (VERTICAL, LATERAL, SPEED, LAWS))


@kernel
def command_pitch(vertical, param, state, gain, measured, command):
    """Command the pitch attitude by the vertical mode; ``command`` (C,) has the autopilot commands."""
    if vertical == ALTITUDE:
        hold_altitude(param, state, gain, measured, command)


@kernel
def command_bank(lateral, param, state, gain, measured, command):
    """Command the roll attitude by the lateral mode; ``command`` (C,) has the autopilot commands."""
    if lateral == HEADING:
        hold_heading(param, state, gain, measured, command)
    else:
        hold_roll(param, state, command)


@kernel
def yaw_rate(law, param, state, gain, measured, command):
    """Return the yaw rate [rad/s] of the commanded turn; while a heading is held the rudder helps towards it."""
    most, phi, theta = param[0]["max_yaw_correction_rad_s"], measured[sig.PHI], measured[sig.THETA]
    yaw = laws.turn_yaw_rate(phi, theta, max(state[0]["airspeed"], SLOWEST))
    yaw += command[C_P] * math.tan(measured[sig.ALPHA])
    if law == Law.AUTOPILOT and param[0]["lateral"] == HEADING:
        yaw += clamp(gain[laws.HEADING_YAW] * wrap(command[C_PSI] - measured[sig.PSI]), -most, most)
    return yaw


@kernel
def outer(param, state, gain, measured, command, law):
    """Turn autopilot commands or sticks into pitch rate, roll rate and sideslip commands.

    On the ground the autopilot's pitch and roll attitude commands stay as they are.
    """
    s, c = state[0], param[0]
    held_pitch, held_roll = command[C_THETA], command[C_PHI]
    command[C_THETA], command[C_PHI], command[C_PSI] = s["pitch_angle"], s["roll_angle"], s["heading"]
    command[C_ALTITUDE], command[C_SPEED] = s["altitude"], s["held_airspeed"]
    vertical, lateral = STICK, STICK
    if law == Law.AUTOPILOT:
        vertical, lateral = c["vertical"], c["lateral"]
        add_command(s["autopilot_command"], command)
        command_bank(lateral, param, state, gain, measured, command)
        if s["ground"] != 0 and s["started"] != 0:
            command[C_THETA], command[C_PHI] = held_pitch, held_roll
        else:
            command_pitch(vertical, param, state, gain, measured, command)
    pitch_rate(vertical, param, state, gain, measured, command)
    roll_rate(lateral, state, gain, measured, command)
    command[C_BETA] = -measured[sig.D_Y] * gain[laws.MAX_SIDESLIP]


@kernel
def add_command(autopilot_command, command):
    """Add the autopilot commands, in the order of frame.AUTOPILOT_COMMANDS, to what is held."""
    command[C_THETA] += autopilot_command[0]
    command[C_PHI] = wrap(command[C_PHI] + autopilot_command[1])
    command[C_ALTITUDE] += autopilot_command[2]
    command[C_PSI] = (command[C_PSI] + autopilot_command[3]) % TWO_PI
    command[C_SPEED] += autopilot_command[4]


@kernel
def pitch_rate(vertical, param, state, gain, measured, command):
    """Command a pitch rate from the stick or the pitch attitude error, within load factor and alpha."""
    s, c = state[0], param[0]
    speed = max(s["airspeed"], SLOWEST)
    per_load = GRAVITY / speed
    most, least = c["max_load_factor"] - 1.0, c["min_load_factor"] - 1.0
    if s["approach"] != 0:
        most, least = c["gear_max_load_factor"] - 1.0, c["gear_min_load_factor"] - 1.0
    if vertical == STICK:
        stick = measured[sig.D_P]
        rate = per_load * (stick * most if stick > 0.0 else -stick * least)
    else:
        limit = per_load * c["max_load_factor_change"]
        rate = clamp(gain[laws.PITCH_ANGLE] * (command[C_THETA] - measured[sig.THETA]), -limit, limit)
    rate += laws.turn_pitch_rate(measured[sig.PHI], measured[sig.THETA], speed)
    allowed = _ALPHA_APPROACH_1_S * (c["max_alpha_rad"] - measured[sig.ALPHA])
    command[C_Q] = min(clamp(rate, per_load * least, per_load * most), allowed)


@kernel
def roll_rate(lateral, state, gain, measured, command):
    """Command a roll rate from the stick or, the short way round, from the roll attitude error."""
    most, phi, theta = gain[laws.MAX_ROLL_RATE], measured[sig.PHI], measured[sig.THETA]
    if lateral == STICK:
        command[C_P] = measured[sig.D_R] * most + 0.0  # no negative zero
        return
    command[C_P] = clamp(gain[laws.ROLL_ANGLE] * wrap(command[C_PHI] - phi), -most, most)
    command[C_P] += laws.turn_roll_rate(phi, theta, max(state[0]["airspeed"], SLOWEST))
