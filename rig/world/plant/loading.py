"""Load one aircraft in JSBSim and trim it in level flight."""

from __future__ import annotations

import logging
from functools import cache, partial
from math import atan2, degrees, hypot
from pathlib import Path
from typing import Final

import jsbsim

from rig.core.errors import BadInput, RigError
from rig.core.text import choices, quoted
from rig.world.plant import actuated, ground, level, wind
from rig.world.plant.airframe import Airframe, Config, FlightPoint
from rig.world.plant.imperial import FEET_PER_METRE, KILOGRAMS_PER_SLUG
from rig.world.plant.level import turns_propellers
from rig.world.plant.model_root import model_root

log = logging.getLogger("rig.jsbsim")
log.addHandler(logging.NullHandler())  # else warnings would go to stderr without a listener
_LEVELS = {
    jsbsim.LogLevel.WARN: logging.WARNING,
    jsbsim.LogLevel.ERROR: logging.ERROR,
    jsbsim.LogLevel.FATAL: logging.CRITICAL,
}


class _Logger(jsbsim.FGLogger):
    """JSBSim's messages into Python's logging: our output stays ours."""

    def __init__(self) -> None:
        super().__init__()
        self._level = logging.DEBUG
        self._text: list[str] = []

    def set_level(self, level: jsbsim.LogLevel) -> None:
        self._level = _LEVELS.get(level, logging.DEBUG)
        self._text = []

    def file_location(self, filename: str, line: int) -> None:
        self._text.append(f"{filename}:{line}: ")

    def message(self, message: str) -> None:
        self._text.append(message)

    def format(self, format: jsbsim.LogFormat) -> None:
        """Ignore colours: they mean nothing in a log."""

    def flush(self) -> None:
        text = " ".join("".join(self._text).split())
        if text:
            log.log(self._level, "%s", text)
        self._text = []


_logger = cache(_Logger)
_ANY_STEP_S: Final = 0.01  # JSBSim's step where nothing flies
# What a flight writes, as it is in a model that was just loaded.
BEFORE: Final = {
    **{f"fcs/{name}-cmd-norm": 0.0 for name in ("elevator", "aileron", "rudder", "throttle")},
    **{f"atmosphere/gust-{axis}-fps": 0.0 for axis in ("north", "east", "down")},
    "atmosphere/turb-type": 3.0,
}


class NoTrim(BadInput):
    """No level flight at a flight point; ``limit`` is the reason without figures."""

    def __init__(self, message: str, limit: str) -> None:
        super().__init__(message)
        self.limit = limit


def _executive() -> jsbsim.FGFDMExec:
    # The logger belongs to the thread, so every executive sets it again.
    jsbsim.set_logger(_logger())
    try:
        fdm = jsbsim.FGFDMExec(str(model_root()))
    except OSError as error:
        raise RigError(f"JSBSim: {error}: its package is not installed as a whole") from None
    fdm.set_debug_level(0)
    return fdm


def jsbsim_airframe(airframe: Airframe) -> Config:
    """Return the aircraft if JSBSim flies it; raise BadInput for a linear one."""
    if not isinstance(airframe, Config):
        raise BadInput(f'airframe.plant: {airframe.base_model} is "linear", JSBSim does not fly it')
    return airframe


def load(
    airframe: Airframe,
    flight_point: FlightPoint,
    dt_s: float,
    wind_m_s: wind.Velocity = wind.CALM,
    servos: bool = False,
) -> jsbsim.FGFDMExec:
    """Return a fresh JSBSim trimmed in level flight at ``flight_point``, heading north.

    dt_s     : JSBSim's own step
    wind_m_s : steady wind, towards north and east; the trim holds in it (down is left out)
    servos   : commands of the surfaces are their positions
    The trim stays in ``fcs/elevator-cmd-norm``, ``aileron-``, ``rudder-`` (rad) and
    ``throttle-cmd-norm`` (0 to 1); the trim commands are zero.  Writes nothing but the cache.
    Raises BadInput: a linear aircraft, unknown base model, undeclared property; NoTrim: none at this point.
    """
    airframe = jsbsim_airframe(airframe)
    begin = partial(_begun, airframe, flight_point, dt_s, wind_m_s, servos)
    fdm = begin()
    if turns_propellers(fdm):
        level.fly(fdm, _found(airframe, flight_point, wind_m_s))
    elif not _trimmed(fdm):  # where JSBSim's own trim finds nothing our search may, or says why not
        found = _found(airframe, flight_point, wind_m_s)
        fdm = begin()
        level.fly(fdm, found)
    fdm["propulsion/fuel_freeze"] = float(airframe.freeze_fuel)
    return fdm


