"""JSBSim's numbers as the true row of a frame: SI units, the accelerometers' place, the end of a flight.

Everything is of one instant, the frame's: JSBSim moves the aircraft first, then computes winds,
flow, forces and angular accelerations from the new state.  Its own ``accelerations/N*`` are a
step older, so load factors come from the forces.
"""

from __future__ import annotations

from math import cos, inf, isfinite, pi, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import DISCRETE_INDEX, FLIGHT_INDEX, Block, End, sig
from rig.core.kernels import kernel
from rig.core.settings import record
from rig.core.units.constants import GRAVITY, TWO_PI
from rig.world.plant.airframe import Airframe, Limits, Position
from rig.world.plant.imperial import METRES_PER_FOOT, PASCALS_PER_PSF

# What is read of JSBSim each frame: our name and its property, in this order.  The four surface
# positions follow; their properties depend on the aircraft.
READ: Final = {
    "p_rad_s": "velocities/p-rad_sec",
    "q_rad_s": "velocities/q-rad_sec",
    "r_rad_s": "velocities/r-rad_sec",
    "p_dot_rad_s2": "accelerations/pdot-rad_sec2",
    "q_dot_rad_s2": "accelerations/qdot-rad_sec2",
    "r_dot_rad_s2": "accelerations/rdot-rad_sec2",
    "force_x_lbf": "forces/fbx-total-lbs",  # without weight
    "force_y_lbf": "forces/fby-total-lbs",
    "force_z_lbf": "forces/fbz-total-lbs",
    "alpha_rad": "aero/alpha-rad",
    "beta_rad": "aero/beta-rad",
    "static_pressure_psf": "atmosphere/P-psf",
    "dynamic_pressure_psf": "aero/qbar-psf",
    "theta_rad": "attitude/theta-rad",
    "phi_rad": "attitude/phi-rad",
    "psi_rad": "attitude/psi-rad",
    "altitude_ft": "position/h-sl-ft",
    "height_ft": "position/h-agl-ft",
    "latitude_rad": "position/lat-geod-rad",
    "longitude_rad": "position/long-gc-rad",
    "true_airspeed_fps": "velocities/vt-fps",
    "mach": "velocities/mach",
    "velocity_north_fps": "velocities/v-north-fps",
    "velocity_east_fps": "velocities/v-east-fps",
    "velocity_down_fps": "velocities/v-down-fps",
    "wheels_on_ground": "gear/wow",
    "gear_position": "gear/gear-pos-norm",
    "ground_force_lbf": "forces/fbz-gear-lbs",
}
POSITIONS: Final = ("elevator_rad", "aileron_rad", "rudder_rad", "throttle")
# The same of what stands still in a flight with frozen fuel through air that does not change: read once then.
SLOW: Final = {
    "mass_slug": "inertia/mass-slugs",
    "wind_north_fps": "atmosphere/total-wind-north-fps",
    "wind_east_fps": "atmosphere/total-wind-east-fps",
    "wind_down_fps": "atmosphere/total-wind-down-fps",
}
RAW: Final = np.dtype([(name, "f8") for name in (*READ, *POSITIONS, *SLOW)])

# What is constant in a flight, as one record for the kernel.
_PLACE: Final = ("start_latitude_rad", "start_longitude_rad", "north_m_per_rad", "east_m_per_rad")
_ACCELEROMETER: Final = tuple(f"accelerometer_{name}" for name in Position.model_fields)
FIXED: Final = np.dtype([(name, "f8") for name in (*_ACCELEROMETER, *Limits.model_fields, *_PLACE)])

_WHEELS, _GEAR = DISCRETE_INDEX["weight_on_wheels"], DISCRETE_INDEX["gear_down"]
_ALTITUDE, _NORTH = FLIGHT_INDEX["altitude_m"], FLIGHT_INDEX["north_m"]
_LATITUDE, _AIRSPEED = FLIGHT_INDEX["latitude_rad"], FLIGHT_INDEX["true_airspeed_m_s"]
_VELOCITY, _QUATERNION = FLIGHT_INDEX["velocity_north_m_s"], FLIGHT_INDEX["quaternion_w"]
_WIND, _SURFACE = FLIGHT_INDEX["wind_north_m_s"], FLIGHT_INDEX["elevator_rad"]
_FORCE = FLIGHT_INDEX["specific_force_forward_m_s2"]


