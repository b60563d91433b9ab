"""References: what a signal should read, from its physical partners or from the inertial unit.

Every reference reads the votes of the last frame and this frame's ``inertial``; never the truth, never the
signal that it is to judge.  It is NaN while one of its partners is lost.  In the first frame, when nothing
has been voted before, the references begin with the frame's own votes.

Source: Zhang 2023, section 7 (pitch rate by a lead filter on angle of attack, or the inertial unit); the
equations are in motion.py.
"""

from __future__ import annotations

import math
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rig.angles import difference
from rig.frame import INDEX, INERTIAL, SIGNALS, S
from rig.inclination import estimate
from rig.inclination.path import air_density
from rig.kernels import kernel
from rig.pressure_table import look_up
from rig.redundancy import motion
from rig.redundancy.designed import COLUMNS, FILTERS, Designed
from rig.settings import Settings


class Config(Settings):
    """The ``[redundancy.references]`` table: where each reference comes from."""

    pitch_rate: Literal["angle_of_attack", "attitude", "inertial", "none"] = "angle_of_attack"
    roll_rate: Literal["attitude", "inertial", "none"] = "attitude"
    yaw_rate: Literal["attitude", "inertial", "none"] = "attitude"
    normal_load_factor: Literal["angle_of_attack", "none"] = "angle_of_attack"
    angle_of_attack: Literal["load_factor", "none"] = "load_factor"
    angle_of_sideslip: Literal["lateral_load_factor", "none"] = "lateral_load_factor"
    dynamic_pressure: Literal["inertial", "none"] = "inertial"
    pitch_angle: Literal["kinematic", "none"] = "kinematic"
    inertial_lead_s: float = Field(default=0.015, ge=0)  # makes up for the unit's lag beyond that of the gyros


_TURNING: Final = ("roll_rate", "pitch_rate", "yaw_rate")
_ATTITUDE: Final = ("pitch_angle", "roll_angle", "heading")
_AIR: Final = ("dynamic_pressure", "static_pressure")
# What each source reads of the votes.
PARTNERS: Final[dict[tuple[str, str], tuple[str, ...]]] = {
    ("pitch_rate", "angle_of_attack"): (
        *("angle_of_attack", "angle_of_sideslip", "roll_rate", "yaw_rate"),
        *("pitch_angle", "roll_angle", *_AIR),
    ),
    ("pitch_rate", "attitude"): _ATTITUDE,
    ("pitch_rate", "inertial"): (),
    ("roll_rate", "attitude"): _ATTITUDE,
    ("roll_rate", "inertial"): (),
    ("yaw_rate", "attitude"): _ATTITUDE,
    ("yaw_rate", "inertial"): (),
    ("normal_load_factor", "angle_of_attack"): ("angle_of_attack", "longitudinal_load_factor", *_TURNING, *_AIR),
    ("angle_of_attack", "load_factor"): ("normal_load_factor", "longitudinal_load_factor", *_TURNING, *_AIR),
    ("angle_of_sideslip", "lateral_load_factor"): ("lateral_load_factor", *_TURNING, "dynamic_pressure"),
    ("dynamic_pressure", "inertial"): ("static_pressure",),
    ("pitch_angle", "kinematic"): estimate.PARTNERS,
}

