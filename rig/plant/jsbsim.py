"""Load, trim and fly one aircraft in JSBSim; the only importer of JSBSim."""

from __future__ import annotations

import logging
import struct
from functools import cache
from math import atan2, degrees, hypot, inf
from pathlib import Path
from typing import Final

import jsbsim
import numpy as np

from rig.errors import BadInput, RigError
from rig.frame import SURFACES, Block, new_block
from rig.kernels import bind
from rig.plant import actuated, truth, wind
from rig.plant.airframe import Airframe, Config, FlightPoint
from rig.text import choices, quoted

FEET_PER_METRE: Final = 1.0 / 0.3048
_FPS_PER_KNOT: Final = 1852.0 / 3600.0 * FEET_PER_METRE
_TUSTIN: Final = 4  # JSBSim's number of its Dryden turbulence in Tustin form

_VALUE = jsbsim.FGPropertyNode.get_double_value  # mapped over the nodes: the quickest way to read many

log = logging.getLogger("rig.jsbsim")
log.addHandler(logging.NullHandler())  # else warnings would go to stderr when nobody listens
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
        """Colours mean nothing in a log."""

    def flush(self) -> None:
        text = " ".join("".join(self._text).split())
        if text:
            log.log(self._level, "%s", text)
        self._text = []


_logger = cache(_Logger)


def _executive() -> jsbsim.FGFDMExec:
    # The logger belongs to the thread, so every executive sets it again.
    jsbsim.set_logger(_logger())
    fdm = jsbsim.FGFDMExec(None)
    fdm.set_debug_level(0)
    return fdm


def _ours(airframe: Airframe) -> Config:
    if not isinstance(airframe, Config):
        raise BadInput(f'airframe.plant: {airframe.base_model} is "linear", JSBSim does not fly it')
    return airframe


def load(
    airframe: Airframe,
    flight_point: FlightPoint,
    dt_s: float,
    wind_m_s: wind.Velocity = wind.CALM,
) -> jsbsim.FGFDMExec:
    """A fresh JSBSim trimmed in level flight at ``flight_point``, heading north.

    dt_s     : JSBSim's own step
    wind_m_s : steady wind, towards north and east; the trim holds in it (down is left out)
    The trim stays in ``fcs/elevator-cmd-norm``, ``aileron-``, ``rudder-`` (rad) and
    ``throttle-cmd-norm`` (0 to 1); the trim commands are zero.  Writes nothing but the cache.
    Raises BadInput: a linear aircraft, unknown base model, undeclared property, or no trim at this point.
    """
    airframe = _ours(airframe)
    fdm = _executive()
    for name in airframe.properties:
        if fdm.get_property_manager().hasNode(name):
            raise BadInput(f"airframe.properties: {name!r} is JSBSim's own and cannot be declared")
    root = Path(jsbsim.get_default_root_dir())
    folder = actuated.folder(airframe, root)
    # Before loading: filters freeze the step that they are loaded with.
    fdm.set_dt(dt_s)
    paths = (str(folder), str(root / "engine"), str(root / "systems"))
    try:
        loaded = fdm.load_model_with_paths(airframe.base_model, *paths, True)
    except RuntimeError as error:
        raise BadInput(f"airframe: JSBSim does not take these settings: {error}") from None
    if not loaded:
        raise RigError(f"airframe.base_model: JSBSim could not load {airframe.base_model!r} from {folder}")
    _check_properties(fdm, airframe, actuated.reads(folder))
    _check_held(fdm, airframe)
    _begin(fdm, airframe, flight_point, wind_m_s)
    _trim(fdm, airframe, flight_point)
    return fdm


def _check_properties(fdm: jsbsim.FGFDMExec, airframe: Config, reads: list[str]) -> None:
    """Refuse an aircraft whose equations read what nobody provides, before anything evaluates them."""
    has = fdm.get_property_manager().hasNode
    missing = [name for name in reads if not has(name)]
    for name in missing:
        fdm[name] = 0.0  # else JSBSim would abort the process even when it is discarded
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
            known = [line.split(" ")[0] for line in fdm.get_property_catalog()]
            raise BadInput(
                f"airframe.held: {airframe.base_model} has no property {quoted(name)}, {choices(name, known)}"
            )


