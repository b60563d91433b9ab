"""References: what a signal should read, from its physical partners or from the inertial unit.

Every reference reads the votes of the last frame and this frame's ``inertial``; never the truth, never the
signal that it is compared with, but for what two of them remember of it (sources.REMEMBERED): a slow memory,
fed only by frames in which the signal's channels agreed, or nothing disputed the last of them.  A reference is NaN
while one of its partners is lost or has no majority; of a disputed last channel it reads the last vote before the
dispute.  They begin with the votes of the first frame.

Source: Zhang 2023, section 7 (pitch rate by a lead filter on angle of attack, or the inertial unit); the equations
are in kinematics.py, inertial_unit.py and strapdown.py.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.computer.analytic import inertial_unit, kinematics, pitch_filter, strapdown
from rig.computer.analytic.apart import APART, LEARNING, RECENT_S, USUAL_S, stand_still
from rig.computer.analytic.designed import COLUMNS, FILTERS, Designed
from rig.computer.analytic.flight_path import SLOWEST
from rig.computer.analytic.reference_sources import PARTNERS, Config, second, source
from rig.computer.gain_schedule import look_up
from rig.core.frame import CHANNELS, INDEX, INERTIAL, SIGNALS, DecidedBy, Pattern, S, State, sig
from rig.core.kept import kept
from rig.core.kernels import kernel
from rig.core.settings import record
from rig.core.units.angles import difference
from rig.core.units.atmosphere import air_density

PARAM: Final = np.dtype(
    [
        ("rate_hz", "f8"),
        ("lead_frames", "f8"),
        ("accelerometer", "f8", (3,)),  # m from the centre of gravity: forward, right, down
        ("source", "u1", (S,)),
        ("partners", "i8", (S,)),  # a bit for each signal that is read
        ("second", "u1", (S,)),  # source of the second reference, and its partners
        ("second_partners", "i8", (S,)),
        ("pitch_filter", pitch_filter.PARAM),
        ("lead_s", "f8"),
        ("strapdown", "u1"),  # whether an attitude comes from the inertial unit
        ("monitored", "u1"),  # whether the manager watches references at all
        ("still", "f8", (len(LEARNING),)),  # what the channels of each may move apart by while it is learned
        ("recent_frames", "f8"),
        ("usual_frames", "f8"),
    ],
    align=True,
)
STATE: Final = np.dtype(
    [
        ("voted", "f8", (S,)),  # the last votes, and below what is kept of them
        ("smooth", "f8", (S,)),
        ("slope", "f8", (S,)),  # change of ``smooth`` a second
        ("coefficient", "f8", (len(COLUMNS),)),
        ("alpha", "f8"),  # last reference of the angle of attack
        ("pitch_filter", pitch_filter.STATE),  # that of the pitch angle
        ("unit", inertial_unit.STATE),  # what is kept of the inertial unit
        ("gyros", "i8"),  # channels in the votes of pitch and yaw rate
        # Of the last frame, a bit for each signal:
        ("lost", "i8"),  # no channel
        ("in_split", "i8"),  # no majority
        ("agreed", "i8"),  # all channels in use agree, and nothing disputes a last one
        ("roll_angle", "f8"),  # by the voted gyros
        ("rolling", "u1"),  # whether that has begun
        ("smoothing", "i8"),  # a bit for each signal whose filter has begun
        ("trusted", "u1", (S,)),  # a bit for each channel in order, of the last vote
        ("resettled", "i8"),  # a bit for each signal of whose vote that has changed
        ("started", "u1"),
        *APART,
    ],
    align=True,
)
_NO_SOURCE, _PARTNERS, _INERTIAL, _TURNED = 0, 1, 2, 3
_SOURCES: Final = {"none": _NO_SOURCE, "inertial": _INERTIAL, "attitude": _TURNED}  # all others are partners
_STEEPEST: Final = 1.3  # rad of pitch; beyond it roll and heading say little
_ALPHA_FILTER, _ATTITUDE_FILTER, _RATE_FILTER, _UNIT_FILTER = (COLUMNS.index(name) for name in FILTERS)
_RATE, _LOAD, _ANGLE, _FLOW, _AIR = range(5)  # what the inertial unit gives of a signal, and of which axis
_OF_UNIT: Final = {
    **{INDEX[name.removesuffix("_rad_s")]: (_RATE, i) for i, name in enumerate(INERTIAL[:3])},
    **{s: (_LOAD, i) for i, s in enumerate((sig.N_X, sig.N_Y, sig.N_Z))},  # in the order of the specific force
    **{s: (_ANGLE, i) for i, s in enumerate((sig.PHI, sig.THETA, sig.PSI))},
    **{sig.ALPHA: (_FLOW, 0), sig.BETA: (_FLOW, 1)},
}
_KIND, _AXIS = (np.array([_OF_UNIT.get(s, (_AIR, 0))[part] for s in range(S)]) for part in (0, 1))


class ReferenceData(NamedTuple):
    """Data of the references besides the row."""

    pressures: NDArray[np.float64]  # (P,) dynamic pressures of the flight points
    table: NDArray[np.float64]  # (P, C) designed coefficients there
    param: NDArray[Any]  # (1,) PARAM
    state: NDArray[Any]  # (1,) STATE, in place


class References:
    """The references of one flight.  ``state`` is plain data and can be copied.

    monitored : True if the manager monitors references; otherwise no reference is reported usable
    still : (S,) as ``still_within`` gives it; channels may move apart as they like when not given
    """

    def __init__(
        self,
        config: Config,
        designed: Designed,
        rate_hz: float,
        monitored: bool = True,
        still: NDArray[np.float64] | None = None,
    ) -> None:
        self.param = _parameters(config, designed, rate_hz, monitored).copy()
        self.param["still"] = np.inf if still is None else still[list(LEARNING)]
        self.pressures, self.table = (part.copy() for part in _table(designed, rate_hz))
        self.state: NDArray[Any] = np.zeros(1, STATE)

    @property
    def data(self) -> ReferenceData:
        """Data of ``refer`` and ``remember`` besides the row."""
        return ReferenceData(self.pressures, self.table, self.param, self.state)


@kept
def _table(designed: Designed, rate_hz: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return dynamic pressures and coefficients as of ``Designed.table``, the filters' as shares."""
    pressures, table = designed.table()
    for name in FILTERS:  # a time constant becomes the share of a new sample that passes in one frame
        column = table[:, COLUMNS.index(name)]
        column[:] = 1.0 - np.exp(-1.0 / (rate_hz * column))
    return pressures, table


