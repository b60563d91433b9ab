"""The inertial unit: body rates, velocity and specific force from one box that is no channel of any signal.

The references read it, so it has to fail on its own: ``[[faults]]`` with ``signal = "inertial.<quantity>"``.
Rates and specific force are those of the box, which sits at the centre of gravity with a mounting misalignment; the
velocity is over ground.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import NDArray
from pydantic import Field

from rig.core.frame import FLIGHT_INDEX, INERTIAL, Block, sig
from rig.core.kernels import kernel
from rig.core.settings import Settings, record, share_in_frame
from rig.core.units.angles import limit

QUANTITIES: Final = len(INERTIAL)
RATES: Final = 3  # the first three of INERTIAL, then three of the velocity, then three of the specific force
FORCES: Final = INERTIAL.index("specific_force_forward_m_s2")
_LIMITS: Final = {"rad_s": 7.0, "m_s": 1000.0, "m_s2": 200.0}  # full scale to both sides, by unit


class Config(Settings):
    """The ``[inertial]`` table: one box, so one figure for its rates, one for its velocity, one for its forces."""

    rate_noise_std_rad_s: float = Field(ge=0)  # white, per sample
    rate_bias_tolerance_rad_s: float = Field(ge=0)  # uniform within +- this, drawn once a flight
    velocity_noise_std_m_s: float = Field(ge=0)
    velocity_bias_tolerance_m_s: float = Field(ge=0)
    force_noise_std_m_s2: float = Field(ge=0)
    force_bias_tolerance_m_s2: float = Field(ge=0)
    force_scale_tolerance: float = Field(ge=0, lt=1)  # relative
    force_quantum_m_s2: float = Field(ge=0)  # least significant bit; 0: none
    misalignment_tolerance_rad: float = Field(ge=0, le=0.1)  # of the mounting, about each axis
    lag_s: float = Field(ge=0)  # time constant of the whole chain


PARAMS: Final = np.dtype(
    [
        ("bias", "f8", (QUANTITIES,)),
        ("gain", "f8", (QUANTITIES,)),  # 1 + scale error
        ("noise_std", "f8", (QUANTITIES,)),
        ("low", "f8", (QUANTITIES,)),
        ("high", "f8", (QUANTITIES,)),
        ("turn", "f8", (3,)),  # small angles from the aircraft's axes to those of the box
        ("quantum", "f8"),  # of the specific force
        ("blend", "f8"),  # share of a new sample that passes the lag in one frame
    ],
    align=True,
)
STATE: Final = np.dtype([("lagged", "f8", (QUANTITIES,)), ("seen", "f8", (QUANTITIES,)), ("started", "u1")], align=True)
_VELOCITY: Final = FLIGHT_INDEX["velocity_north_m_s"]
_FORCE: Final = FLIGHT_INDEX["specific_force_forward_m_s2"]


class InertialData(NamedTuple):
    """Data of the inertial unit besides the row; the draws, standard normal, are those of a block of n rows."""

    params: NDArray[Any]  # (1,) PARAMS
    noise: NDArray[np.float32]  # (n, 6) of rates and velocity
    force_noise: NDArray[np.float32]  # (n, 3) of the specific force
    state: NDArray[Any]  # (1,) STATE, in place


def ranges() -> NDArray[np.float64]:
    """Return (len(INERTIAL), 2) lowest and highest value of each quantity."""
    full = [next(limit for unit, limit in _LIMITS.items() if name.endswith(unit)) for name in INERTIAL]
    return np.array([(-value, value) for value in full])


class Inertial:
    """Truth to ``inertial``.  ``seeds`` gives independent streams: calibration and noise, then those of the forces."""

    def __init__(self, config: Config, rate_hz: float, seeds: SeedSequence) -> None:
        # The order is part of every recorded flight: append, never insert.
        calibration, noise, force_calibration, force_noise = map(np.random.default_rng, seeds.spawn(4))
        self.params = _params(config, rate_hz, calibration, force_calibration)
        self.state: NDArray[Any] = np.zeros(1, STATE)
        self._noise_rng, self._force_rng = noise, force_noise
        self._noise = np.zeros((0, FORCES), np.float32)
        self._force_noise = np.zeros((0, QUANTITIES - FORCES), np.float32)

    @property
    def data(self) -> InertialData:
        """The data of ``sense`` besides the row; the same arrays until the next ``prepare``."""
        return InertialData(self.params, self._noise, self._force_noise, self.state)

    def prepare(self, block: Block) -> None:
        """Draw the noise of the rows of ``block``; the streams do not depend on the block's length."""
        rows = len(block)
        if len(self._noise) < rows:
            self._noise = np.zeros((rows, FORCES), np.float32)
            self._force_noise = np.zeros((rows, QUANTITIES - FORCES), np.float32)
        self._noise_rng.standard_normal(out=self._noise[:rows], dtype=np.float32)
        self._force_rng.standard_normal(out=self._force_noise[:rows], dtype=np.float32)


