"""Compute the gains of one flight point from its bandwidths.

Inner loops are linear-quadratic regulators with integral action; one number a plane, the crossover, sets their weights.
The outer loops follow by separation of bandwidth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.computer.control.gains_file import Point
from rig.design import backup_design as backup
from rig.design.backup_design import Bandwidth, Sensor, regulator
from rig.design.loop_requirements import Case
from rig.design.loops import ACTUATORS, Plane
from rig.design.stability_margins import Matrix
from rig.world.plant.linearise import Linear


@dataclass(frozen=True)
class Shares:
    """The bandwidths of one plane, as shares: rate loop of the highest crossover, alpha gain, attitude loop.

    integral : crossover of the integral alone over the rate loop's; 0 if ``integral_share`` is enough
    airspeed : of the airspeed loop's crossover
    """

    rate: float
    attitude: float
    alpha: float
    altitude: float
    integral: float = 0.0
    airspeed: float = 1.0


def gains_at(case: Case, chosen: dict[Plane, Shares]) -> Point:
    """Return all gains of one flight point."""
    # The highest tried crossover of the rate loop [rad/s] is a share of the actuator's bandwidth.
    lags_s = {plane: getattr(case.airframe, actuators[0]).lag_s for plane, actuators in ACTUATORS.items()}
    crossover = {plane: chosen[plane].rate * (case.wanted.actuator_share / lags_s[plane]) for plane in ACTUATORS}
    wanted, linear, trim = case.wanted, case.linear, case.linear.trim
    share = max(wanted.integral_share, pitch_integral_share(linear, crossover["longitudinal"], chosen["longitudinal"]))
    elevator = longitudinal_gain(linear, crossover["longitudinal"], share)[0]
    pitch = chosen["longitudinal"].attitude * crossover["longitudinal"]
    path = path_gain(linear, pitch, chosen["longitudinal"].altitude * pitch)[0]
    airspeed = chosen["longitudinal"].airspeed * wanted.airspeed_crossover_rad_s
    throttle = airspeed / linear.longitudinal_b[0, 1]
    # The observers' model of the aircraft; the compensators of the standby law are designed after the rest.
    model: dict[str, Any] = {**_short_period(case), **backup.roll_and_yaw(linear.lateral_a, linear.lateral_b)}
    model |= backup.NONE
    return Point(
        name=case.point.name,
        dynamic_pressure_pa=trim.dynamic_pressure_pa,
        trim_airspeed_m_s=trim.airspeed_m_s,
        trim_alpha_rad=trim.alpha_rad,
        trim_theta_rad=trim.theta_rad,
        trim_elevator_rad=trim.elevator_rad,
        trim_throttle=trim.throttle,
        elevator_alpha=chosen["longitudinal"].alpha * elevator[0],
        elevator_pitch_rate_s=elevator[1],
        elevator_pitch_rate_integral=elevator[2],
        throttle_airspeed_s_m=throttle,
        throttle_airspeed_integral_1_m=throttle * airspeed / 5.0,
        pitch_angle_1_s=pitch,
        path_pitch=path[0],
        path_climb_angle=path[1],
        path_altitude_1_s=path[2],
        path_altitude_integral_1_s2=path[3],
        **_lateral(case, crossover["lateral"], chosen["lateral"]),
        **model,
    )


def _lateral(case: Case, crossover: float, chosen: Shares) -> dict[str, float]:
    """Return the gains on aileron and rudder, zero if these have no effect."""
    wanted, linear, airframe = case.wanted, case.linear, case.airframe
    aileron, rudder, command, attitude = np.zeros(2), np.zeros(3), 0.0, 0.0
    roll_rate = sideslip = math.inf  # the steady value at full deflection: six tenths of it, and three tenths
    if linear.rolls:
        a, b = linear.lateral_a, linear.lateral_b
        roll_rate = 0.6 * min(airframe.aileron.max_rad, -airframe.aileron.min_rad) * abs(b[1, 0] / a[1, 1])
        sideslip = 0.3 * min(airframe.rudder.max_rad, -airframe.rudder.min_rad) * abs(b[2, 1] / a[2, 0])
        share = max(wanted.integral_share, chosen.integral * -a[1, 1] / crossover)
        aileron = roll_gain(linear, crossover, share)[0]
        rudder = yaw_gain(linear, wanted.rudder_share * crossover, wanted.sideslip_share)[0]
        command = -a[2, 0] / b[2, 1]
        attitude = chosen.attitude * crossover
    turn = wanted.heading_share * attitude
    return {
        "aileron_roll_rate_s": aileron[0],
        "aileron_roll_rate_integral": aileron[1],
        "rudder_beta": rudder[0],
        "rudder_yaw_rate_s": rudder[1],
        "rudder_beta_integral_1_s": rudder[2],
        "rudder_sideslip_command": command,
        "roll_angle_1_s": attitude,
        "heading_1_s": turn,
        "heading_yaw_1_s": wanted.yaw_share * turn,
        "max_roll_rate_rad_s": min(roll_rate, wanted.envelope_share * airframe.limits.body_rate_max_rad_s),
        "max_sideslip_rad": min(sideslip, 0.5 * wanted.envelope_share * airframe.limits.sideslip_max_rad),
    }


def backup_gains(case: Case, sensor: Sensor, chosen: Bandwidth) -> dict[str, float]:
    """Return the gains of the standby law on one sensor."""
    a, b = case.linear.longitudinal_a[1:3, 1:3], case.linear.longitudinal_b[1:3, 0]
    return backup.compensator(a, b, _short_period(case), sensor, chosen)


def _short_period(case: Case) -> dict[str, float]:
    a, b = case.linear.longitudinal_a[1:3, 1:3], case.linear.longitudinal_b[1:3, 0]
    return backup.short_period(a, b, case.linear.trim.airspeed_m_s, case.airframe.accelerometer.x_m)


def pitch_integral_share(linear: Linear, crossover: float, chosen: Shares) -> float:
    """Return the share at which the integral alone crosses at ``chosen.integral`` of ``crossover`` [rad/s].

    If the airframe damps faster than the loop crosses, a regulator leaves pitch rate to the airframe, and only the
    integral makes it follow.  Its gain is share crossover^2 / M_elevator, the airframe's is the steady q / elevator.
    """
    a, b = linear.longitudinal_a[1:3, 1:3], linear.longitudinal_b[1:3, 0]
    rest = np.linalg.solve(-a, b)[1]
    return float(chosen.integral * abs(b[1] / rest) / crossover)


def longitudinal_gain(linear: Linear, crossover: float, integral_share: float) -> Matrix:
    """Return (1, 3) elevator gain on alpha, q and the integral of the q error.

    Weights: q 1, its integral (share * crossover)^2, elevator (M_elevator / crossover)^2; with these
    the ideal loop crosses near ``crossover`` [rad/s].
    """
    a, b = np.zeros((3, 3)), np.zeros((3, 1))
    a[:2, :2] = linear.longitudinal_a[1:3, 1:3]
    a[2, 1] = 1.0
    b[:2, 0] = linear.longitudinal_b[1:3, 0]
    q = np.diag([0.0, 1.0, (integral_share * crossover) ** 2])
    return regulator(a, b, q, np.array([[(b[1, 0] / crossover) ** 2]]))


def path_gain(linear: Linear, pitch: float, crossover: float) -> Matrix:
    """Return (1, 4) gains of the pitch attitude command on theta, climb angle, altitude / V and its integral.

    The attitude loop counts as a lag of 1 / ``pitch``, the path follows the nose at -Z_alpha.
    Weights: altitude / V 1, its integral (crossover / 8)^2, attitude command 1 / crossover^2.
    """
    follow = -linear.longitudinal_a[1, 1]
    a, b = np.zeros((4, 4)), np.array([[pitch], [0.0], [0.0], [0.0]])
    a[0, 0] = -pitch
    a[1, 0], a[1, 1] = follow, -follow
    a[2, 1] = a[3, 2] = 1.0
    q = np.diag([0.0, 0.0, 1.0, (crossover / 8.0) ** 2])
    return regulator(a, b, q, np.array([[1.0 / crossover**2]]))


def roll_gain(linear: Linear, crossover: float, integral_share: float) -> Matrix:
    """Return (1, 2) aileron gain on p and the integral of the p error, for the roll mode alone.

    Weights: p 1, its integral (share * crossover)^2, aileron (L_aileron / crossover)^2.
    """
    a = np.array([[linear.lateral_a[1, 1], 0.0], [1.0, 0.0]])
    b = np.array([[linear.lateral_b[1, 0]], [0.0]])
    q = np.diag([1.0, (integral_share * crossover) ** 2])
    return regulator(a, b, q, np.array([[(b[0, 0] / crossover) ** 2]]))


def yaw_gain(linear: Linear, crossover: float, sideslip_share: float) -> Matrix:
    """Return (1, 3) rudder gain on beta, r and the integral of the beta error, for the Dutch roll alone.

    Weights: r 1, integral of beta (share * crossover^2)^2, rudder (N_rudder / crossover)^2.  One
    regulator for both surfaces would cross-feed roll into the rudder: with the large and changing
    dihedral effect of a fighter that costs the Dutch roll its damping, and turbulence its heading.
    """
    a = np.zeros((3, 3))
    a[:2, :2] = linear.lateral_a[np.ix_((0, 2), (0, 2))]
    a[2, 0] = 1.0
    b = np.array([[linear.lateral_b[0, 1]], [linear.lateral_b[2, 1]], [0.0]])
    q = np.diag([0.0, 1.0, (sideslip_share * crossover**2) ** 2])
    return regulator(a, b, q, np.array([[(b[1, 0] / crossover) ** 2]]))