@kept
def _parameters(config: Config, designed: Designed, rate_hz: float, monitored: bool) -> NDArray[Any]:
    codes, partners = zip(*(_coded(signal.name, source(config, signal.name)) for signal in SIGNALS), strict=True)
    second_codes, second_partners = zip(*(_coded(s.name, second(config, s.name)) for s in SIGNALS), strict=True)
    of_attitude = [sig.PHI, sig.THETA, sig.PSI, sig.ALPHA, sig.BETA]
    return record(
        PARAM,
        rate_hz=rate_hz,
        lead_s=config.inertial_lead_s,
        lead_frames=config.inertial_lead_s * rate_hz,
        accelerometer=(designed.accelerometer_x_m, designed.accelerometer_y_m, designed.accelerometer_z_m),
        source=codes,
        partners=partners,
        second=second_codes,
        second_partners=second_partners,
        pitch_filter=pitch_filter.parameters(pitch_filter.Noise(), rate_hz)[0],
        strapdown=any(_INERTIAL in (codes[s], second_codes[s]) for s in of_attitude),
        monitored=monitored,
        recent_frames=RECENT_S * rate_hz,
        usual_frames=USUAL_S * rate_hz,
        still=np.inf,
    )


def _coded(signal: str, chosen: str) -> tuple[int, int]:
    """Return a source as its code and the bits of its partners."""
    if chosen == "none":
        return _NO_SOURCE, 0
    return _SOURCES.get(chosen, _PARTNERS), sum(1 << INDEX[name] for name in PARTNERS[signal, chosen])


