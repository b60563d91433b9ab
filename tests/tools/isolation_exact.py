"""How often four channels with independent Gaussian noise are falsely isolated: exact, and nothing of the rig's.

Patterns of one frame by quadrature over the ordered samples; frames are independent, so counts of miscompares are a
Markov chain.  A split holds the counts; after it the manager waits as many frames as it has
lasted, ``split_persistence`` at most, in which they are held too (docs/explanation/decisions.md).
"""

from __future__ import annotations

from itertools import product
from math import pi, sqrt

import numpy as np

STEP = 0.004  # of the grid, standard deviations
HALVES, ALL_APART = (0, 1, 0), (1, 1, 1)  # gaps between neighbours in rank: without a majority


def patterns(threshold: float) -> dict[tuple[int, ...], float]:
    """The chance of each set of gaps larger than ``threshold``, standard deviations."""
    at = np.arange(-9.0, 9.0, STEP)
    density = np.exp(-0.5 * at**2) / sqrt(2.0 * pi) * STEP
    back = round(threshold / STEP)
    found: dict[tuple[int, ...], float] = {}
    for gaps in product((0, 1), repeat=3):
        part = density.copy()  # of samples so far, the largest at ``at``
        for gap in gaps:
            below = np.cumsum(part) - 0.5 * part
            far = np.concatenate([np.zeros(back), below[: len(below) - back]])
            part = density * (far if gap else below - far)
        found[gaps] = float(part.sum()) * 24.0
    return found


def isolations(threshold: float, persistence: int = 8, rate_hz: float = 100.0, wait: int = 10) -> float:
    """False isolations of a channel an hour; wait : ``split_persistence``, 0 for a manager that does not wait."""
    found = patterns(threshold)
    held = found[HALVES] + found[ALL_APART]
    alone = 0.0
    for gaps, chance in found.items():
        if gaps not in (HALVES, ALL_APART):
            ends = (1, *gaps, 1)
            alone += chance * sum(ends[i] and ends[i + 1] for i in range(4)) / 4.0
    return flux(alone, held, persistence, wait) * rate_hz * 3600.0


def flux(alone: float, held: float, persistence: int, wait: int) -> float:
    """Isolations a frame of one channel that begins again after each; states: count, run, wait left."""
    order = [(count, run, left) for count in range(persistence) for run in range(wait + 1) for left in range(wait + 1)]
    place = {state: i for i, state in enumerate(order)}
    moves, isolated = np.zeros((len(order), len(order))), np.zeros(len(order))
    for (count, run, left), i in place.items():
        moves[i, place[count, min(run + 1, wait), left]] += held
        left = max(left, run)
        if left > 0:
            moves[i, place[count, 0, left - 1]] += 1.0 - held
            continue
        fails = count + 1 == persistence
        moves[i, place[0, 0, 0]] += 1.0 - held - alone
        moves[i, place[0 if fails else count + 1, 0, 0]] += alone
        isolated[i] = alone * fails
    chance = np.zeros(len(order))
    chance[0] = 1.0
    matrix = moves.T - np.eye(len(order))
    matrix[0] = 1.0
    return float(np.linalg.solve(matrix, chance) @ isolated)
