"""The frame: every signal's name, unit and range, and the block of frames that all stages share.

A block is one plain structured array, ``np.zeros(n, FRAME)``, of about one second of frames.
Each stage writes its own fields of row k in place; the log, the stream and the score read the
same rows.  What a stage computes *is* what is logged.

Order of writing in one frame (see loop.py):

    pilot      demand, truth of the sticks, discrete_truth[autopilot_engaged]
    plant      truth, discrete_truth, flight, end
    sensors    channels, valid, ilm, discrete_channels, discrete_valid, discrete_ilm, inertial
    faults     the same fields, corrupted; acting
    redundancy reference
    faults     reference, corrupted; acting
    redundancy voted, state, level, pattern, resolver, reference_usable, trend_*,
               discrete_voted, discrete_state, discrete_level
    control    source, law, command, surface, actuator, estimate, trust, lie
    faults     actuator, corrupted: the surface commands that reach the actuators; acting

SI units throughout; angles in rad, load factors in g (1), sticks normalised (-1 to 1).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import ceil, pi
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

CHANNELS: Final = 4  # columns of every channel array; a signal may use fewer
TWO_PI: Final = 2.0 * pi
MOST_FAULTS: Final = 64  # of one scenario

Block = NDArray[Any]  # structured, dtype FRAME, shape (n,)


@dataclass(frozen=True, slots=True)
class Signal:
    """One redundant measured quantity.

    ``low`` and ``high`` bound what its sensor can say (full scale); a value outside is invalid.
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
        """Where the log and the viewer keep this signal."""
        return f"/signal/{self.name}"


@dataclass(frozen=True, slots=True)
class Discrete:
    """One redundant yes/no quantity with the value that is safe when nobody agrees."""

    name: str
    fail_safe: int
    channels: int = CHANNELS

    @property
    def topic(self) -> str:
        """Where the log and the viewer keep this discrete."""
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
DEMANDS: Final = ("pitch_angle_rad", "roll_angle_rad", "altitude_m", "heading_rad", "airspeed_m_s")
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


class State(IntEnum):
    """A channel, as its monitor sees it."""

    OK = 0
    SUSPECT = 1
    FAILED = 2
    ABSENT = 3  # the signal has fewer than four channels


class Pattern(IntEnum):
    """How the channels in use agree (redundancy.md, section 2)."""

    NORMAL = 0
    ISOLATED = 1
    P2_2 = 2
    P1_1_1_1 = 3
    P1_1_1 = 4
    P1_1 = 5
    LOST = 6

    @property
    def label(self) -> str:
        """As written in tables: ``2:2`` rather than ``P2_2``."""
        return self.name[1:].replace("_", ":") if self.is_singular else self.name.lower()

    @property
    def is_singular(self) -> bool:
        """Whether no majority exists."""
        return Pattern.P2_2 <= self <= Pattern.P1_1


class Resolver(IntEnum):
    """Who decided a pattern without a majority."""

    NONE = 0
    ILM = 1
    TREND = 2
    REFERENCE = 3
    EXTREMES = 4
    MIDDLE = 5
    UNRESOLVED = 6
    BOX = 7  # the channel is out on several signals: its box has died
    COMMON = 8  # all channels agree, and two references agree against them


class Ilm(IntEnum):
    """A channel's in-line monitor: what the sensor says of itself."""

    BAD = 0
    GOOD = 1
    ABSENT = 2


class Source(IntEnum):
    """Where the control law takes a signal from."""

    VOTED = 0
    REFERENCE = 1  # the signal is lost, its reference is usable
    DEGRADED = 2  # neither: the signal's degraded mode


class Law(IntEnum):
    """Which control law flew the frame."""

    AUTOPILOT = 0
    STICK = 1
    BACKUP = 2