@kernel
def refer(bus, fcc, data):
    """Write ``reference`` and ``second_reference`` of a row from the last frame's votes; NaN where there is none.

    bus, fcc : the row's BUS and FCC records; data : ReferenceData
    """
    if data.state[0]["started"] == 0:
        for s in range(S):
            fcc["reference"][s] = fcc["second_reference"][s] = np.nan
        return
    answer(bus["inertial"], fcc, data)


@kernel
def remember(bus, fcc, data):
    """Keep the votes of a row for the next frame; in the first frame, begin with them."""
    st = data.state[0]
    look_back(fcc, st)
    for i in range(len(LEARNING)):
        stand_still(i, LEARNING[i], bus, fcc, data.param[0], st)
    if st["started"] == 0:
        st["started"] = 1
        inertial_unit.keep(bus["inertial"], st["unit"])
        st["unit"]["started"] = 0  # so that the filters begin there
        answer(bus["inertial"], fcc, data)
        for s in range(S):
            there = fcc["reference"][s] == fcc["reference"][s]
            fcc["reference_usable"][s] = 1 if there and data.param[0]["monitored"] != 0 else 0


@kernel
def look_back(fcc, st):
    """Keep the votes, and which signals are lost, have no majority, or agree; a vote without majority is not kept.

    Nor is that of a last channel which its monitor or its reference disputes: the vote is a substitute then, and two
    signals that are references of each other would close a loop through their substitutes (added).
    """
    voted, level, pattern, decided_by, kept = fcc["voted"], fcc["level"], fcc["pattern"], fcc["decided_by"], st["voted"]
    state = fcc["state"]
    lost, in_split, agreed, resettled = 0, 0, 0, 0
    for s in range(S):
        trusted = 0
        for c in range(CHANNELS):
            trusted |= (state[s, c] == State.OK) << c
        if trusted != st["trusted"][s]:
            st["trusted"][s] = trusted
            resettled |= 1 << s
        if level[s] == 0 or not math.isfinite(voted[s]):
            lost |= 1 << s
            continue
        disputed = pattern[s] == Pattern.NORMAL and decided_by[s] in (DecidedBy.ILM, DecidedBy.REFERENCE)
        torn = Pattern.P2_2 <= pattern[s] <= Pattern.P1_1
        if torn:
            in_split |= 1 << s
        if disputed or torn:
            if st["started"] != 0:
                continue
        elif pattern[s] == Pattern.NORMAL and decided_by[s] == DecidedBy.NONE:
            agreed |= 1 << s
        kept[s] = voted[s]
    st["lost"], st["in_split"], st["agreed"], st["resettled"] = lost, in_split, agreed, resettled
    st["gyros"] = 8 * level[sig.Q] + level[sig.R]


@kernel
def answer(inertial, fcc, data):
    """Write all references of a row, from what is kept of the votes and the row's inertial unit."""
    p, st = data.param[0], data.state[0]
    voted, u = st["voted"], st["unit"]
    look_up(data.pressures, data.table, voted[sig.Q_BAR], st["coefficient"])
    follow_all(p, st)
    inertial_unit.follow(inertial, st["coefficient"][_UNIT_FILTER], p["rate_hz"], u)
    if p["strapdown"] != 0:
        e = u["strapdown"]
        strapdown.attitude(inertial, u["last"], voted, st["agreed"], p["rate_hz"], p["lead_s"], e, u["angles"])
        inertial_unit.flow_angles(inertial, u["angles"], u["flow"])
    density = air_density(voted[sig.P_S])
    speed = max(math.sqrt(2.0 * max(voted[sig.Q_BAR], 0.0) / density), SLOWEST)
    air = density, speed
    for s in range(S):
        fcc["reference"][s] = opinion(s, p["source"][s], p["partners"][s], inertial, p, st, air)
        fcc["second_reference"][s] = opinion(s, p["second"][s], p["second_partners"][s], inertial, p, st, air)
    inertial_unit.keep(inertial, u)