def mass_kg(airframe: Config, point: FlightPoint) -> float:
    """Return the mass with the fuel that the model begins with; nothing is trimmed."""
    fdm = _begun(airframe, point, _ANY_STEP_S, wind.CALM)
    return fdm["inertia/mass-slugs"] * KILOGRAMS_PER_SLUG


def undeclared(airframe: Config) -> list[str]:
    """Return the properties that the model's equations read and that are missing; ``properties`` must declare them."""
    fdm, folder = _loaded(airframe, _ANY_STEP_S)
    return _provide(fdm, actuated.reads(folder))


def _loaded(airframe: Config, dt_s: float, servos: bool = False) -> tuple[jsbsim.FGFDMExec, Path]:
    """Return JSBSim with the model and our actuators, and the folder that it was loaded from."""
    fdm = _executive()
    for name in airframe.properties:
        if fdm.get_property_manager().hasNode(name):
            raise BadInput(f"airframe.properties: {name!r} is JSBSim's own and cannot be declared")
    root = model_root()
    folder = actuated.folder(airframe, root, servos)
    # Before loading: filters freeze the step that they are loaded with.
    fdm.set_dt(dt_s)
    paths = (str(folder), str(root / "engine"), str(root / "systems"))
    try:
        loaded = fdm.load_model_with_paths(airframe.base_model, *paths, True)
    except RuntimeError as error:
        raise BadInput(f"airframe: JSBSim rejects these settings: {error}") from None
    if not loaded:
        raise RigError(f"airframe.base_model: JSBSim could not load {airframe.base_model!r} from {folder}")
    return fdm, folder


def _provide(fdm: jsbsim.FGFDMExec, reads: list[str]) -> list[str]:
    """Make properties that are read and missing, and return their names; without them JSBSim aborts the process."""
    has = fdm.get_property_manager().hasNode
    missing = [name for name in reads if not has(name)]
    for name in missing:
        fdm[name] = 0.0
    return missing


def _check_properties(fdm: jsbsim.FGFDMExec, airframe: Config, reads: list[str]) -> None:
    """Refuse an aircraft whose equations read missing properties, before JSBSim evaluates them."""
    missing = _provide(fdm, reads)
    if missing:
        raise BadInput(
            f"airframe.properties: {airframe.base_model} reads {missing[0]!r}, which is missing; "
            "declare it with a constant value"
        )


def _check_held(fdm: jsbsim.FGFDMExec, airframe: Config) -> None:
    """Refuse what is held and not there: a write of a missing property would create it, and do nothing."""
    has = fdm.get_property_manager().hasNode
    for name in airframe.held:
        if not has(name):
            names = [line.split(" ")[0] for line in fdm.query_property_catalog("/").split("\n")]
            wrong = f"{airframe.base_model} has no property {quoted(name)}"
            raise BadInput(f"airframe.held: {wrong}; {choices(name, names)}")


def _begun(
    airframe: Config, point: FlightPoint, dt_s: float, wind_m_s: wind.Velocity, servos: bool = False
) -> jsbsim.FGFDMExec:
    """Return JSBSim at the flight point with its engines running and what is held set; nothing is trimmed."""
    fdm, folder = _loaded(airframe, dt_s, servos)
    _check_properties(fdm, airframe, actuated.reads(folder))
    _check_held(fdm, airframe)
    fdm["ic/h-sl-ft"] = point.altitude_m * FEET_PER_METRE
    fdm["ic/mach"] = point.mach
    fdm["ic/gamma-deg"] = 0.0
    _set_wind(fdm, wind_m_s[0] * FEET_PER_METRE, wind_m_s[1] * FEET_PER_METRE)
    _start(fdm, airframe)
    return fdm