def fixed(airframe: Airframe, latitude_rad: float, longitude_rad: float) -> NDArray[Any]:
    """Return the record of constants, shape (1,), for a flight that starts at this place.

    North and east are counted along the WGS 84 ellipsoid's radii at the start, as on a flat map.
    """
    flattening = 1.0 / 298.257223563
    eccentricity2 = flattening * (2.0 - flattening)
    w2 = 1.0 - eccentricity2 * sin(latitude_rad) ** 2
    return record(
        FIXED,
        **{f"accelerometer_{axis}": value for axis, value in airframe.accelerometer},
        **{name: inf if limit is None else limit for name, limit in airframe.limits},
        start_latitude_rad=latitude_rad,
        start_longitude_rad=longitude_rad,
        north_m_per_rad=6_378_137.0 * (1.0 - eccentricity2) / w2**1.5,
        east_m_per_rad=6_378_137.0 / w2**0.5 * cos(latitude_rad),
    )


@kernel
def write_row(block: Block, k: int, raw: NDArray[Any], constants: NDArray[Any]) -> int:
    """Fill truth (but the sticks), flight, discretes and end of row k; returns the end code.

    raw       : (1,) RAW, JSBSim's units
    constants : (1,) FIXED, SI
    Never raises; NaN anywhere ends the flight as NOT_FINITE.
    """
    row, now, fixed = block[k], raw[0], constants[0]
    truth, flight = row["truth"], row["flight"]
    _motion(truth, flight, now, fixed)
    # Of the flow, wind and turbulence included; the dynamic pressure is 0.5 rho V^2.
    truth[sig.ALPHA], truth[sig.BETA] = now["alpha_rad"], now["beta_rad"]
    truth[sig.P_S] = now["static_pressure_psf"] * PASCALS_PER_PSF
    truth[sig.Q_BAR] = now["dynamic_pressure_psf"] * PASCALS_PER_PSF
    _attitude(truth, flight, now)
    _condition(flight, now, fixed)
    row["discrete_truth"][_WHEELS] = 1 if now["wheels_on_ground"] > 0.5 else 0
    row["discrete_truth"][_GEAR] = 1 if now["gear_position"] > 0.5 else 0
    code = _end(truth, flight, now["ground_force_lbf"], fixed)
    row["end"] = code
    return code.value


@kernel
def _motion(truth: NDArray[np.float64], flight: NDArray[np.float64], now: Any, fixed: Any) -> None:
    """Write body rates, specific force F / m at the centre of gravity, load factors at the accelerometers.

        f(r) = F / m + w_dot x r + w x (w x r)

    F : all forces but weight; r : from the centre of gravity; w : rates relative to the Earth.
    n_x forward, n_y right, n_z up, so that level flight reads 0, 0, +1.
    """
    p, q, r = now["p_rad_s"], now["q_rad_s"], now["r_rad_s"]
    p_dot, q_dot, r_dot = now["p_dot_rad_s2"], now["q_dot_rad_s2"], now["r_dot_rad_s2"]
    x, y, z = fixed["accelerometer_x_m"], fixed["accelerometer_y_m"], fixed["accelerometer_z_m"]
    scale = METRES_PER_FOOT / now["mass_slug"]
    along = p * x + q * y + r * z  # w x (w x r) = w (w . r) - r (w . w)
    square = p * p + q * q + r * r
    forward, right, down = now["force_x_lbf"] * scale, now["force_y_lbf"] * scale, now["force_z_lbf"] * scale
    flight[_FORCE], flight[_FORCE + 1], flight[_FORCE + 2] = forward, right, down
    f_x = forward + q_dot * z - r_dot * y + p * along - x * square
    f_y = right + r_dot * x - p_dot * z + q * along - y * square
    f_z = down + p_dot * y - q_dot * x + r * along - z * square
    truth[sig.P], truth[sig.Q], truth[sig.R] = p, q, r
    truth[sig.N_X], truth[sig.N_Y] = f_x / GRAVITY, f_y / GRAVITY
    truth[sig.N_Z] = -f_z / GRAVITY