class Trust(IntEnum):
    """What the fault-tolerant law holds of the pitch-angle sensor."""

    NONE = 0  # another law flies: nobody tests it
    TRUSTED = 1
    CORRECTED = 2  # it lies: the law flies on the estimate
    WITHDRAWN = 3  # the estimate was wrong, not the sensor: the law flies on the sensor again


class Lie(IntEnum):
    """How a pitch-angle sensor that is not trusted is off, as far as the flight has told."""

    NONE = 0
    UNDETERMINED = 1
    EFFECTIVENESS = 2
    OFFSET = 3
    BOTH = 4
    RATE_BIAS = 5  # the sensor is trusted; a rate that it is compared with is biased


class End(IntEnum):
    """Why a flight ended; FLYING while it goes on."""

    FLYING = 0
    NOT_FINITE = 1
    GROUND_CONTACT = 2
    DEPARTURE_ANGLE_OF_ATTACK = 3
    DEPARTURE_SIDESLIP = 4
    DEPARTURE_LOAD_FACTOR = 5
    DEPARTURE_ATTITUDE = 6
    DEPARTURE_RATE = 7

    @property
    def label(self) -> str:
        """As a reader would say it."""
        return self.name.lower().replace("_", " ")


FRAME: Final = np.dtype(
    [
        ("frame", "i8"),
        ("truth", "f8", (S,)),
        ("flight", "f8", (len(FLIGHT),)),
        ("demand", "f8", (len(DEMANDS),)),
        ("channels", "f8", (S, CHANNELS)),
        ("inertial", "f8", (len(INERTIAL),)),
        ("voted", "f8", (S,)),
        ("reference", "f8", (S,)),  # NaN where there is none
        ("second_reference", "f8", (S,)),  # of other physics than ``reference``; NaN where there is none
        ("command", "f8", (len(COMMANDS),)),
        ("estimate", "f8", (len(ESTIMATES),)),  # zeros under another law than the fault-tolerant one
        ("surface", "f8", (len(SURFACES),)),
        ("actuator", "f8", (len(SURFACES),)),  # what reaches the actuators: surface, unless a fault is between
        ("trend_high", "u1", (S,)),
        ("trend_low", "u1", (S,)),
        ("valid", "u1", (S, CHANNELS)),  # 0: the sensor itself flags the sample
        ("ilm", "u1", (S, CHANNELS)),
        ("state", "u1", (S, CHANNELS)),
        ("level", "u1", (S,)),
        ("pattern", "u1", (S,)),
        ("resolver", "u1", (S,)),
        ("reference_usable", "u1", (S,)),
        ("common_mode", "u1", (S,)),  # 1: both references speak against all channels, which agree
        ("source", "u1", (S,)),
        ("discrete_truth", "u1", (D,)),
        ("discrete_channels", "u1", (D, CHANNELS)),
        ("discrete_valid", "u1", (D, CHANNELS)),
        ("discrete_ilm", "u1", (D, CHANNELS)),
        ("discrete_voted", "u1", (D,)),
        ("discrete_state", "u1", (D, CHANNELS)),
        ("discrete_level", "u1", (D,)),
        ("acting", "u1", (MOST_FAULTS // 8,)),  # bit i % 8 of byte i // 8: fault i of the scenario acted
        ("law", "u1"),
        ("trust", "u1"),
        ("lie", "u1"),
        ("end", "u1"),
    ],
    align=True,
)
# Measured by the wall clock, so kept apart from what must be the same in every run.
TIMING: Final = np.dtype([("frame_us", "f8"), ("late_us", "f8")])


def new_block(frames: int, first_frame: int = 0) -> Block:
    """An empty block of ``frames`` rows, numbered from ``first_frame``."""
    block = np.zeros(frames, FRAME)
    block["frame"] = np.arange(first_frame, first_frame + frames)
    return block


def to_frame(time_s: float, rate_hz: float) -> int:
    """The first frame at or after ``time_s``; a time on a frame is that frame, rounding apart."""
    return ceil(time_s * rate_hz - 1e-6)
