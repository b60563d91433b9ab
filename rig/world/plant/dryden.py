"""Dryden turbulence as a filter of white noise, for an aircraft model without turbulence.

    along:         sigma sqrt(2 T)   1 / (1 + T s)
    across, down:  sigma sqrt(T)     (1 + sqrt(3) T s) / (1 + T s)^2        T = L / V

driven by white noise of unit intensity and discretised exactly, so that the standard deviation is sigma at
any frame rate.  Length L of MIL-F-8785C above 2000 ft; sigma as JSBSim's was measured over 20 minutes.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

from rig.core.kernels import kernel
from rig.world.plant.imperial import METRES_PER_FOOT
from rig.world.plant.wind import Turbulence

Matrix = NDArray[np.float64]
LENGTH_M: Final = 1750.0 * METRES_PER_FOOT
STATES: Final = 5  # one along, two across, two down
_ALTITUDE_M: Final = (1000.0, 3000.0, 6000.0, 9000.0, 10_700.0)
_SIGMA_M_S: Final[dict[Turbulence, tuple[float, ...]]] = {
    "none": (0.0, 0.0, 0.0, 0.0, 0.0),
    "light": (2.2, 1.8, 1.1, 0.5, 0.1),
    "moderate": (3.2, 2.9, 2.2, 1.8, 1.5),
    "severe": (6.6, 7.0, 6.4, 5.5, 4.9),
}


def sigma(turbulence: Turbulence, altitude_m: float) -> float:
    """Return the standard deviation [m/s] of each component."""
    return float(np.interp(altitude_m, _ALTITUDE_M, _SIGMA_M_S[turbulence]))


def filters(sigma_m_s: float, airspeed_m_s: float, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """Return F, L, C of z+ = F z + L n, wind = C z: (5, 5), (5, 5), (3, 5); n normal, wind along, across, down."""
    time = LENGTH_M / airspeed_m_s
    first = np.array([[-1.0 / time]]), np.array([[sqrt(2.0 / time)]])
    second = np.array([[0.0, 1.0], [-1.0 / time**2, -2.0 / time]]), np.array([[0.0], [1.0]])
    output = sigma_m_s * sqrt(time) / time**2 * np.array([[1.0, sqrt(3.0) * time]])
    f, noise = zip(*(_discrete(a, b, dt_s) for a, b in (first, second, second)), strict=True)
    c = block_diag(np.array([[sigma_m_s]]), output, output)
    return np.asarray(block_diag(*f)), np.asarray(block_diag(*noise)), np.asarray(c)


def _discrete(a: Matrix, b: Matrix, dt_s: float) -> tuple[Matrix, Matrix]:
    """Return the exact step of dz/dt = a z + b n, and the Cholesky factor of its noise (Van Loan 1978)."""
    n = len(a)
    step = np.asarray(expm(np.block([[-a, b @ b.T], [np.zeros((n, n)), a.T]]) * dt_s), np.float64)
    f = step[n:, n:].T
    gathered = f @ step[:n, n:]
    return f, np.asarray(np.linalg.cholesky(0.5 * (gathered + gathered.T)), np.float64)


@kernel
def stir(z, noise, k, f, gain, c, wind):
    """Move ``z`` (5,) by row k of ``noise`` (n, 5); write ``wind`` (3,), along, across, down."""
    size = len(z)
    for block, width in ((0, 1), (1, 2), (3, 2)):
        first, second = 0.0, 0.0
        for j in range(block, block + width):
            first += f[block, j] * z[j] + gain[block, j] * noise[k, j]
            if width == 2:
                second += f[block + 1, j] * z[j] + gain[block + 1, j] * noise[k, j]
        z[block] = first
        if width == 2:
            z[block + 1] = second
    for i in range(3):
        total = 0.0
        for j in range(size):
            total += c[i, j] * z[j]
        wind[i] = total