def _begin(fdm: jsbsim.FGFDMExec, airframe: Config, point: FlightPoint, wind_m_s: wind.Velocity) -> None:
    fdm["ic/h-sl-ft"] = point.altitude_m * FEET_PER_METRE
    fdm["ic/mach"] = point.mach
    fdm["ic/gamma-deg"] = 0.0
    _set_wind(fdm, wind_m_s[0] * FEET_PER_METRE, wind_m_s[1] * FEET_PER_METRE)
    fdm["gear/gear-cmd-norm"] = 0.0
    fdm["gear/gear-pos-norm"] = 0.0
    fdm["propulsion/fuel_freeze"] = float(airframe.freeze_fuel)
    fdm["propulsion/set-running"] = -1
    fdm.run_ic()
    fdm["propulsion/set-running"] = -1
    for name, value in airframe.held.items():  # after the start, which opens every lever
        fdm[name] = value


def _set_wind(fdm: jsbsim.FGFDMExec, north_fps: float, east_fps: float) -> None:
    """Wind that leaves the airspeed as it is: JSBSim holds the ground speed while wind is set.

    The order matters: without a magnitude JSBSim forgets the direction, which is where the air goes to.
    """
    if north_fps == 0.0 and east_fps == 0.0:
        return
    fdm["ic/vn-fps"] = fdm["ic/vt-fps"] + north_fps
    fdm["ic/ve-fps"] = east_fps
    fdm["ic/vw-mag-fps"] = hypot(north_fps, east_fps)
    fdm["ic/vw-dir-deg"] = degrees(atan2(east_fps, north_fps))


def _trim(fdm: jsbsim.FGFDMExec, airframe: Config, point: FlightPoint) -> None:
    try:
        fdm.do_trim(int(jsbsim.TrimMode.FULL))
    except jsbsim.TrimFailureError:
        raise BadInput(
            f"flight_point: {airframe.base_model} has no level trim at {point.name!r} "
            f"({point.altitude_m:g} m, Mach {point.mach:g})"
        ) from None
    for command, trim in (("elevator", "pitch"), ("aileron", "roll"), ("rudder", "yaw")):
        fdm[f"fcs/{command}-cmd-norm"] += fdm[f"fcs/{trim}-trim-cmd-norm"]
        fdm[f"fcs/{trim}-trim-cmd-norm"] = 0.0


def turns_propellers(fdm: jsbsim.FGFDMExec) -> bool:
    """Whether the first engine drives a propeller."""
    return bool(fdm.get_property_manager().hasNode("propulsion/engine/propeller-rpm"))


