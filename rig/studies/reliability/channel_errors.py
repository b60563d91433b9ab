"""Draw constant channel errors of a flight so that errors which set channels apart are frequent (importance sampling).

A tenth of all flights has errors as in the sensor model: bias, gain and skew uniform within their tolerances.  In the
other flights some channels are near one end of their tolerances and the rest near the other end, one or two against the
others, each Beta(1, kappa) of the range away from its end.  Each flight has the weight p / q: the probability density
of its errors in the sensor model, divided by the density with which they were drawn.
Source: importance sampling with a defensive mixture, Hesterberg (1995).
"""

from __future__ import annotations

from itertools import product
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from rig.core.frame import CHANNELS
from rig.core.units.angles import step_sizes
from rig.world.sensors import Sensor

Floats = NDArray[np.float64]
NOMINAL: Final = 0.1  # of all flights
KAPPAS: Final = (2.0, 8.0, 32.0)
COUNTS_FROM: Final = 0.1
KINDS: Final = 3  # bias, gain, skew, as sensors.params.calibrate takes them


class Ends(NamedTuple):
    """The ends near which errors are drawn: +1 and -1 by arrangement, kind and channel; 0: as in the sensor model."""

    signs: Floats  # (A, 3, 4)

    @property
    def any(self) -> bool:
        """Return True if the sensor has errors that are constant over a flight."""
        return bool(self.signs.any())


def ends(sensor: Sensor, truth: Floats, wraps: bool, least: float = COUNTS_FROM) -> Ends:
    """Return the arrangements of a sensor on a recorded truth (N,); a single one of zeros without constant errors.

    least : share of the total effect of all kinds of errors from which a kind is drawn near its ends
    """
    moved = step_sizes(truth, wraps).max(initial=0.0)
    effects = np.array(
        [
            2.0 * sensor.bias_tolerance,
            2.0 * sensor.scale_tolerance * float(np.abs(truth).max()),
            sensor.skew_frames * float(moved),
        ]
    )
    drawn = [kind for kind in range(KINDS) if effects[kind] > 0.0 and effects[kind] >= least * effects.sum()]
    if not drawn:
        return Ends(np.zeros((1, KINDS, CHANNELS)))
    sides = [side for side in product((1.0, -1.0), repeat=sensor.channels) if len(set(side)) > 1]
    turns = list(product((1.0, -1.0), repeat=len(drawn) - 1))
    signs = np.zeros((len(sides) * len(turns), KINDS, CHANNELS))
    for row, (side, turn) in zip(signs, product(sides, turns), strict=True):
        row[drawn, : sensor.channels] = np.outer((1.0, *turn), side)
    return Ends(signs)


def drawn_errors(
    given: Ends, flights: int, rng: Generator, kappas: tuple[float, ...] = KAPPAS
) -> tuple[Floats, Floats]:
    """Return (3, E, 4) errors within -1 to 1 of their tolerances, and the weight (E,) of each flight."""
    errors = rng.uniform(-1.0, 1.0, (flights, KINDS, CHANNELS))
    signs = given.signs[rng.integers(0, len(given.signs), flights)]
    kappa = rng.choice(kappas, flights)[:, None, None]
    away = 1.0 - rng.random(errors.shape) ** (1.0 / kappa)  # Beta(1, kappa)
    near = signs * (1.0 - 2.0 * away)
    tilted = (rng.random(flights) >= NOMINAL)[:, None, None] & (signs != 0.0)
    errors = np.where(tilted, near, errors)
    return errors.transpose(1, 0, 2), 1.0 / _density(given, errors, kappas)


def _density(given: Ends, errors: Floats, kappas: tuple[float, ...]) -> Floats:
    """Return (E,) how much more often errors (E, 3, 4) are drawn than they occur in the sensor model."""
    tiny = np.finfo(float).tiny
    flat, signs = errors.reshape(len(errors), -1), given.signs.reshape(len(given.signs), -1)
    high, low = np.log(np.maximum((1.0 + flat) / 2.0, tiny)), np.log(np.maximum((1.0 - flat) / 2.0, tiny))
    near = high @ (signs > 0.0).T + low @ (signs < 0.0).T  # (E, A), log of the product of 1 - B
    held = np.count_nonzero(signs, axis=1)
    tilted = [np.exp(held * np.log(kappa) + (kappa - 1.0) * near).mean(axis=1) for kappa in kappas]
    return NOMINAL + (1.0 - NOMINAL) * np.mean(tilted, axis=0)


def corners(given: Ends, each: int, rng: Generator) -> Floats:
    """Return (3, A x each, 4) errors exactly at the ends, every arrangement ``each`` times in a row."""
    signs = np.repeat(given.signs, each, axis=0)
    return np.where(signs != 0.0, signs, rng.uniform(-1.0, 1.0, signs.shape)).transpose(1, 0, 2)
