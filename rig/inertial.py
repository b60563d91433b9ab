"""The inertial unit: body rates and velocity from one box that is no channel of any signal.

The references read it, so it has to fail on its own: ``[[faults]]`` with ``signal = "inertial.<quantity>"``.
The rates are those of the box, which sits a little askew in the aircraft; the velocity is over ground.
"""

from __future__ import annotations

from math import exp
from typing import Any, Final

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import NDArray
from pydantic import Field

from rig.angles import limit
from rig.frame import FLIGHT_INDEX, INDEX, INERTIAL, Block
from rig.kernels import kernel
from rig.settings import Settings

QUANTITIES: Final = len(INERTIAL)
RATES: Final = 3  # the first three of INERTIAL; the others are the velocity
_LIMITS: Final = {"rad_s": 7.0, "m_s": 1000.0}  # full scale to both sides, by unit


class Config(Settings):
    """The ``[inertial]`` table: one box, so one figure for its rates and one for its velocity."""

    rate_noise_std_rad_s: float = Field(ge=0)  # white, per sample
    rate_bias_tolerance_rad_s: float = Field(ge=0)  # uniform within +- this, drawn once a flight
    velocity_noise_std_m_s: float = Field(ge=0)
    velocity_bias_tolerance_m_s: float = Field(ge=0)
    misalignment_tolerance_rad: float = Field(ge=0, le=0.1)  # of the mounting, about each axis
    lag_s: float = Field(ge=0)  # time constant of the whole chain


PARAMS: Final = np.dtype(
    [
        ("bias", "f8", (QUANTITIES,)),
        ("noise_std", "f8", (QUANTITIES,)),
        ("low", "f8", (QUANTITIES,)),
        ("high", "f8", (QUANTITIES,)),
        ("turn", "f8", (RATES,)),  # small angles from the aircraft's axes to those of the box
        ("blend", "f8"),  # share of a new sample that passes the lag in one frame
    ],
    align=True,
)
STATE: Final = np.dtype([("lagged", "f8", (QUANTITIES,)), ("started", "u1")], align=True)
_P, _Q, _R = INDEX["roll_rate"], INDEX["pitch_rate"], INDEX["yaw_rate"]
_VELOCITY: Final = FLIGHT_INDEX["velocity_north_m_s"]


def ranges() -> NDArray[np.float64]:
    """(len(INERTIAL), 2) lowest and highest value of each quantity."""
    full = [next(limit for unit, limit in _LIMITS.items() if name.endswith(unit)) for name in INERTIAL]
    return np.array([(-value, value) for value in full])


class Inertial:
    """Truth to ``inertial``.  ``seeds`` gives two independent streams: calibration and noise."""

    def __init__(self, config: Config, rate_hz: float, seeds: SeedSequence) -> None:
        calibration, noise = seeds.spawn(2)
        self.params = _params(config, rate_hz, np.random.default_rng(calibration))
        self.state: NDArray[Any] = np.zeros(1, STATE)
        self._noise_rng = np.random.default_rng(noise)
        self._noise = np.zeros((0, QUANTITIES), np.float32)

    @property
    def arguments(self) -> tuple[Any, ...]:
        """What ``sense`` needs besides the row; the same arrays until the next ``prepare``."""
        return self.params, self._noise, self.state

    def prepare(self, block: Block) -> None:
        """Draw the noise of the rows of ``block``; the stream does not depend on the block's length."""
        if len(self._noise) < len(block):
            self._noise = np.zeros((len(block), QUANTITIES), np.float32)
        self._noise_rng.standard_normal(out=self._noise[: len(block)], dtype=np.float32)

    def step(self, block: Block, k: int) -> None:
        """Write ``inertial`` of row k."""
        sense(block, k, *self.arguments)


def _params(config: Config, rate_hz: float, rng: Generator) -> NDArray[np.void]:
    """The (1,) PARAMS record; all errors are drawn, whatever their tolerance."""
    params = np.zeros(1, PARAMS)
    row = params[0]
    draw = rng.uniform(-1.0, 1.0, QUANTITIES + RATES)
    rates = np.arange(QUANTITIES) < RATES
    tolerance = np.where(rates, config.rate_bias_tolerance_rad_s, config.velocity_bias_tolerance_m_s)
    row["bias"] = tolerance * draw[:QUANTITIES]
    row["noise_std"] = np.where(rates, config.rate_noise_std_rad_s, config.velocity_noise_std_m_s)
    row["low"], row["high"] = ranges().T
    row["turn"] = config.misalignment_tolerance_rad * draw[QUANTITIES:]
    row["blend"] = 1.0 if config.lag_s == 0 else 1.0 - exp(-1.0 / (rate_hz * config.lag_s))
    return params


@kernel
def sense(block, k, params, noise, state):
    """The inertial unit in row k.

        x = (w - turn x w, v);  y += blend (x - y);  sample = y + bias + noise, within its range

    w : body rates p, q, r [rad/s]; v : velocity over ground, north, east, down [m/s]
    block : FRAME records; params : (1,) PARAMS; noise : (n, 6) standard normal; state : (1,) STATE, in place
    Writes inertial.
    """
    row, u, st = block[k], params[0], state[0]
    truth, flight, inertial = row["truth"], row["flight"], row["inertial"]
    p, q, r = truth[_P], truth[_Q], truth[_R]
    turn, lagged = u["turn"], st["lagged"]
    for i in range(QUANTITIES):
        x = p - (turn[1] * r - turn[2] * q)
        if i == 1:
            x = q - (turn[2] * p - turn[0] * r)
        elif i == 2:
            x = r - (turn[0] * q - turn[1] * p)
        elif i >= RATES:
            x = flight[_VELOCITY + i - RATES]
        if st["started"] == 0:
            lagged[i] = x
        lagged[i] += u["blend"] * (x - lagged[i])
        sample = lagged[i] + u["bias"][i] + u["noise_std"][i] * noise[k, i]
        inertial[i] = limit(sample, u["low"][i], u["high"][i], 0)
    st["started"] = 1
