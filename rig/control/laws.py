"""The control law as kernels: outer loops, inner loops, gain schedule.

    altitude, heading, airspeed -> pitch and roll attitude -> pitch and roll rate -> surfaces
    stick ------------------------------------------------^

All angles in rad, body rates in rad/s.  Every inner loop is a proportional state feedback and an
integrator ``w`` that is a surface position itself, so a change of gains or of modes never makes it jump.
"""

from __future__ import annotations

import math
from typing import Final

from rig.angles import wrap
from rig.control.airdata import GRAVITY
from rig.control.gains import COLUMNS
from rig.kernels import kernel

_COLUMNS: Final = len(COLUMNS)
(
    TRIM_ALPHA,
    ELEVATOR_ALPHA,
    ELEVATOR_Q,
    ELEVATOR_INTEGRAL,
    AILERON_BETA,
    AILERON_P,
    AILERON_R,
    AILERON_P_INTEGRAL,
    AILERON_BETA_INTEGRAL,
    RUDDER_BETA,
    RUDDER_P,
    RUDDER_R,
    RUDDER_P_INTEGRAL,
    RUDDER_BETA_INTEGRAL,
    THROTTLE_SPEED,
    THROTTLE_INTEGRAL,
    PITCH_ANGLE,
    ROLL_ANGLE,
    ALTITUDE,
    ALTITUDE_INTEGRAL,
    HEADING,
    NOSE_FILTER,
    MAX_ROLL_RATE,
    MAX_SIDESLIP,
) = range(_COLUMNS)

_STEEP: Final = 0.5  # cosine of the bank up to which a level turn is made up for in full (60 degrees)


@kernel
def clamp(x, low, high):
    """``x`` within [low, high]."""
    if x < low:
        return low
    if x > high:
        return high
    return x


@kernel
def schedule(pressures, table, dynamic_pressure, gain):
    """Gains at ``dynamic_pressure`` [Pa]: linear between the points, constant beyond the ends.

    pressures : (P,) rising; table : (P, G); gain : (G,), out
    """
    last = len(pressures) - 1
    low = 0
    while low < last - 1 and pressures[low + 1] <= dynamic_pressure:
        low += 1
    high = min(low + 1, last)
    share = 0.0
    if high > low:
        share = (dynamic_pressure - pressures[low]) / (pressures[high] - pressures[low])
        share = clamp(share, 0.0, 1.0)
    for i in range(_COLUMNS):
        gain[i] = table[low, i] + share * (table[high, i] - table[low, i])


@kernel
def turn_pitch_rate(phi, theta, airspeed):
    """Pitch rate of a level turn at bank ``phi``: q = (g / V) cos(theta) sin(phi)^2 / cos(phi).

    Beyond 60 degrees of bank no level turn is assumed: the value fades to zero at 90 degrees.
    """
    cosine = math.cos(phi)
    steep = _STEEP
    if cosine < steep:
        load = (1.0 - steep * steep) / steep * max(cosine, 0.0) / steep
    else:
        load = (1.0 - cosine * cosine) / cosine
    return GRAVITY / airspeed * math.cos(theta) * load


@kernel
def turn_roll_rate(phi, theta, airspeed):
    """Roll rate of a level turn about body axes that point up: p = -(g / V) tan(phi) sin(theta)."""
    return -GRAVITY / airspeed * math.sin(phi) / max(math.cos(phi), _STEEP) * math.sin(theta)


@kernel
def turn_yaw_rate(phi, theta, airspeed):
    """Yaw rate of a coordinated turn: r = (g / V) sin(phi) cos(theta)."""
    return GRAVITY / airspeed * math.sin(phi) * math.cos(theta)


@kernel
def bank_for_heading(error, gain, airspeed, max_bank):
    """Bank that turns the short way towards the heading ``error`` [rad] away: turn rate = gain * error."""
    return clamp(gain * wrap(error) * airspeed / GRAVITY, -max_bank, max_bank)


@kernel
def climb_rate(target, altitude, gain, integral_gain, highest, acceleration, dt, state):
    """Climb rate [m/s] that takes the aircraft to ``target`` [m] and keeps it there.

    A reference moves towards the target, within ``highest`` [m/s] and ``acceleration`` [m/s2]; the
    loop follows the reference, so that its integrator never sees the whole step.  Integrates only
    while the result is within ``highest``.
    state : altitude_reference [m], altitude_rate [m/s], altitude_integral [m/s], in place
    """
    s = state[0]
    wanted = clamp(gain * (target - s["altitude_reference"]), -highest, highest)
    rate = s["altitude_rate"] + clamp(wanted - s["altitude_rate"], -acceleration * dt, acceleration * dt)
    reference = s["altitude_reference"] + rate * dt
    error = reference - altitude
    integral = s["altitude_integral"] + integral_gain * error * dt
    climb = rate + gain * error + integral
    if climb > highest or climb < -highest:
        integral = s["altitude_integral"]
        climb = clamp(climb, -highest, highest)
    s["altitude_reference"], s["altitude_rate"], s["altitude_integral"] = reference, rate, integral
    return climb


@kernel
def integrate(integral, change, proportional, low, high):
    """The integrator after one frame; it stands still while it would push the surface further past a stop."""
    moved = integral + change
    position = moved - proportional
    if (position > high and change > 0.0) or (position < low and change < 0.0):
        return integral
    return moved