def _start(fdm: jsbsim.FGFDMExec, airframe: Config) -> None:
    """Begin at the initial conditions with the gear up and the engines running; set what is held."""
    fdm["gear/gear-cmd-norm"] = 0.0
    fdm["gear/gear-pos-norm"] = 0.0
    fdm["propulsion/fuel_freeze"] = 1.0  # until the flight begins
    if turns_propellers(fdm):  # JSBSim's own start settles their revolutions, at which some engines stall
        fdm.run_ic()
        level.start(fdm)
    else:
        fdm["propulsion/set-running"] = -1
        fdm.run_ic()
        fdm["propulsion/set-running"] = -1
    for name, value in airframe.held.items():  # after the start, which opens every lever
        fdm[name] = value


def begin_again(fdm: jsbsim.FGFDMExec, airframe: Config) -> bool:
    """Begin again on the model of a flight in calm air, which is over, and trim it; return False if it finds no trim.

    Its initial conditions are those of ``load``: neither the trim nor the flight moves them.
    """
    jsbsim.set_logger(_logger())
    for name, value in BEFORE.items():
        fdm[name] = value
    fdm.reset_to_initial_conditions(0)
    _start(fdm, airframe)
    if not _trimmed(fdm):
        return False
    fdm[ground.ENABLED] = 1.0  # off in the trim too, if the flight left them off
    fdm["propulsion/fuel_freeze"] = float(airframe.freeze_fuel)
    return True


def _set_wind(fdm: jsbsim.FGFDMExec, north_fps: float, east_fps: float) -> None:
    """Set wind that leaves the airspeed as it is: JSBSim holds the ground speed while wind is set.

    The order matters: without a magnitude JSBSim forgets the direction, which is where the air goes to.
    """
    if north_fps == 0.0 and east_fps == 0.0:
        return
    fdm["ic/vn-fps"] = fdm["ic/vt-fps"] + north_fps
    fdm["ic/ve-fps"] = east_fps
    fdm["ic/vw-mag-fps"] = hypot(north_fps, east_fps)
    fdm["ic/vw-dir-deg"] = degrees(atan2(east_fps, north_fps))


def _trimmed(fdm: jsbsim.FGFDMExec) -> bool:
    """Trim by JSBSim's own search; return False if it finds nothing."""
    try:
        fdm.do_trim(int(jsbsim.TrimMode.FULL))
    except jsbsim.TrimFailureError:
        return False
    for command, trim in (("elevator", "pitch"), ("aileron", "roll"), ("rudder", "yaw")):
        fdm[f"fcs/{command}-cmd-norm"] += fdm[f"fcs/{trim}-trim-cmd-norm"]
        fdm[f"fcs/{trim}-trim-cmd-norm"] = 0.0
    return True


_searched: dict[str, level.Level | level.NoLevel] = {}


def _found(airframe: Config, point: FlightPoint, wind_m_s: wind.Velocity) -> level.Level:
    """Return level flight there, searched once in a process; NoTrim says why there is none."""
    key = f"{airframe.model_dump_json()} {point.model_dump_json()} {wind_m_s}"
    if key not in _searched:
        try:
            _searched[key] = level.find(_begun(airframe, point, _ANY_STEP_S, wind_m_s), airframe)
        except level.NoLevel as error:
            _searched[key] = error
    found = _searched[key]
    if isinstance(found, level.NoLevel):
        where = f"no level trim at {point.name!r} ({point.altitude_m:g} m, Mach {point.mach:g})"
        raise NoTrim(f"flight_point: {airframe.base_model} has {where}: {found}", found.limit)
    return found
