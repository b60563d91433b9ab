"""The kernels of a linear aircraft: one exact step of its small motions, and its flight in full.

    x = [model's states, surface positions], deviations from trim;  x+ = F x + G c,  y = C x,  dy/dt = D x

c are the surface commands, held over a step.  y holds airspeed, flow angles, body rates, pitch and roll; from
it and its rate follow velocities, forces and place by the full equations of a rigid body's motion, so that
all sixteen signals belong to one flight.
"""

from __future__ import annotations

from math import cos, sin
from typing import Final

import numpy as np

from rig.core.frame import SURFACES
from rig.core.kernels import kernel
from rig.core.units.atmosphere import density, pressure, speed_of_sound
from rig.core.units.constants import GRAVITY
from rig.world.plant.airframe import OUTPUTS
from rig.world.plant.imperial import METRES_PER_FOOT, PASCALS_PER_PSF

_SURFACES: Final = len(SURFACES)
_OUTPUTS: Final = len(OUTPUTS)
NORTH, EAST, ALTITUDE, HEADING = range(4)  # of the place
PARAM: Final = np.dtype(
    [
        ("dt", "f8"),
        ("airspeed", "f8"),  # of trim
        ("pitch_angle", "f8"),
        ("surface", "f8", (_SURFACES,)),
        ("low", "f8", (_SURFACES,)),  # stops
        ("high", "f8", (_SURFACES,)),
        ("reach", "f8", (_SURFACES,)),  # rate limit times lag: a command farther off moves the surface no faster
    ]
)


@kernel
def move(x, new, command, place, f, g, param, raw):
    """Move ``x`` (n + 4,) one step under ``command`` (4,), absolute; ``new`` (n + 4,) is workspace.

    ``place`` (4,) goes half a step at the velocity of ``raw``; the other half is ``advance``, after ``evaluate``.
    """
    p, n = param[0], len(x)
    states = n - _SURFACES
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += f[i, j] * x[j]
        new[i] = total
    for s in range(_SURFACES):
        wanted = command[s]
        wanted = p["low"][s] if wanted < p["low"][s] else wanted
        wanted = p["high"][s] if wanted > p["high"][s] else wanted
        away, reach = wanted - p["surface"][s] - x[states + s], p["reach"][s]
        away = -reach if away < -reach else away
        away = reach if away > reach else away
        for i in range(n):
            new[i] += g[i, s] * (x[states + s] + away)
    for i in range(n):
        x[i] = new[i]
    advance(place, 0.5 * p["dt"], raw)


@kernel
def advance(place, dt, raw):
    """Move ``place`` on for ``dt`` at the velocity and the body rates of ``raw``."""
    now = raw[0]
    turn = now["q_rad_s"] * sin(now["phi_rad"]) + now["r_rad_s"] * cos(now["phi_rad"])
    place[NORTH] += dt * METRES_PER_FOOT * now["velocity_north_fps"]
    place[EAST] += dt * METRES_PER_FOOT * now["velocity_east_fps"]
    place[ALTITUDE] -= dt * METRES_PER_FOOT * now["velocity_down_fps"]
    place[HEADING] += dt * turn / max(cos(now["theta_rad"]), 1e-3)


@kernel
def blow(x, mean, gust, wind, place, jump):
    """Set the wind to ``mean`` and ``gust``: the flow changes with it at once, the flight path does not.

    mean, wind : (3,) north, east, down [m/s], wind in place; gust : (3,) along, across, down
    jump : (n, 3), what the model's states change by for each m/s along, across and down
    """
    c, s = cos(place[HEADING]), sin(place[HEADING])
    north = mean[0] + c * gust[0] - s * gust[1] - wind[0]
    east = mean[1] + s * gust[0] + c * gust[1] - wind[1]
    down = mean[2] + gust[2] - wind[2]
    wind[0], wind[1], wind[2] = wind[0] + north, wind[1] + east, wind[2] + down
    along, across = c * north + s * east, c * east - s * north
    for i in range(len(jump)):
        x[i] += jump[i, 0] * along + jump[i, 1] * across + jump[i, 2] * down


