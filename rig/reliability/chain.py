"""A continuous-time Markov chain of constant rates: the probability of each state after some hours.

No number is ever subtracted from another of its size, so the smallest probability keeps its digits beside the largest,
whatever the spread of the rates.  P(h) = exp(Q h) for a step h so short that a state is left less than once is a Taylor
series of non-negative terms; it is then squared until h is the whole time.  Every row is divided by its sum after each
squaring: a row is a distribution, and its rounding would double with each squaring otherwise.
Source: docs/reliability.md, 'The chain'; scaling and squaring as in Moler and Van Loan (2003), method 3.
"""

from __future__ import annotations

from math import ceil, log2
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Floats = NDArray[np.float64]
TERMS: Final = 80  # of the series: 1 / 80! is 1e-119


def probabilities(rates: Floats, start: int, hours: float) -> Floats:
    """Probability (n,) of every state ``hours`` after the chain was in state ``start``.

    rates : (n, n) per hour from the row's to the column's state, none negative, diagonal zero
    Relative error of each about 1e-14, down to the smallest number that a double holds.
    """
    leaving = rates.sum(axis=1)
    fastest = float(leaving.max(initial=0.0)) * hours
    if not fastest > 0.0:
        return np.eye(len(rates))[start]
    halvings = max(0, ceil(log2(fastest)))
    step = hours / 2.0**halvings
    found = _series(rates * step, leaving * step)
    for _ in range(halvings):
        found = _distributions(found @ found)
    return found[start]


def _series(jumps: Floats, leaving: Floats) -> Floats:
    """The transition matrix (n, n) of a step in which a state is left at most once on the average.

    exp(Q h) = exp(-L) exp(Q h + L I), with L the largest of ``leaving`` (n,): the first factor is the same for all of a
    row, whose sum is one.
    """
    positive = csr_array(jumps + np.diag(leaving.max() - leaving))
    found = term = np.eye(len(jumps))
    for k in range(1, TERMS + 1):
        term = positive @ term / k
        if not term.any():
            break
        found = found + term
    return _distributions(found)


def _distributions(matrix: Floats) -> Floats:
    """Rows divided by their sums."""
    return matrix / matrix.sum(axis=1, keepdims=True)