def _params(config: Config, rate_hz: float, rng: Generator, force_rng: Generator) -> NDArray[np.void]:
    """Return the (1,) PARAMS record; all errors are drawn, whatever their tolerance."""
    draw = rng.uniform(-1.0, 1.0, FORCES + 3)  # of rates and velocity, and three of the mounting
    bias, scale = force_rng.uniform(-1.0, 1.0, (2, QUANTITIES - FORCES))
    tolerances = np.repeat([config.rate_bias_tolerance_rad_s, config.velocity_bias_tolerance_m_s], RATES)
    noise_std = [config.rate_noise_std_rad_s, config.velocity_noise_std_m_s, config.force_noise_std_m_s2]
    low, high = ranges().T
    return record(
        PARAMS,
        bias=np.concatenate([tolerances * draw[:FORCES], config.force_bias_tolerance_m_s2 * bias]),
        gain=np.concatenate([np.ones(FORCES), 1.0 + config.force_scale_tolerance * scale]),
        noise_std=np.repeat(noise_std, RATES),
        low=low,
        high=high,
        turn=config.misalignment_tolerance_rad * draw[FORCES:],
        quantum=config.force_quantum_m_s2,
        blend=share_in_frame(config.lag_s, rate_hz),
    )


@kernel
def sense(truth, bus, k, data):
    """Measure the inertial unit in row k of a block.

        x = (w - turn x w, v, f - turn x f);  y += blend (x - y);  sample = gain y + bias + noise, within its range

    w : body rates p, q, r [rad/s]; v : velocity over ground, north, east, down [m/s]; f : specific force at the
    centre of gravity, forward, right, down [m/s2], rounded to its quantum
    truth, bus : the row's TRUTH and BUS records; data : InertialData.  Writes inertial.
    """
    u, st = data.params[0], data.state[0]
    rates, flight, inertial = truth["truth"], truth["flight"], bus["inertial"]
    seen, lagged, turn, quantum = st["seen"], st["lagged"], u["turn"], u["quantum"]
    misalign(rates[sig.P], rates[sig.Q], rates[sig.R], turn, seen, 0)
    for i in range(RATES):
        seen[RATES + i] = flight[_VELOCITY + i]
    misalign(flight[_FORCE], flight[_FORCE + 1], flight[_FORCE + 2], turn, seen, FORCES)
    for i in range(QUANTITIES):
        if st["started"] == 0:
            lagged[i] = seen[i]
        lagged[i] += u["blend"] * (seen[i] - lagged[i])
        drawn = data.noise[k, i] if i < FORCES else data.force_noise[k, i - FORCES]
        sample = u["gain"][i] * lagged[i] + u["bias"][i] + u["noise_std"][i] * drawn
        if i >= FORCES and quantum > 0.0:
            sample = np.floor(sample / quantum + 0.5) * quantum
        inertial[i] = limit(sample, u["low"][i], u["high"][i], 0)
    st["started"] = 1


@kernel
def misalign(x, y, z, turn, out, first):
    """Write a vector of the aircraft's axes in those of the box to ``out`` from ``first`` on: v - turn x v."""
    out[first] = x - (turn[1] * z - turn[2] * y)
    out[first + 1] = y - (turn[2] * x - turn[0] * z)
    out[first + 2] = z - (turn[0] * y - turn[1] * x)