@kernel
def evaluate(x, place, wind, outputs, rates, workspace, param, raw):
    """Write ``raw`` (1,) truth.RAW of the state; wind : (3,) north, east, down [m/s]; workspace : (2, 8)."""
    p, now, y, dy = param[0], raw[0], workspace[0], workspace[1]
    for i in range(_OUTPUTS):
        y[i], dy[i] = 0.0, 0.0
        for j in range(len(x)):
            y[i] += outputs[i, j] * x[j]
            dy[i] += rates[i, j] * x[j]
    now["alpha_rad"], now["beta_rad"] = p["pitch_angle"] + y[1], y[4]
    now["p_rad_s"], now["q_rad_s"], now["r_rad_s"] = y[5], y[2], y[6]
    now["p_dot_rad_s2"], now["q_dot_rad_s2"], now["r_dot_rad_s2"] = dy[5], dy[2], dy[6]
    now["theta_rad"], now["phi_rad"], now["psi_rad"] = p["pitch_angle"] + y[3], y[7], place[HEADING]
    surfaces = len(x) - _SURFACES
    now["elevator_rad"] = p["surface"][0] + x[surfaces]
    now["aileron_rad"] = p["surface"][1] + x[surfaces + 1]
    now["rudder_rad"] = p["surface"][2] + x[surfaces + 2]
    now["throttle"] = p["surface"][3] + x[surfaces + 3]
    dynamics(p["airspeed"] + y[0], dy[0], dy[1], dy[4], wind, raw)
    air(p["airspeed"] + y[0], place[ALTITUDE], raw)
    now["altitude_ft"] = now["height_ft"] = place[ALTITUDE] / METRES_PER_FOOT


@kernel
def dynamics(speed, speed_rate, alpha_rate, beta_rate, wind, raw):
    """Write velocity over ground, and the force for each unit of mass that makes this motion.

        f = dv/dt + w x v - gravity,  v = V (cos a cos b, sin b, sin a cos b) in body axes

    The flow's rates are those of the model, which holds the air still: then v is the motion in space but for
    the wind's own speed, whose turning with the body axes is left out.
    """
    now = raw[0]
    p, q, r = now["p_rad_s"], now["q_rad_s"], now["r_rad_s"]
    ca, sa = cos(now["alpha_rad"]), sin(now["alpha_rad"])
    cb, sb = cos(now["beta_rad"]), sin(now["beta_rad"])
    ct, st = cos(now["theta_rad"]), sin(now["theta_rad"])
    cp, sp = cos(now["phi_rad"]), sin(now["phi_rad"])
    cy, sy = cos(now["psi_rad"]), sin(now["psi_rad"])
    u, v, w = speed * ca * cb, speed * sb, speed * sa * cb
    u_rate = speed_rate * ca * cb - speed * (sa * cb * alpha_rate + ca * sb * beta_rate)
    v_rate = speed_rate * sb + speed * cb * beta_rate
    w_rate = speed_rate * sa * cb + speed * (ca * cb * alpha_rate - sa * sb * beta_rate)
    now["mass_slug"] = 1.0  # so that force is acceleration, in ft/s2
    now["force_x_lbf"] = (u_rate + q * w - r * v + GRAVITY * st) / METRES_PER_FOOT
    now["force_y_lbf"] = (v_rate + r * u - p * w - GRAVITY * ct * sp) / METRES_PER_FOOT
    now["force_z_lbf"] = (w_rate + p * v - q * u - GRAVITY * ct * cp) / METRES_PER_FOOT
    north = ct * cy * u + (sp * st * cy - cp * sy) * v + (cp * st * cy + sp * sy) * w
    east = ct * sy * u + (sp * st * sy + cp * cy) * v + (cp * st * sy - sp * cy) * w
    down = -st * u + sp * ct * v + cp * ct * w
    now["velocity_north_fps"] = (north + wind[0]) / METRES_PER_FOOT
    now["velocity_east_fps"] = (east + wind[1]) / METRES_PER_FOOT
    now["velocity_down_fps"] = (down + wind[2]) / METRES_PER_FOOT
    now["wind_north_fps"], now["wind_east_fps"] = wind[0] / METRES_PER_FOOT, wind[1] / METRES_PER_FOOT
    now["wind_down_fps"] = wind[2] / METRES_PER_FOOT


@kernel
def air(speed, altitude, raw):
    """Write air data at ``speed`` [m/s] and ``altitude`` [m] in the standard atmosphere."""
    now, static = raw[0], pressure(altitude)
    now["static_pressure_psf"] = static / PASCALS_PER_PSF
    now["dynamic_pressure_psf"] = 0.5 * density(altitude) * speed * speed / PASCALS_PER_PSF
    now["true_airspeed_fps"] = speed / METRES_PER_FOOT
    now["mach"] = speed / speed_of_sound(altitude)
