"""The second-order system of a sensor's low pass and of a structural mode, sampled once a frame.

x'' + 2 damping omega x' + omega^2 x = 0
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray


def transition(omega: float, damping: float, dt: float) -> NDArray[np.float64]:
    """(2, 2) matrix that takes (x, x') over ``dt`` seconds, exactly; ``omega`` in rad/s."""
    decay = damping * omega
    inside = 1.0 - damping**2
    if inside > 0:
        turn = omega * sqrt(inside)
        even, odd = exp(-decay * dt) * cos(turn * dt), exp(-decay * dt) * sin(turn * dt) / turn
    elif inside < 0:
        split = omega * sqrt(-inside)
        slow, fast = exp((split - decay) * dt), exp((-split - decay) * dt)
        even, odd = (slow + fast) / 2, (slow - fast) / (2 * split)
    else:
        even, odd = exp(-decay * dt), exp(-decay * dt) * dt
    return np.array([[even + decay * odd, odd], [-(omega**2) * odd, even - decay * odd]])


def natural_frequency(bandwidth_hz: float, damping: float) -> float:
    """rad/s of the low pass whose gain has fallen to 1/sqrt(2) at ``bandwidth_hz``."""
    inside = 1.0 - 2.0 * damping**2
    return 2.0 * pi * bandwidth_hz / sqrt(inside + sqrt(inside**2 + 1.0))