@kernel
def _attitude(truth: NDArray[np.float64], flight: NDArray[np.float64], now: Any) -> None:
    """Write roll in (-pi, pi], heading in [0, 2 pi), and the quaternion (w >= 0) from body to north-east-down."""
    theta, phi, psi = now["theta_rad"], now["phi_rad"], now["psi_rad"]
    if phi > pi:
        phi -= TWO_PI
    if phi <= -pi:
        phi += TWO_PI
    if psi < 0.0:
        psi += TWO_PI
    if psi >= TWO_PI:
        psi -= TWO_PI
    truth[sig.THETA], truth[sig.PHI], truth[sig.PSI] = theta, phi, psi
    c_t, s_t = cos(0.5 * theta), sin(0.5 * theta)
    c_p, s_p = cos(0.5 * phi), sin(0.5 * phi)
    c_y, s_y = cos(0.5 * psi), sin(0.5 * psi)
    w = c_p * c_t * c_y + s_p * s_t * s_y
    sign = -1.0 if w < 0.0 else 1.0  # of the two that mean the same turn, so that north is no jump
    flight[_QUATERNION] = sign * w
    flight[_QUATERNION + 1] = sign * (s_p * c_t * c_y - c_p * s_t * s_y)
    flight[_QUATERNION + 2] = sign * (c_p * s_t * c_y + s_p * c_t * s_y)
    flight[_QUATERNION + 3] = sign * (c_p * c_t * s_y - s_p * s_t * c_y)


@kernel
def _condition(flight: NDArray[np.float64], now: Any, fixed: Any) -> None:
    """Write position, speeds, the wind around the aircraft and the positions of its surfaces."""
    flight[_ALTITUDE] = now["altitude_ft"] * METRES_PER_FOOT
    flight[_ALTITUDE + 1] = now["height_ft"] * METRES_PER_FOOT
    latitude, longitude = now["latitude_rad"], now["longitude_rad"]
    flight[_NORTH] = (latitude - fixed["start_latitude_rad"]) * fixed["north_m_per_rad"]
    flight[_NORTH + 1] = (longitude - fixed["start_longitude_rad"]) * fixed["east_m_per_rad"]
    flight[_LATITUDE] = latitude
    flight[_LATITUDE + 1] = longitude
    flight[_AIRSPEED] = now["true_airspeed_fps"] * METRES_PER_FOOT
    flight[_AIRSPEED + 1] = now["mach"]
    flight[_VELOCITY] = now["velocity_north_fps"] * METRES_PER_FOOT
    flight[_VELOCITY + 1] = now["velocity_east_fps"] * METRES_PER_FOOT
    flight[_VELOCITY + 2] = now["velocity_down_fps"] * METRES_PER_FOOT
    flight[_WIND] = now["wind_north_fps"] * METRES_PER_FOOT
    flight[_WIND + 1] = now["wind_east_fps"] * METRES_PER_FOOT
    flight[_WIND + 2] = now["wind_down_fps"] * METRES_PER_FOOT
    flight[_SURFACE] = now["elevator_rad"]
    flight[_SURFACE + 1] = now["aileron_rad"]
    flight[_SURFACE + 2] = now["rudder_rad"]
    flight[_SURFACE + 3] = now["throttle"]


@kernel
def _end(truth: NDArray[np.float64], flight: NDArray[np.float64], ground_force: float, limits: Any) -> End:
    """Return why the flight ends with this row, the first reason in the order of frame.End; 0: it goes on."""
    for value in truth:
        if not isfinite(value):
            return End.NOT_FINITE
    for value in flight:
        if not isfinite(value):
            return End.NOT_FINITE
    if flight[_ALTITUDE + 1] <= 0.0 or ground_force != 0.0:
        return End.GROUND_CONTACT
    alpha, n_z = truth[sig.ALPHA], truth[sig.N_Z]
    if alpha < limits["angle_of_attack_min_rad"] or alpha > limits["angle_of_attack_max_rad"]:
        return End.DEPARTURE_ANGLE_OF_ATTACK
    if abs(truth[sig.BETA]) > limits["sideslip_max_rad"]:
        return End.DEPARTURE_SIDESLIP
    if n_z < limits["load_factor_min"] or n_z > limits["load_factor_max"]:
        return End.DEPARTURE_LOAD_FACTOR
    if abs(truth[sig.THETA]) > limits["pitch_angle_max_rad"] or abs(truth[sig.PHI]) > limits["roll_angle_max_rad"]:
        return End.DEPARTURE_ATTITUDE
    if max(abs(truth[sig.P]), abs(truth[sig.Q]), abs(truth[sig.R])) > limits["body_rate_max_rad_s"]:
        return End.DEPARTURE_RATE
    return End.FLYING
