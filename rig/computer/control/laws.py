"""The control law as kernels: outer loops, inner loops.

    altitude, heading, airspeed -> pitch and roll attitude -> pitch and roll rate -> surfaces
    stick ------------------------------------------------^

All angles in rad, body rates in rad/s.  Every inner loop is a proportional state feedback and an
integrator ``w`` that is a surface position itself, so a change of gains or of modes never makes it jump.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.control.gains_file import COLUMNS
from rig.core.kernels import clamp, kernel
from rig.core.units.angles import wrap
from rig.core.units.constants import GRAVITY

# The places of the gain table's columns: inner loops, outer loops, limits, load factor, short period, roll and yaw.
(
    TRIM_ALPHA, ELEVATOR_ALPHA, ELEVATOR_Q, ELEVATOR_INTEGRAL, AILERON_P, AILERON_INTEGRAL,
    RUDDER_BETA, RUDDER_R, RUDDER_INTEGRAL, RUDDER_COMMAND, THROTTLE_SPEED, THROTTLE_INTEGRAL,
    PITCH_ANGLE, ROLL_ANGLE, PATH_PITCH, PATH_CLIMB, PATH_ALTITUDE, PATH_INTEGRAL, HEADING, HEADING_YAW,
    MAX_ROLL_RATE, MAX_SIDESLIP, LIFT_SLOPE, LOAD_ALPHA, LOAD_Q, LOAD_ELEVATOR,
    ALPHA_ALPHA, ALPHA_Q, ALPHA_ELEVATOR, Q_ALPHA, Q_Q, Q_ELEVATOR, P_BETA, P_P, P_AILERON, R_BETA, R_R, R_RUDDER,
) = range(len(COLUMNS) - 10)  # fmt: skip
BACKUP_LOAD: Final = COLUMNS.index("backup_load_feedback_alpha")  # the first of five
BACKUP_ALPHA: Final = COLUMNS.index("backup_alpha_feedback_alpha")

_STEEP: Final = 0.5  # cosine of the bank up to which a level turn is made up for in full (60 degrees)


@kernel
def turn_pitch_rate(phi, theta, airspeed):
    """Return the pitch rate of a level turn at bank ``phi``: q = (g / V) cos(theta) sin(phi)^2 / cos(phi).

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
    """Return the roll rate of a level turn about body axes that point up: p = -(g / V) tan(phi) sin(theta)."""
    return -GRAVITY / airspeed * math.sin(phi) / max(math.cos(phi), _STEEP) * math.sin(theta)


@kernel
def turn_yaw_rate(phi, theta, airspeed):
    """Return the yaw rate of a coordinated turn: r = (g / V) sin(phi) cos(theta)."""
    return GRAVITY / airspeed * math.sin(phi) * math.cos(theta)


@kernel
def bank_for_heading(error, gain, airspeed, max_bank):
    """Return the bank that turns the short way towards the heading ``error`` [rad] away: turn rate = gain * error."""
    return clamp(gain * wrap(error) * airspeed / GRAVITY, -max_bank, max_bank)


@kernel
def vertical_motion(altitude, acceleration, crossover, dt, state):
    """Estimate the climb rate from pressure altitude [m] and vertical acceleration [m/s2], each where it is good.

    A complementary filter of third order, all poles at ``crossover`` [rad/s]: below it the altitude
    counts, above it the acceleration; a constant error of the acceleration is estimated and taken off.
    state : altitude_estimate [m], climb_rate [m/s], acceleration_error [m/s2], in place
    """
    s = state[0]
    error = altitude - s["altitude_estimate"]
    rate = s["climb_rate"]
    s["acceleration_error"] += crossover**3 * error * dt
    s["climb_rate"] += (acceleration + s["acceleration_error"] + 3.0 * crossover**2 * error) * dt
    s["altitude_estimate"] += (rate + 3.0 * crossover * error) * dt


@kernel
def approach(target, gain, highest, acceleration, dt, state):
    """Move the altitude reference towards ``target`` [m] so smoothly that the loop behind it can follow.

    With d left to go, the rate is gain * d near the target and sqrt(2 a d - (a / gain)^2) farther out: a
    braking at ``acceleration`` a [m/s2].  The rate stays within ``highest`` [m/s] and changes by at most a.
    state : altitude_reference [m], altitude_rate [m/s], in place
    """
    s = state[0]
    left = target - s["altitude_reference"]
    wanted = gain * left
    if abs(wanted) * gain > acceleration:
        wanted = math.sqrt(2.0 * acceleration * abs(left) - (acceleration / gain) ** 2)
        wanted = wanted if left > 0.0 else -wanted
    wanted = clamp(wanted, -highest, highest)
    s["altitude_rate"] += clamp(wanted - s["altitude_rate"], -acceleration * dt, acceleration * dt)
    s["altitude_reference"] += s["altitude_rate"] * dt


@kernel
def path_pitch(theta, airspeed, steepest, gain, dt, state):
    """Return the pitch attitude that keeps the aircraft on its altitude reference, by state feedback.

        theta_c = w + g - K_pitch (theta - g) - K_climb (climb - g) + K_altitude (reference - altitude) / V

    with g the reference's climb angle and w the integral of the altitude error, a pitch attitude;
    w stands still while the asked climb is beyond ``steepest`` [rad].
    state : altitude_integral (w), in place
    """
    s = state[0]
    reference = s["altitude_rate"] / airspeed
    error = (s["altitude_reference"] - s["altitude_estimate"]) / airspeed
    climb = gain[PATH_ALTITUDE] * error - gain[PATH_CLIMB] * (s["climb_rate"] / airspeed - reference)
    if -steepest < climb < steepest:
        s["altitude_integral"] += gain[PATH_INTEGRAL] * error * dt
    climb = clamp(climb, -steepest, steepest)
    return s["altitude_integral"] + reference - gain[PATH_PITCH] * (theta - reference) + climb


@kernel
def integrate(integral, change, proportional, low, high):
    """Return the integrator after one frame; it never pushes the surface past a stop, nor further past it."""
    moved = integral + change
    position = moved - proportional
    if position > high and change > 0.0:
        return max(integral, high + proportional)
    if position < low and change < 0.0:
        return min(integral, low + proportional)
    return moved


@kernel
def move(integral, change, proportional, i, limits, surface, fresh):
    """Return the integrator of surface ``i``; set ``surface[i]`` = integral - proportional, within its stops.

    It holds while no channel moves the surface.  When ``fresh`` the surface stays and the integrator becomes what
    keeps it there.
    """
    if fresh:
        return surface[i] + proportional
    change = 0.0 if limits["still"][i] != 0 else change
    low, high = limits["low"][i], limits["high"][i]
    integral = integrate(integral, change, proportional, low, high)
    surface[i] = clamp(integral - proportional, low, high)
    return integral
