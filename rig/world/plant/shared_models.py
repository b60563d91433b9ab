"""Loaded models of JSBSim that the flights of one process share: loading one takes longer than its trim.

A model that a flight hands back waits for the next flight of the same aircraft, flight point, step and steady wind.
That flight begins it again and trims it; the frames are those of a model that was loaded for it, bit for bit.  Nothing
is assumed of a model: the first time that one could be shared, it flies beside a fresh one, and all properties of both
must be equal, at the trim and after CHECKED steps.  Otherwise each flight loads its own.
"""

from __future__ import annotations

import struct
from typing import Final

import jsbsim

from rig.core.kept import kept
from rig.core.settings import Settings
from rig.world.plant import ground, wind
from rig.world.plant.airframe import Config, FlightPoint
from rig.world.plant.level import turns_propellers
from rig.world.plant.loading import begin_again, load

MOST: Final = 8  # models that wait; each has some megabytes
CHECKED: Final = 100  # steps that a model flies beside a fresh one
# Memory that JSBSim does not set before it is on the ground, or that is old while the ground reactions are off; a count
# that nothing reads, what is set after the trim.
_APART: Final = ("/side_friction_coeff", ground.HEIGHT_OF_POINT, "simulation/frame", "/randomseed")

Key = tuple[str, str, float, wind.Velocity, bool]
_waiting: dict[Key, jsbsim.FGFDMExec] = {}  # in the order in which they were handed back
_alike: dict[Key, bool] = {}  # whether a model that begins again equals a fresh one


def key(airframe: Config, point: FlightPoint, dt_s: float, wind_m_s: wind.Velocity, servos: bool) -> Key:
    """Return what two flights must have in common to share a model."""
    return _text(airframe), _text(point), dt_s, wind_m_s, servos


@kept
def _text(settings: Settings) -> str:
    return settings.model_dump_json()


def trimmed(
    airframe: Config, point: FlightPoint, dt_s: float, wind_m_s: wind.Velocity, servos: bool
) -> jsbsim.FGFDMExec:
    """Return what ``load`` returns, on a model that waits if there is one."""
    of = key(airframe, point, dt_s, wind_m_s, servos)
    fdm = _waiting.pop(of, None)
    if fdm is None or not begin_again(fdm, airframe):
        return load(airframe, point, dt_s, wind_m_s, servos)
    if of not in _alike:
        _alike[of] = _equal(fdm, load(airframe, point, dt_s, wind_m_s, servos))
        return load(airframe, point, dt_s, wind_m_s, servos)
    return fdm


def give_back(of: Key, fdm: jsbsim.FGFDMExec, airframe: Config) -> None:
    """Keep the model of a flight in calm air that did not depart; the caller does not touch it again."""
    if airframe.held or turns_propellers(fdm) or not _alike.get(of, True):
        return
    _waiting[of] = fdm
    while len(_waiting) > MOST:
        del _waiting[next(iter(_waiting))]


def _equal(one: jsbsim.FGFDMExec, other: jsbsim.FGFDMExec) -> bool:
    """Return whether all properties of two models are equal, before and after they are flown alike."""
    if _properties(one) != _properties(other):
        return False
    for fdm in (one, other):
        trim = fdm["fcs/elevator-cmd-norm"]
        for step in range(CHECKED):
            fdm["fcs/elevator-cmd-norm"] = trim + 0.01 * (step % 7 - 3)
            fdm["fcs/aileron-cmd-norm"] = fdm["fcs/rudder-cmd-norm"] = 0.01 * (step % 5 - 2)
            fdm["fcs/throttle-cmd-norm"] = 0.1 * (step % 11)
            fdm.run()
    return _properties(one) == _properties(other)


def _properties(fdm: jsbsim.FGFDMExec) -> dict[str, bytes]:
    """Return every property, bit by bit."""
    names = [line.split(" ")[0] for line in fdm.query_property_catalog("/").split("\n")]
    return {name: struct.pack("d", fdm[name]) for name in names if name and not name.endswith(_APART)}
