"""The equations of motion that tie a signal to its partners.

Each kernel gives one reference from what references.py keeps of the votes (``st``, a STATE record), the
coefficients of the flight point (``c``, in the order of designed.COLUMNS) and, where the accelerometers' place
counts, the PARAM record ``p``.  Angles in rad, rates in rad/s, load factors in g, pressures in Pa.

n_w is the load factor across the flight path.
Source: Zhang 2023, section 7, for the pitch rate from the angle of attack; the others as in Etkin, Dynamics of
Atmospheric Flight.
"""

from __future__ import annotations

import math
from typing import Final

from rig.computer.analytic import flight_path
from rig.computer.analytic.designed import COLUMNS
from rig.computer.analytic.pitch_filter import begin, follow_path, learn_yaw_drift, predict
from rig.core.frame import INERTIAL, sig
from rig.core.kernels import kernel
from rig.core.units.angles import wrap
from rig.core.units.constants import GRAVITY

_FIRST_PITCH_RAD: Final = 0.05  # sigma of level flight as a first guess
_DRAWN_S: Final = 10.0  # longer than a slip, shorter than the gyros need to drift off
_THINNEST: Final = 200.0  # Pa; divisions by dynamic pressure take at least this
_NORTH: Final = INERTIAL.index("velocity_north_m_s")
_LIFT_SLOPE, _ZERO_LIFT, _GAIN = (
    COLUMNS.index(name) for name in ("lift_slope_1_pa", "zero_lift_alpha_rad", "pitch_rate_gain")
)
_ELEVATOR_ARM, _SIDE_SLOPE = COLUMNS.index("elevator_arm_m"), COLUMNS.index("side_slope_1_pa")
_ROLL_ARM, _YAW_ARM = COLUMNS.index("roll_arm_m"), COLUMNS.index("yaw_arm_m")


@kernel
def lift(c, st, alpha):
    """Return n_w that the wing gives at ``alpha``: q_bar lift_slope (alpha - zero_lift_alpha)."""
    return st["voted"][sig.Q_BAR] * c[_LIFT_SLOPE] * (alpha - c[_ZERO_LIFT])


@kernel
def turning_lift(c, st, speed):
    """Return n_w that pitching adds, and the tail with it: V / g (1 - gain) q - elevator_arm / g q_dot."""
    gain, arm = c[_GAIN], c[_ELEVATOR_ARM]
    return (speed * (1.0 - gain) * st["voted"][sig.Q] - arm * st["slope"][sig.Q]) / GRAVITY


@kernel
def pitch_rate(c, st, speed):
    """Return the pitch rate from the angle of attack (Zhang 2023, section 7): (s + Y) / k on alpha, with a second pole.

        q = (alpha_dot + (p cos alpha + r sin alpha) tan beta + g / (V cos beta) (n_w - n_g)) / k
        n_g = cos alpha cos theta cos phi + sin alpha sin theta

    n_w (alpha) is Y alpha and the trim; n_g is gravity along it, which makes a turn's pitch rate come out
    right; k is pitch_rate_gain.  A gust's alpha_dot is taken for pitching: that is its error.
    """
    voted = st["voted"]
    alpha, beta, theta = st["smooth"][sig.ALPHA], voted[sig.BETA], voted[sig.THETA]
    sin_alpha, cos_alpha = math.sin(alpha), math.cos(alpha)
    gravity = cos_alpha * math.cos(theta) * math.cos(voted[sig.PHI]) + sin_alpha * math.sin(theta)
    coupling = (voted[sig.P] * cos_alpha + voted[sig.R] * sin_alpha) * math.tan(beta)
    path = GRAVITY / (speed * math.cos(beta)) * (lift(c, st, alpha) - gravity)
    return (st["slope"][sig.ALPHA] + coupling + path) / c[_GAIN]


@kernel
def pitch_rate_of_attitude(st):
    """Return the pitch rate from attitude: a gust does not move it."""
    theta, phi = st["smooth"][sig.THETA], st["smooth"][sig.PHI]
    return flight_path.pitch_rate_of(st["slope"][sig.THETA], st["slope"][sig.PSI], theta, phi)


@kernel
def roll_rate(st):
    """Return the roll rate from attitude."""
    return flight_path.roll_rate_of(st["slope"][sig.PHI], st["slope"][sig.PSI], st["smooth"][sig.THETA])


@kernel
def yaw_rate(st):
    """Return the yaw rate from attitude."""
    theta, phi = st["smooth"][sig.THETA], st["smooth"][sig.PHI]
    return flight_path.yaw_rate_of(st["slope"][sig.THETA], st["slope"][sig.PSI], theta, phi)


@kernel
def normal_load_factor(c, p, st, speed):
    """Return the load factor at the accelerometers from the angle of attack.

    n_z = (n_w + n_x sin alpha) / cos alpha + what turning adds at the accelerometers' place
    """
    voted = st["voted"]
    across = lift(c, st, voted[sig.ALPHA]) + turning_lift(c, st, speed)
    along = voted[sig.N_X] * math.sin(voted[sig.ALPHA])
    return (across + along) / math.cos(voted[sig.ALPHA]) + normal_by_turning(p, st)


@kernel
def angle_of_attack(c, p, st, speed):
    """Return the angle of attack from the load factor: n_w = n_z cos alpha - n_x sin alpha, solved for alpha.

    The sine and the cosine are those of the last answer, kept within a quarter turn.
    """
    voted = st["voted"]
    centre = voted[sig.N_Z] - normal_by_turning(p, st)
    across = centre * math.cos(st["alpha"]) - voted[sig.N_X] * math.sin(st["alpha"])
    slope = max(voted[sig.Q_BAR], _THINNEST) * c[_LIFT_SLOPE]
    alpha = c[_ZERO_LIFT] + (across - turning_lift(c, st, speed)) / slope
    st["alpha"] = min(max(alpha, -1.5), 1.5)
    return alpha