class Plant:
    """One aircraft in flight, read and moved frame by frame.

    trim : (len(SURFACES),) f8, where the surfaces stand in trimmed flight

    ``read`` writes what is true in this frame, ``step`` takes the row's commands to the next one.
    In flight nothing raises: a broken simulation reads as NaN and ends.
    Raises BadInput when the aircraft cannot be loaded or trimmed there.
    """

    def __init__(
        self,
        airframe: Airframe,
        flight_point: FlightPoint,
        air: wind.Config,
        turbulence: wind.Turbulence,
        rate_hz: float,
        steps_per_frame: int,
        seed: int,
    ) -> None:
        self._airframe = _ours(airframe)
        self._flight_point = flight_point
        self._wind = air
        self._severity = wind.SEVERITY[turbulence]
        self._seed = seed
        self._rate_hz = rate_hz
        self._steps = range(steps_per_frame)
        self._dt_s = 1.0 / (rate_hz * steps_per_frame)
        self._raw_bytes = bytearray(truth.RAW.itemsize)
        self._raw = np.frombuffer(self._raw_bytes, truth.RAW)  # the same memory, as one record
        self.trim = np.zeros(len(SURFACES))
        self.reset()

    def reset(self) -> None:
        """Back to the first frame, on a fresh JSBSim: the same flight again, bit for bit."""
        airframe = self._airframe
        fdm = load(airframe, self._flight_point, self._dt_s, self._wind.steady)
        _set_turbulence(fdm, self._severity, self._seed)
        surfaces = (airframe.elevator, airframe.aileron, airframe.rudder)
        positions = [*(surface.position for surface in surfaces), actuated.THROTTLE_POSITION]
        nodes = [_node(fdm, name) for name in (*truth.READ.values(), *positions, *truth.SLOW.values())]
        struct.pack_into(f"={len(nodes)}d", self._raw_bytes, 0, *map(_VALUE, nodes))
        self._nodes = nodes[: -len(truth.SLOW)] if self._stands_still() else nodes
        self._pack = struct.Struct(f"={len(self._nodes)}d").pack_into
        self._elevator, self._aileron, self._rudder, self._throttle = (
            _node(fdm, f"fcs/{name}-cmd-norm").set_double_value
            for name in ("elevator", "aileron", "rudder", "throttle")
        )
        self._air = [_node(fdm, f"atmosphere/gust-{axis}-fps") for axis in ("north", "east", "down")]
        self._air_changes_s = 0.0
        self._run = fdm.run
        self._fdm = fdm
        self._actuator = self._frame = np.zeros(0)
        self._block: Block | None = None
        self._broken = False
        self.trim[:] = [fdm[name] for name in positions]
        self._fixed = truth.fixed(airframe, fdm["position/lat-geod-rad"], fdm["position/long-gc-rad"])
        self._write_row = bind(truth.write_row, new_block(1), 0, self._raw, self._fixed)

    def _stands_still(self) -> bool:
        """Whether mass and wind are those of the first frame throughout the flight."""
        air = self._wind
        changes = air.steps or air.gusts or air.down_m_s or self._severity.exceedance_index
        return self._airframe.freeze_fuel and not changes

    def read(self, block: Block, k: int) -> int:
        """Write truth (but the sticks), flight, two discretes and ``end`` of row k; returns the end code."""
        self._pack(self._raw_bytes, 0, *map(_VALUE, self._nodes))
        if self._broken:
            self._raw["p_rad_s"] = np.nan
        return self._write_row(block, k, self._raw, self._fixed)

    def step(self, block: Block, k: int) -> None:
        """Give row k's ``actuator`` to the actuators and fly to the next frame."""
        if block is not self._block:  # a field of a structured array is slow to look up
            self._block, self._actuator, self._frame = block, block["actuator"], block["frame"]
        elevator, aileron, rudder, throttle = self._actuator[k].tolist()
        self._elevator(elevator)
        self._aileron(aileron)
        self._rudder(rudder)
        self._throttle(throttle)
        if self._air_changes_s < inf:
            self._move_air((int(self._frame[k]) + 1) / self._rate_hz)
        try:
            for _ in self._steps:
                self._run()
        except jsbsim.BaseError as error:
            log.warning("frame %d: %s", self._frame[k], error)
            self._broken = True

    def _move_air(self, time_s: float) -> None:
        if time_s < self._air_changes_s:
            return
        for node, speed in zip(self._air, wind.added(self._wind, time_s), strict=True):
            node.set_double_value(speed * FEET_PER_METRE)
        self._air_changes_s = wind.next_change(self._wind, time_s)


def _node(fdm: jsbsim.FGFDMExec, name: str) -> jsbsim.FGPropertyNode:
    node = fdm.get_property_manager().get_node(name)
    if node is None:
        raise RigError(f"JSBSim has no property {name!r}")
    return node


def _set_turbulence(fdm: jsbsim.FGFDMExec, severity: wind.Severity, seed: int) -> None:
    # After the trim, which wants calm air; always seeded, so that no flight draws from elsewhere.
    fdm["simulation/randomseed"] = seed % 2**31
    fdm["atmosphere/turb-type"] = _TUSTIN if severity.exceedance_index else 0
    milspec = "atmosphere/turbulence/milspec"
    fdm[f"{milspec}/windspeed_at_20ft_AGL-fps"] = severity.wind_at_20ft_knots * _FPS_PER_KNOT
    fdm[f"{milspec}/severity"] = severity.exceedance_index
