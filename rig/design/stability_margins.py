"""Gain and phase margins of a sampled loop, from the eigenvalues of the closed loop.

The loop is broken at one actuator, and all others stay closed.  The command is multiplied by the complex factor
``g exp(-i phi)``; the gain and phase margins are the factors at which an eigenvalue leaves the unit circle.  Unlike a
Bode plot, this also holds for a loop that is unstable when open, where a *smaller* gain is as dangerous as a larger.

The model contains everything between one command and the next:

    command -> one frame of delay -> hold -> actuator lag -> airframe -> sensor lag -> sample

The hold counts as half a frame, so the delay is one and a half frames in all.  It is exact: the
chain from hold to sample is one linear system, discretised by the matrix exponential.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from rig.computer.control.gains_file import Margin

Matrix = NDArray[np.float64]

FARTHEST_GAIN_DB = 40.0
FARTHEST_PHASE_DEG = 120.0


@dataclass(frozen=True, slots=True)
class Loop:
    """The open loop x+ = F x + G u with the control law u = -K x; the law's own integrators are in x."""

    f: Matrix
    g: Matrix
    k: Matrix
    period_s: float
    growth_1_s: float = 0.0  # a slower growth than this still counts as stable

    def closed(self, factors: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the system matrix of the closed loop when command j is multiplied by ``factors[j]``."""
        return np.asarray(self.f - (self.g * factors) @ self.k, np.complex128)

    def stable(self, actuator: int = 0, factor: complex = 1.0) -> bool:
        """Return True if no eigenvalue grows faster than ``growth_1_s`` with ``factor`` in one actuator's command."""
        factors = np.ones(self.g.shape[1], np.complex128)
        factors[actuator] = factor
        radius = float(np.max(np.abs(np.linalg.eigvals(self.closed(factors)))))
        return radius < math.exp(self.growth_1_s * self.period_s)


def sampled_loop(
    a: Matrix, b: Matrix, c: Matrix, d: Matrix, lags_s: list[float], sensor_lag_s: float, period_s: float
) -> tuple[Matrix, Matrix, Matrix]:
    """Return the chain of the module's docstring as (F, G, H): x+ = F x + G u, sampled y = H x.

    a, b, c, d   airframe; its inputs are the surface positions, its outputs are the inputs of the law
    lags_s       first-order lag of each actuator [s]
    sensor_lag_s first-order lag of every measured output [s]
    """
    n, m, p = a.shape[0], b.shape[1], c.shape[0]
    rates = np.diag(1.0 / np.array(lags_s))
    chain = np.block(
        [
            [a, b, np.zeros((n, p))],
            [np.zeros((m, n)), -rates, np.zeros((m, p))],
            [c / sensor_lag_s, d / sensor_lag_s, -np.eye(p) / sensor_lag_s],
        ]
    )
    drive = np.vstack([np.zeros((n, m)), rates, np.zeros((p, m))])
    size = n + m + p
    step = np.asarray(expm(np.block([[chain, drive], [np.zeros((m, size + m))]]) * period_s), np.float64)
    # u enters a one-frame memory, and the chain gets the content of the memory.
    f = np.block([[step[:size, :size], step[:size, size:]], [np.zeros((m, size + m))]])
    g = np.vstack([np.zeros((size, m)), np.eye(m)])
    h = np.hstack([np.zeros((p, n + m)), np.eye(p), np.zeros((p, m))])
    return f, g, h


def holds(loop: Loop, actuator: int, gain_db: float, phase_deg: float) -> bool:
    """Return True if the loop is stable within +-``gain_db`` and up to ``phase_deg`` at this actuator."""
    decibels = np.linspace(-gain_db, gain_db, 9)
    factors = [complex(10.0 ** (x / 20.0)) for x in decibels]
    factors += [complex(np.exp(-1j * math.radians(x))) for x in np.linspace(phase_deg, 0.0, 4)[:-1]]
    return all(loop.stable(actuator, factor) for factor in factors)


def margins(loop: Loop, actuator: int) -> Margin:
    """Return the stability margins at ``actuator`` (a column of G); all zero if the loop is unstable."""
    if not loop.stable():
        return Margin(gain_increase_db=0.0, gain_decrease_db=0.0, phase_deg=0.0, crossover_rad_s=0.0)

    def stable_at_gain(decibel: float) -> bool:
        return loop.stable(actuator, 10.0 ** (decibel / 20.0))

    def stable_at_phase(degree: float) -> bool:
        return loop.stable(actuator, complex(np.exp(-1j * math.radians(degree))))

    return Margin(
        gain_increase_db=_first_failure(stable_at_gain, FARTHEST_GAIN_DB, 0.5),
        gain_decrease_db=_first_failure(lambda x: stable_at_gain(-x), FARTHEST_GAIN_DB, 0.5),
        phase_deg=_first_failure(stable_at_phase, FARTHEST_PHASE_DEG, 2.0),
        crossover_rad_s=crossover(loop, actuator),
    )


def _first_failure(stable: Callable[[float], bool], farthest: float, step: float) -> float:
    """Return the smallest x up to ``farthest`` where ``stable`` is false: a scan in steps, then bisection to 1e-3."""
    high = step
    while stable(high):
        if high >= farthest:
            return farthest
        high += step
    low = high - step
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def response(loop: Loop, actuator: int, omega: Matrix) -> NDArray[np.complex128]:
    """Return the loop gain L(exp(i w T)), broken at ``actuator``, at the frequencies ``omega`` [rad/s]."""
    others = np.ones(loop.g.shape[1], np.complex128)
    others[actuator] = 0.0
    system = loop.closed(others)
    unit = np.eye(system.shape[0])
    column, row = loop.g[:, actuator], loop.k[actuator]
    return np.array([row @ np.linalg.solve(z * unit - system, column) for z in np.exp(1j * omega * loop.period_s)])


def crossover(loop: Loop, actuator: int) -> float:
    """Return the highest frequency [rad/s] at which the loop gain is one; 0 when it never is."""
    omega = np.geomspace(0.01, 0.9 * math.pi / loop.period_s, 400)
    above = np.nonzero(np.abs(response(loop, actuator, omega)) >= 1.0)[0]
    if above.size == 0 or above[-1] == omega.size - 1:
        return 0.0 if above.size == 0 else float(omega[-1])
    low, high = omega[above[-1]], omega[above[-1] + 1]
    for _ in range(30):
        middle = math.sqrt(low * high)
        inside = abs(response(loop, actuator, np.array([middle]))[0]) >= 1.0
        low, high = (middle, high) if inside else (low, middle)
    return float(low)