@kernel
def angle_of_sideslip(c, p, st):
    """Return the sideslip from the lateral load factor: n_y at the centre of gravity over q_bar side_slope."""
    voted, slope = st["voted"], st["slope"]
    centre = voted[sig.N_Y] - lateral_by_turning(p, st)
    surfaces = (c[_ROLL_ARM] * slope[sig.P] + c[_YAW_ARM] * slope[sig.R]) / GRAVITY
    return (centre - surfaces) / (max(voted[sig.Q_BAR], _THINNEST) * c[_SIDE_SLOPE])


@kernel
def lateral_load_factor(c, p, st):
    """Return the load factor at the accelerometers from the sideslip: the inverse of ``angle_of_sideslip``."""
    voted, slope = st["voted"], st["slope"]
    surfaces = (c[_ROLL_ARM] * slope[sig.P] + c[_YAW_ARM] * slope[sig.R]) / GRAVITY
    side = max(voted[sig.Q_BAR], _THINNEST) * c[_SIDE_SLOPE] * voted[sig.BETA]
    return side + surfaces + lateral_by_turning(p, st)


@kernel
def normal_by_turning(p, st):
    """Return what turning adds to n_z at the accelerometers, a = w_dot x place + w x (w x place), upwards in g."""
    place, voted, slope = p["accelerometer"], st["voted"], st["slope"]
    x, y, z = place[0], place[1], place[2]
    roll, pitch, yaw = voted[sig.P], voted[sig.Q], voted[sig.R]
    spin = yaw * (roll * x + pitch * y + yaw * z) - z * (roll * roll + pitch * pitch + yaw * yaw)
    return (slope[sig.Q] * x - slope[sig.P] * y - spin) / GRAVITY


@kernel
def lateral_by_turning(p, st):
    """Return what turning adds to n_y at the accelerometers, to the right in g."""
    place, voted, slope = p["accelerometer"], st["voted"], st["slope"]
    x, y, z = place[0], place[1], place[2]
    roll, pitch, yaw = voted[sig.P], voted[sig.Q], voted[sig.R]
    spin = pitch * (roll * x + pitch * y + yaw * z) - y * (roll * roll + pitch * pitch + yaw * yaw)
    return (slope[sig.R] * x - slope[sig.P] * z + spin) / GRAVITY


@kernel
def pitch_angle(p, st, partners_known):
    """Return the pitch angle by pitch_filter.py, which never reads its sensor; NaN while a partner is lost.

    It begins again after a loss, at the angle of level flight, and keeps what it has learned of the gyros.
    """
    c, e, x = p["pitch_filter"], st["pitch_filter"], st["voted"]
    if not partners_known:
        e["frames"], e["vertical"]["started"] = 0, 0
        return math.nan
    if e["frames"] == 0:
        begin(c, e, flight_path.pitch_on_path(0.0, x[sig.ALPHA], x[sig.BETA], x[sig.PHI]), _FIRST_PITCH_RAD)
    learn_yaw_drift(True, c, e, x)
    predict(c, e, x, st["gyros"])
    flight_path.climb(x, e["theta"], c["dt"], e["vertical"])
    follow_path(c, e, flight_path.path_pitch_angle(x, e["vertical"]))
    return e["theta"] + c["dt"] * e["rate"]  # the votes are those of the last frame


@kernel
def roll_angle(p, st, speed, partners_known):
    """Return the roll angle by the voted gyros, drawn to that of the turn within ``_DRAWN_S``; NaN: a partner is lost.

    phi_dot = p + (q sin phi + r cos phi) tan theta
    """
    if not partners_known:
        st["rolling"] = 0
        return math.nan
    turned = roll_angle_of_turn(st, speed)
    if st["rolling"] == 0:
        st["rolling"], st["roll_angle"] = 1, turned
        return turned
    voted, phi = st["voted"], st["roll_angle"]
    rate = voted[sig.P] + (voted[sig.Q] * math.sin(phi) + voted[sig.R] * math.cos(phi)) * math.tan(voted[sig.THETA])
    st["roll_angle"] = wrap(phi + (rate + wrap(turned - phi) / _DRAWN_S) / p["rate_hz"])
    return st["roll_angle"]


@kernel
def roll_angle_of_turn(st, speed):
    """Return the roll angle at which gravity turns the aircraft as it does.

    g sin phi cos theta = V (r cos alpha - p sin alpha) - g n_y

    The neglected term, V beta_dot, is its error in a slip that begins or ends.
    """
    voted = st["voted"]
    turning = speed * (voted[sig.R] * math.cos(voted[sig.ALPHA]) - voted[sig.P] * math.sin(voted[sig.ALPHA])) / GRAVITY
    sine = (turning - voted[sig.N_Y]) / max(math.cos(voted[sig.THETA]), 0.1)
    return math.asin(min(max(sine, -1.0), 1.0))


@kernel
def dynamic_pressure(inertial, density):
    """Return the dynamic pressure from the speed over ground: rho v^2 / 2.  Wind is its error."""
    north, east, down = inertial[_NORTH], inertial[_NORTH + 1], inertial[_NORTH + 2]
    return 0.5 * density * (north * north + east * east + down * down)