@kernel
def opinion(s, source, partners, inertial, p, st, air):
    """Return signal s by a source; NaN when there is none, or a partner is lost or has no majority.

    Some sources remember: each runs once a frame.  partners : a bit for each signal; air : density and speed
    """
    density, speed = air
    if source == _NO_SOURCE:
        return math.nan
    if source == _INERTIAL:
        value = of_unit(s, inertial, p, st, density)
    elif source == _TURNED:
        value = of_attitude(s, st) if abs(st["voted"][sig.THETA]) <= _STEEPEST else math.nan
    else:
        value = of_partners(s, partners, p, st, speed)
    return value if partners & (st["lost"] | st["in_split"]) == 0 else math.nan


@kernel
def of_attitude(s, st):
    """Return a body rate from the change of the attitude."""
    if s == sig.Q:
        return kinematics.pitch_rate_of_attitude(st)
    return kinematics.roll_rate(st) if s == sig.P else kinematics.yaw_rate(st)


@kernel
def of_partners(s, partners, p, st, speed):
    """Return signal s from the air, the load factors or the turn."""
    c = st["coefficient"]
    if s == sig.Q:
        return kinematics.pitch_rate(c, st, speed)
    if s == sig.N_Z:
        return kinematics.normal_load_factor(c, p, st, speed)
    if s == sig.N_Y:
        return kinematics.lateral_load_factor(c, p, st)
    if s == sig.ALPHA:
        return kinematics.angle_of_attack(c, p, st, speed)
    if s == sig.BETA:
        return kinematics.angle_of_sideslip(c, p, st)
    if s == sig.PHI:
        return kinematics.roll_angle(p, st, speed, (partners & st["lost"]) == 0)
    return kinematics.pitch_angle(p, st, (partners & st["lost"]) == 0)


@kernel
def of_unit(s, inertial, p, st, density):
    """Return signal s by the inertial unit (inertial_unit.py, strapdown.py)."""
    u, rate_hz, lead = st["unit"], p["rate_hz"], p["lead_frames"]
    kind, i = _KIND[s], _AXIS[s]
    if kind == _RATE:
        return inertial_unit.rate(i, inertial, lead, u)
    if kind == _ANGLE:
        return u["angles"][i]
    if kind == _LOAD:
        load = inertial_unit.load_factor(i, inertial, lead, p["accelerometer"], u)
        return -load if i == 2 else load
    if kind == _FLOW:
        return u["flow"][i]
    if s == sig.P_S:
        return inertial_unit.static_pressure(inertial, st["voted"], st["agreed"], rate_hz, u)
    return kinematics.dynamic_pressure(inertial, density)


@kernel
def follow_all(p, st):
    """Move the filters of all signals whose rate of change is needed."""
    hz, share = p["rate_hz"], st["coefficient"]
    follow(st, sig.ALPHA, share[_ALPHA_FILTER], hz, 0)
    for s in (sig.THETA, sig.PHI, sig.PSI):
        follow(st, s, share[_ATTITUDE_FILTER], hz, 0 if s == sig.THETA else 1)
    for s in (sig.Q, sig.P, sig.R):
        follow(st, s, share[_RATE_FILTER], hz, 0)


@kernel
def follow(st, s, share, rate_hz, wraps):
    """Filter the vote of signal s to first order, and find its slope; begin again after a loss.

    y += share (x - y);  slope = change of y a second.  Where the vote is of other channels than before, by which it
    jumps as they differ, y takes the jump and continues by its slope (added).
    """
    bit = 1 << s
    x, y = st["voted"][s], st["smooth"][s]
    if (st["lost"] & bit) != 0:
        st["smoothing"] &= ~bit
    elif (st["smoothing"] & bit) == 0:
        st["smoothing"] |= bit
        st["smooth"][s], st["slope"][s] = x, 0.0
    elif (st["resettled"] & bit) != 0:
        move = st["slope"][s] / rate_hz
        st["smooth"][s] = x - (1.0 / share - 1.0) * move
    else:
        move = share * difference(x, y, wraps)
        st["smooth"][s], st["slope"][s] = y + move, move * rate_hz
