"""The linear plant: fly one aircraft by the matrices of its small motions, without JSBSim.

Same stage as jsbsim.Plant.  Continuous A and B become an exact step when the plant is built (the matrix
exponential of airframe and actuators together, commands held over the step).
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from rig.core.frame import SURFACES, Block, new_block
from rig.core.kernels import bind
from rig.core.settings import record
from rig.core.units.atmosphere import speed_of_sound
from rig.world.plant import dryden, small_motion, truth, wind
from rig.world.plant.airframe import OUTPUTS, FlightPoint, LinearConfig
from rig.world.plant.small_motion import ALTITUDE, PARAM

Matrix = NDArray[np.float64]
_DRAWN: Final = 1000  # frames of noise at a time
_S: Final = len(SURFACES)


def matrices(airframe: LinearConfig, true: bool = False) -> tuple[Matrix, Matrix, Matrix]:
    """Return A (n, n), B (n, 4) by SURFACES, C (8, n) by OUTPUTS; rows and columns not given are zero.

    true : with ``a_factor`` and ``b_factor``, as the aircraft flies; False: as its design has it
    """
    model = airframe.model
    a, b, c = np.array(model.A), np.zeros((len(model.A), _S)), np.zeros((len(OUTPUTS), len(model.A)))
    b[:, [SURFACES.index(name) for name in model.inputs]] = model.B
    c[[OUTPUTS.index(name) for name in model.outputs]] = model.C
    return (model.a_factor * a, model.b_factor * b, c) if true else (a, b, c)


def discretise(a: Matrix, b: Matrix, lags_s: Matrix, dt_s: float) -> tuple[Matrix, Matrix]:
    """Return F, G of x+ = F x + G c, x = [airframe, actuator positions]; exact while c is held."""
    n, m = b.shape
    chain = np.zeros((n + 2 * m, n + 2 * m))
    chain[:n, :n], chain[:n, n : n + m] = a, b
    chain[n : n + m, n:] = np.hstack([-np.diag(1.0 / lags_s), np.diag(1.0 / lags_s)])
    step = np.asarray(expm(chain * dt_s), np.float64)
    return np.ascontiguousarray(step[: n + m, : n + m]), np.ascontiguousarray(step[: n + m, n + m :])


class LinearPlant:
    """One linear aircraft in flight, read and moved as jsbsim.Plant is; what is no number ends the flight."""

    def __init__(
        self,
        airframe: LinearConfig,
        flight_point: FlightPoint,
        air: wind.Config,
        turbulence: wind.Turbulence,
        rate_hz: float,
        steps_per_frame: int,
        seed: int,
    ) -> None:
        self._airframe, self._point, self._wind, self._seed = airframe, flight_point, air, seed
        self._rate_hz, self._steps = rate_hz, range(steps_per_frame)
        self._speed = flight_point.mach * speed_of_sound(flight_point.altitude_m)
        self.trim = np.array([airframe.trim.elevator_rad, 0.0, 0.0, airframe.trim.throttle])
        self._param = self._parameters(1.0 / (rate_hz * steps_per_frame))
        self._fixed = truth.fixed(airframe, 0.0, 0.0)
        a, b, c = matrices(airframe, true=True)
        self._f, self._g = discretise(a, b, self._lags(), float(self._param["dt"][0]))
        self._outputs = np.hstack([c, np.zeros((len(OUTPUTS), _S))])
        self._rates = np.hstack([c @ a, c @ b])
        # Wind along slows the flow, from above and from the side it turns it.
        flow = np.zeros((len(OUTPUTS), 3))
        flow[0, 0], flow[4, 1], flow[1, 2] = -1.0, -1.0 / self._speed, -1.0 / self._speed
        self._jump = np.linalg.pinv(c) @ flow
        sigma = dryden.sigma(turbulence, flight_point.altitude_m)
        self._turbulent = sigma > 0.0
        self._stir = dryden.filters(sigma, self._speed, 1.0 / rate_hz)
        # A gust that no state of the model takes up would carry the aircraft with it: there is none.
        self._stir[2][:] *= [[c[0].any()], [c[4].any()], [c[1].any()]]
        self.reset()

    def _lags(self) -> Matrix:
        frame = self._airframe
        return np.array([frame.elevator.lag_s, frame.aileron.lag_s, frame.rudder.lag_s, frame.throttle.lag_s])

    def _parameters(self, dt_s: float) -> NDArray[Any]:
        frame = self._airframe
        low, high = np.array(frame.surface_limits).T
        surfaces = (frame.elevator, frame.aileron, frame.rudder)
        rates = [*(surface.rate_limit_rad_s for surface in surfaces), frame.throttle.rate_limit_1_s]
        return record(
            PARAM,
            dt=dt_s,
            airspeed=self._speed,
            pitch_angle=frame.trim.pitch_angle_rad,
            surface=self.trim,
            low=low,
            high=high,
            reach=np.array(rates) * self._lags(),
        )

    def give_back(self) -> None:
        """Do nothing: there is no model that another flight could use."""

    def reset(self) -> None:
        """Go back to the first frame: the same flight again, bit for bit."""
        self._x = np.array([*self._airframe.model.initial, *([0.0] * _S)], float)
        self._place = np.zeros(4)
        self._place[ALTITUDE] = self._point.altitude_m
        self._steady = np.array([self._wind.north_m_s, self._wind.east_m_s, 0.0])
        self._blowing = self._steady.copy()
        self._mean, self._air_changes_s = self._steady.copy(), 0.0
        self._z, self._gust = np.zeros(dryden.STATES), np.zeros(3)
        self._random = np.random.default_rng(self._seed)
        self._noise, self._drawn = np.zeros((_DRAWN, dryden.STATES)), _DRAWN
        self._raw = np.zeros(1, truth.RAW)
        workspace, command, outputs = np.zeros_like(self._x), np.zeros(_S), np.zeros((2, len(OUTPUTS)))
        x, place, param, raw = self._x, self._place, self._param, self._raw
        moved: tuple[Any, ...] = (x, workspace, command, place, self._f, self._g, param, raw)
        seen: tuple[Any, ...] = (x, place, self._blowing, self._outputs, self._rates, outputs, param, raw)
        self._of_move, self._of_evaluate, self._command = moved, seen, command
        self._move = bind(small_motion.move, *moved)
        self._of_blow = (x, self._mean, self._gust, self._blowing, place, self._jump)
        self._blow = bind(small_motion.blow, *self._of_blow)
        self._stirred = bind(dryden.stir, self._z, self._noise, 0, *self._stir, self._gust)
        self._advance = bind(small_motion.advance, self._place, 0.5, self._raw)
        self._evaluate = bind(small_motion.evaluate, *self._of_evaluate)
        self._write_row = bind(truth.write_row, new_block(1), 0, self._raw, self._fixed)
        self._evaluate(*self._of_evaluate)

    def read(self, block: Block, k: int) -> int:
        """Write truth (but the sticks), flight, two discretes and ``end`` of row k; returns the end code."""
        self._raw["latitude_rad"] = self._place[0] / self._fixed["north_m_per_rad"][0]
        self._raw["longitude_rad"] = self._place[1] / self._fixed["east_m_per_rad"][0]
        return self._write_row(block, k, self._raw, self._fixed)

    def step(self, block: Block, k: int) -> None:
        """Give row k's ``surface_command`` to the actuators and fly to the next frame."""
        self._command[:] = block["surface_command"][k]
        self._move_air((int(block["frame"][k]) + 1) / self._rate_hz)
        half_s = 0.5 * float(self._param["dt"][0])
        for _ in self._steps:
            self._move(*self._of_move)
            self._evaluate(*self._of_evaluate)
            self._advance(self._place, half_s, self._raw)
        self._evaluate(*self._of_evaluate)

    def _move_air(self, time_s: float) -> None:
        """Set the wind of the next frame; a change of it acts at once."""
        if time_s >= self._air_changes_s:
            self._mean[:] = wind.added(self._wind, time_s)
            self._mean += self._steady
            self._air_changes_s = wind.next_change(self._wind, time_s)
        elif not self._turbulent:
            return
        if self._turbulent:
            self._draw()
        self._blow(*self._of_blow)

    def _draw(self) -> None:
        if self._drawn == _DRAWN:
            self._random.standard_normal(out=self._noise)
            self._drawn = 0
        self._stirred(self._z, self._noise, self._drawn, *self._stir, self._gust)
        self._drawn += 1