PARAM: Final = np.dtype(
    [
        ("rate_hz", "f8"),
        ("lead_frames", "f8"),
        ("accelerometer", "f8", (3,)),  # m from the centre of gravity: forward, right, down
        ("source", "u1", (S,)),
        ("partners", "i8", (S,)),  # a bit for each signal that is read
        ("inclination", estimate.PARAM),
        ("monitored", "u1"),  # whether the manager watches references at all
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("voted", "f8", (S,)),  # the last votes, and below what is kept of them
        ("smooth", "f8", (S,)),
        ("slope", "f8", (S,)),  # change of ``smooth`` a second
        ("rates", "f8", (3,)),  # of the inertial unit, last frame
        ("coefficient", "f8", (len(COLUMNS),)),
        ("alpha", "f8"),  # last reference of the angle of attack
        ("inclination", estimate.STATE),  # that of the pitch angle
        ("gyros", "i8"),  # channels in the votes of pitch and yaw rate
        ("lost", "i8"),  # a bit for each signal without a channel
        ("smoothing", "i8"),  # a bit for each signal whose filter has begun
        ("started", "u1"),
    ],
    align=True,
)
_NO_SOURCE, _PARTNERS, _INERTIAL, _TURNED = 0, 1, 2, 3
_SOURCES: Final = {"none": _NO_SOURCE, "inertial": _INERTIAL, "attitude": _TURNED}  # all others are partners
_SLOWEST: Final = 30.0  # m/s; divisions by airspeed take at least this
_STEEPEST: Final = 1.3  # rad of pitch; beyond it roll and heading say little
_Q, _P, _R = INDEX["pitch_rate"], INDEX["roll_rate"], INDEX["yaw_rate"]
_NZ, _ALPHA, _BETA = (INDEX[name] for name in ("normal_load_factor", "angle_of_attack", "angle_of_sideslip"))
_STATIC, _DYNAMIC = INDEX["static_pressure"], INDEX["dynamic_pressure"]
_THETA, _PHI, _PSI = INDEX["pitch_angle"], INDEX["roll_angle"], INDEX["heading"]
_ALPHA_FILTER, _ATTITUDE_FILTER, _RATE_FILTER = (COLUMNS.index(name) for name in FILTERS)
_RATES: Final = np.array([INDEX[name.removesuffix("_rad_s")] for name in INERTIAL[:3]])  # the signals they stand for


