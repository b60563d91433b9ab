"""Signals, discretes and other numbers of a frame: names, units, ranges.

SI units throughout; angles in rad, load factors in g (1), sticks normalised (-1 to 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Final

from rig.core.units.constants import TWO_PI

CHANNELS: Final = 4  # columns of every channel array; a signal may use fewer


@dataclass(frozen=True, slots=True)
class Signal:
    """One redundant measured quantity.

    ``low`` and ``high`` bound the samples of its sensor (full scale); a value outside is invalid.
    A signal that ``wraps`` is an angle on the circle: differences are taken the short way round.
    """

    name: str
    symbol: str
    unit: str
    low: float
    high: float
    group: str
    wraps: bool = False
    channels: int = CHANNELS

    @property
    def topic(self) -> str:
        """Topic of this signal in log and viewer."""
        return f"/signal/{self.name}"


@dataclass(frozen=True, slots=True)
class Discrete:
    """One redundant yes/no quantity with its fail-safe value."""

    name: str
    fail_safe: int
    channels: int = CHANNELS

    @property
    def topic(self) -> str:
        """Topic of this discrete in log and viewer."""
        return f"/discrete/{self.name}"


SIGNALS: Final = (
    Signal("pitch_rate", "q", "rad/s", -1.5, 1.5, "rates"),
    Signal("roll_rate", "p", "rad/s", -5.5, 5.5, "rates"),
    Signal("yaw_rate", "r", "rad/s", -1.5, 1.5, "rates"),
    Signal("normal_load_factor", "n_z", "g", -6.0, 12.0, "load factors"),
    Signal("lateral_load_factor", "n_y", "g", -3.0, 3.0, "load factors"),
    Signal("longitudinal_load_factor", "n_x", "g", -3.0, 3.0, "load factors"),
    Signal("angle_of_attack", "alpha", "rad", -0.7, 1.2, "air data"),
    Signal("angle_of_sideslip", "beta", "rad", -0.7, 0.7, "air data"),
    Signal("static_pressure", "p_s", "Pa", 0.0, 120_000.0, "air data"),
    Signal("dynamic_pressure", "q_bar", "Pa", 0.0, 120_000.0, "air data"),
    Signal("stick_pitch", "d_p", "1", -1.0, 1.0, "stick and pedals"),
    Signal("stick_roll", "d_r", "1", -1.0, 1.0, "stick and pedals"),
    Signal("pedal", "d_y", "1", -1.0, 1.0, "stick and pedals"),
    Signal("pitch_angle", "theta", "rad", -pi / 2, pi / 2, "attitude"),
    Signal("roll_angle", "phi", "rad", -pi, pi, "attitude", wraps=True),
    Signal("heading", "psi", "rad", 0.0, TWO_PI, "attitude", wraps=True),
)
DISCRETES: Final = (
    Discrete("weight_on_wheels", fail_safe=0),
    Discrete("gear_down", fail_safe=1),
    Discrete("autopilot_engaged", fail_safe=0),
)
S: Final = len(SIGNALS)
D: Final = len(DISCRETES)
INDEX: Final = {signal.name: i for i, signal in enumerate(SIGNALS)}
DISCRETE_INDEX: Final = {discrete.name: i for i, discrete in enumerate(DISCRETES)}

# What the pilot or the scenario asks of the autopilot, as changes from the values held at engagement.
AUTOPILOT_COMMANDS: Final = ("pitch_angle_rad", "roll_angle_rad", "altitude_m", "heading_rad", "airspeed_m_s")
# What the control law asks of the actuators: absolute positions, signs as JSBSim's fcs/*-pos-rad
# (elevator trailing edge down is positive and pitches down).
SURFACES: Final = ("elevator_rad", "aileron_rad", "rudder_rad", "throttle")
# Inside the control law, logged: commands of the outer loops and what it derives from voted air data.
COMMANDS: Final = (
    "pitch_rate_rad_s",
    "roll_rate_rad_s",
    "sideslip_rad",
    "pitch_angle_rad",
    "roll_angle_rad",
    "altitude_m",
    "heading_rad",
    "airspeed_m_s",
    "pressure_altitude_m",
    "equivalent_airspeed_m_s",
    "flight_path_angle_rad",
)
# What the fault-tolerant law holds of the pitch angle and of its sensor = effectiveness * angle + offset; logged.
ESTIMATES: Final = (
    "pitch_angle_rad",
    "effectiveness",
    "offset_rad",
    "effectiveness_sigma",
    "offset_sigma_rad",
    "innovation_rad",  # sensor less estimate
    "innovation_sigma_rad",
    "pitch_rate_drift_rad_s",
    "path_offset_rad",
)
# What the inertial unit says: one box of its own, no channel of any signal (references read it).
INERTIAL: Final = (
    "roll_rate_rad_s",
    "pitch_rate_rad_s",
    "yaw_rate_rad_s",
    "velocity_north_m_s",
    "velocity_east_m_s",
    "velocity_down_m_s",
    "specific_force_forward_m_s2",  # acceleration less gravity, as accelerometers read: level flight is -g downwards
    "specific_force_right_m_s2",
    "specific_force_down_m_s2",
)
# The true flight condition; neither redundancy nor control may read it.
FLIGHT: Final = (
    "altitude_m",
    "height_m",
    "north_m",
    "east_m",
    "latitude_rad",
    "longitude_rad",
    "true_airspeed_m_s",
    "mach",
    "velocity_north_m_s",
    "velocity_east_m_s",
    "velocity_down_m_s",
    "quaternion_w",
    "quaternion_x",
    "quaternion_y",
    "quaternion_z",
    "wind_north_m_s",
    "wind_east_m_s",
    "wind_down_m_s",
    "elevator_rad",
    "aileron_rad",
    "rudder_rad",
    "throttle",
    "specific_force_forward_m_s2",  # at the centre of gravity
    "specific_force_right_m_s2",
    "specific_force_down_m_s2",
)
FLIGHT_INDEX: Final = {name: i for i, name in enumerate(FLIGHT)}
