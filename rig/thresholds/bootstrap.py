"""How far a designed threshold would move with other flights: blocks are drawn with replacement, not clusters.

Clusters of one flight have its manoeuvres, its temperature, its mounting in common; other flights have others.
Efron and Tibshirani, An Introduction to the Bootstrap (1993), percentile interval.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.thresholds.tail import Peaks, level, pareto

Floats = NDArray[np.float64]
DRAWS: Final = 1000
CONFIDENCE: Final = 0.95


def point(found: Peaks, budget_per_h: float) -> tuple[float, float]:
    """Return the threshold for the budget as the data have it, and the shape of their tail."""
    scale, shape = pareto(found.excess)
    rate = np.array([found.clusters / float(found.hours.sum())])
    return float(level(found.u, scale, shape, rate, budget_per_h)[0]), float(shape[0])


def draws(found: Peaks, budget_per_h: float, rng: np.random.Generator) -> Floats:
    """Return (DRAWS,) thresholds for the budget from as many draws of blocks."""
    count = len(found.hours)
    times = rng.multinomial(count, np.full(count, 1.0 / count), DRAWS).astype(np.float64)
    weights = times[:, found.block]
    scale, shape = pareto(found.excess, weights)
    rate = weights.sum(axis=1) / (times @ found.hours)
    return level(found.u, scale, shape, rate, budget_per_h)


def upper(thresholds: Floats) -> float:
    """Return the value that CONFIDENCE of the draws do not exceed."""
    return float(np.quantile(thresholds, CONFIDENCE))