class References:
    """The references of one flight.  ``state`` is plain data and can be copied.

    monitored : whether the manager watches references; else none is ever reported usable
    """

    def __init__(self, config: Config, designed: Designed, rate_hz: float, monitored: bool = True) -> None:
        self.param = _parameters(config, designed, rate_hz)
        self.param["monitored"] = monitored
        self.pressures, self.table = designed.table()
        for name in FILTERS:  # a time constant becomes the share of a new sample that passes in one frame
            column = self.table[:, COLUMNS.index(name)]
            column[:] = 1.0 - np.exp(-1.0 / (rate_hz * column))
        self.state: NDArray[Any] = np.zeros(1, STATE)

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What ``refer`` and ``remember`` need besides the row."""
        return self.pressures, self.table, self.param, self.state


def source(config: Config, signal: str) -> str:
    """Where the reference of ``signal`` comes from, ``none`` when it has none."""
    return getattr(config, signal, "none")


def _parameters(config: Config, designed: Designed, rate_hz: float) -> NDArray[Any]:
    param = np.zeros(1, PARAM)
    row = param[0]
    estimate.fill(row["inclination"], estimate.Noise(), rate_hz)
    row["rate_hz"], row["lead_frames"] = rate_hz, config.inertial_lead_s * rate_hz
    row["accelerometer"] = designed.accelerometer_x_m, designed.accelerometer_y_m, designed.accelerometer_z_m
    for s, signal in enumerate(SIGNALS):
        chosen = source(config, signal.name)
        row["source"][s] = _SOURCES.get(chosen, _PARTNERS)
        if chosen != "none":
            row["partners"][s] = sum(1 << INDEX[name] for name in PARTNERS[signal.name, chosen])
    return param


@kernel
def refer(block, k, pressures, table, param, state):
    """Write ``reference`` of row k from the last frame's votes; NaN where there is none.

    block : FRAME records; pressures (P,), table (P, C) : designed coefficients
    param, state : one record of PARAM and of STATE; state in place
    """
    if state[0]["started"] == 0:
        for s in range(S):
            block[k]["reference"][s] = np.nan
        return
    answer(block[k], pressures, table, param, state)


@kernel
def remember(block, k, pressures, table, param, state):
    """Keep the votes of row k for the next frame; in the first frame, begin with them."""
    row, st = block[k], state[0]
    voted, level = row["voted"], row["level"]
    lost = 0
    for s in range(S):
        if level[s] == 0 or not math.isfinite(voted[s]):
            lost |= 1 << s
        else:
            st["voted"][s] = voted[s]
    st["lost"] = lost
    st["gyros"] = 8 * level[_Q] + level[_R]
    if st["started"] == 0:
        st["started"] = 1
        for i in range(3):
            st["rates"][i] = row["inertial"][i]
        answer(row, pressures, table, param, state)
        for s in range(S):
            there = row["reference"][s] == row["reference"][s]
            row["reference_usable"][s] = 1 if there and param[0]["monitored"] != 0 else 0


@kernel
def answer(row, pressures, table, param, state):
    """All references of a row, from what is kept of the votes and the row's inertial unit."""
    p, st = param[0], state[0]
    voted, reference, c = st["voted"], row["reference"], st["coefficient"]
    look_up(pressures, table, voted[_DYNAMIC], c)
    follow_all(p, st)
    density = air_density(voted[_STATIC])
    speed = max(math.sqrt(2.0 * max(voted[_DYNAMIC], 0.0) / density), _SLOWEST)
    if p["source"][_Q] == _TURNED:
        reference[_Q] = motion.pitch_rate_of_attitude(st)
    else:
        reference[_Q] = motion.pitch_rate(c, st, speed)
    reference[_P] = motion.roll_rate(st)
    reference[_R] = motion.yaw_rate(st)
    reference[_NZ] = motion.normal_load_factor(c, p, st, speed)
    reference[_ALPHA] = motion.angle_of_attack(c, p, st, speed)
    reference[_BETA] = motion.angle_of_sideslip(c, p, st)
    reference[_DYNAMIC] = motion.dynamic_pressure(row["inertial"], density)
    known = p["source"][_THETA] != _NO_SOURCE and (p["partners"][_THETA] & st["lost"]) == 0
    reference[_THETA] = motion.pitch_angle(p, st, known)
    read_rates(row["inertial"], p, st, reference)
    steep = abs(voted[_THETA]) > _STEEPEST
    for s in range(S):
        unsaid = p["source"][s] == _NO_SOURCE or (steep and p["source"][s] == _TURNED)
        if unsaid or (p["partners"][s] & st["lost"]) != 0:
            reference[s] = np.nan


@kernel
def follow_all(p, st):
    """Move the filters of all signals whose rate of change is needed."""
    hz, share = p["rate_hz"], st["coefficient"]
    follow(st, _ALPHA, share[_ALPHA_FILTER], hz, 0)
    for s in (_THETA, _PHI, _PSI):
        follow(st, s, share[_ATTITUDE_FILTER], hz, 0 if s == _THETA else 1)
    for s in (_Q, _P, _R):
        follow(st, s, share[_RATE_FILTER], hz, 0)


@kernel
def follow(st, s, share, rate_hz, wraps):
    """First-order filter on the vote of signal s, and its slope; it begins anew after a loss.

    y += share (x - y);  slope = change of y a second
    """
    bit = 1 << s
    x, y = st["voted"][s], st["smooth"][s]
    if (st["lost"] & bit) != 0:
        st["smoothing"] &= ~bit
    elif (st["smoothing"] & bit) == 0:
        st["smoothing"] |= bit
        st["smooth"][s], st["slope"][s] = x, 0.0
    else:
        move = share * difference(x, y, wraps)
        st["smooth"][s], st["slope"][s] = y + move, move * rate_hz


@kernel
def read_rates(inertial, p, st, reference):
    """The inertial unit's rates where they are the chosen source, led by ``inertial_lead_s`` (Zhang, section 7)."""
    for i in range(3):
        rate = inertial[i] + p["lead_frames"] * (inertial[i] - st["rates"][i])
        st["rates"][i] = inertial[i]
        s = _RATES[i]
        if p["source"][s] == _INERTIAL:
            reference[s] = rate
