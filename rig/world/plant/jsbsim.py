"""Fly one aircraft in JSBSim, frame by frame; or in the linear plant where its settings ask for that."""

from __future__ import annotations

import struct
from math import inf
from typing import TYPE_CHECKING, Final

import jsbsim
import numpy as np
from numpy.typing import NDArray

from rig.core.errors import RigError
from rig.core.frame import SURFACES, Block, new_block
from rig.core.kernels import bind
from rig.world.plant import actuated, ground, shared_models, truth, wind
from rig.world.plant.airframe import Airframe, FlightPoint, LinearConfig
from rig.world.plant.imperial import FEET_PER_METRE
from rig.world.plant.loading import jsbsim_airframe, log

if TYPE_CHECKING:
    from rig.world.plant.linear_plant import LinearPlant

_FPS_PER_KNOT: Final = 1852.0 / 3600.0 * FEET_PER_METRE
_TUSTIN: Final = 4  # JSBSim's number of its Dryden turbulence in Tustin form
_HEIGHT: Final = [*truth.READ].index("height_ft")

_VALUE = jsbsim.FGPropertyNode.get_double_value  # mapped over the nodes: the quickest way to read many


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
        *,
        servos: bool = False,
    ) -> None:
        """servos : they move the surfaces, ``moved_by`` says where to; else JSBSim's lag does."""
        self._airframe = jsbsim_airframe(airframe)
        self._flight_point = flight_point
        self._wind = air
        self._severity = wind.SEVERITY[turbulence]
        self._seed = seed
        self._rate_hz = rate_hz
        self._steps = range(steps_per_frame)
        self._servos, self._positions = servos, np.zeros((0, 3))
        self._dt_s = 1.0 / (rate_hz * steps_per_frame)
        self._raw_bytes = bytearray(truth.RAW.itemsize)
        self._raw = np.frombuffer(self._raw_bytes, truth.RAW)  # the same memory, as one record
        self._now = memoryview(self._raw_bytes).cast("d")  # and as numbers
        self.trim = np.zeros(len(SURFACES))
        self.reset()

    def reset(self) -> None:
        """Go back to the first frame, on a fresh JSBSim: the same flight again, bit for bit."""
        airframe = self._airframe
        self._key = airframe, self._flight_point, self._dt_s, self._wind.steady, self._servos
        fdm = shared_models.trimmed(*self._key)
        _set_turbulence(fdm, self._severity, self._seed)
        surfaces = (airframe.elevator, airframe.aileron, airframe.rudder)
        positions = [*(surface.position for surface in surfaces), actuated.THROTTLE_POSITION]
        nodes = [_node(fdm, name) for name in (*truth.READ.values(), *positions, *truth.SLOW.values())]
        struct.pack_into(f"={len(nodes)}d", self._raw_bytes, 0, *map(_VALUE, nodes))
        air = self._wind
        changes = air.steps or air.gusts or air.down_m_s or self._severity.exceedance_index
        # Mass and wind may be those of the first frame throughout the flight.
        self._nodes = nodes[: -len(truth.SLOW)] if airframe.freeze_fuel and not changes else nodes
        self._pack = struct.Struct(f"={len(self._nodes)}d").pack_into
        self._elevator, self._aileron, self._rudder, self._throttle = (
            _node(fdm, f"fcs/{name}-cmd-norm").set_double_value
            for name in ("elevator", "aileron", "rudder", "throttle")
        )
        self._air = [_node(fdm, f"atmosphere/gust-{axis}-fps") for axis in ("north", "east", "down")]
        self._air_changes_s = 0.0
        self._ground = _node(fdm, ground.ENABLED).set_double_value
        self._near = True if ground.idles_in_air(fdm, airframe) else None  # ground reactions are on; None: all the time
        self._run = fdm.run
        self._fdm = fdm
        self._actuator = self._frame = np.zeros(0)
        self._block: Block | None = None
        self._broken = False
        self.trim[:] = [fdm[name] for name in positions]
        self._fixed = truth.fixed(airframe, fdm["position/lat-geod-rad"], fdm["position/long-gc-rad"])
        self._write_row = bind(truth.write_row, new_block(1), 0, self._raw, self._fixed)

    def give_back(self) -> None:
        """Hand the model over to the next flight; this one is over, and the aircraft did not depart."""
        if not self._broken and not self._severity.exceedance_index:  # turbulence leaves its filters behind
            shared_models.give_back(shared_models.key(*self._key), self._fdm, self._airframe)
        del self._fdm, self._run, self._nodes

    def moved_by(self, positions: NDArray[np.float64]) -> None:
        """Take the surfaces' positions in a frame's steps from ``positions`` (steps, 3), rad, at every ``step``."""
        self._positions = positions

    def read(self, block: Block, k: int) -> int:
        """Write truth (but the sticks), flight, two discretes and ``end`` of row k; returns the end code."""
        self._pack(self._raw_bytes, 0, *map(_VALUE, self._nodes))
        if (self._now[_HEIGHT] > ground.HIGH_FT) is self._near:
            self._near = not self._near
            self._ground(float(self._near))
        if self._broken:
            self._raw["p_rad_s"] = np.nan
        return self._write_row(block, k, self._raw, self._fixed)

    def step(self, block: Block, k: int) -> None:
        """Give row k's ``surface_command`` to the actuators and fly to the next frame."""
        if block is not self._block:  # a field of a structured array is slow to look up
            self._block, self._actuator, self._frame = block, block["surface_command"], block["frame"]
        elevator, aileron, rudder, throttle = self._actuator[k].tolist()
        self._throttle(throttle)
        if not self._servos:
            self._place(elevator, aileron, rudder)
        if self._air_changes_s < inf:
            self._move_air((int(self._frame[k]) + 1) / self._rate_hz)
        try:
            if self._servos:
                for positions in self._positions.tolist():
                    self._place(*positions)
                    self._run()
            else:
                for _ in self._steps:
                    self._run()
        except jsbsim.BaseError as error:
            log.warning("frame %d: %s", self._frame[k], error)
            self._broken = True

    def _place(self, elevator: float, aileron: float, rudder: float) -> None:
        self._elevator(elevator)
        self._aileron(aileron)
        self._rudder(rudder)

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


def plant(
    airframe: Airframe,
    flight_point: FlightPoint,
    air: wind.Config,
    turbulence: wind.Turbulence,
    rate_hz: float,
    steps_per_frame: int,
    seed: int,
    servos: bool = False,
) -> Plant | LinearPlant:
    """Return the aircraft, trimmed at ``flight_point``; BadInput when it cannot be loaded or trimmed there."""
    if isinstance(airframe, LinearConfig):
        from rig.world.plant.linear_plant import LinearPlant  # scipy's linear algebra takes its time, and few fly it

        return LinearPlant(airframe, flight_point, air, turbulence, rate_hz, steps_per_frame, seed)
    return Plant(airframe, flight_point, air, turbulence, rate_hz, steps_per_frame, seed, servos=servos)
