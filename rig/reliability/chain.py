"""A continuous-time Markov chain of constant rates: the probability of each state after some hours.

No number is ever subtracted from another of its size, so the smallest probability keeps its digits beside the largest,
whatever the spread of the rates.  P(h) = exp(Q h) for a step h in which a state is hardly left is a Taylor series of
non-negative terms; it is then squared until h is the whole time.  Every row is divided by its sum after each squaring:
a row is a distribution, and its rounding would double with each squaring otherwise.
Source: docs/reliability.md, 'The chain'; scaling and squaring as in Moler and Van Loan (2003), method 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, log2
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LEFT: Final = 1.0 / 16.0  # of a state in one step, at most
TERMS: Final = 60  # of the series at most: (1 / 16)^60 / 60! is below the smallest double
SPARSE: Final = 64  # states from which a chain is taken to have few transitions beside its states squared


def probabilities(rates: Floats, start: int, hours: float) -> Floats:
    """Return the probability (..., n) of every state ``hours`` after the chain was in state ``start``.

    rates : (..., n, n) per hour from the row's to the column's state, none negative, diagonal zero
    Relative error of each about 1e-14, down to the smallest number that a double holds.
    """
    return transitions(rates, hours, [start])[..., 0, :]


def transitions(rates: Floats, hours: float, rows: Sequence[int] | None = None) -> Floats:
    """Return the probability (..., k, n) of every state ``hours`` after each of ``rows``, or after each of all.

    rates : as above
    """
    leaving = rates.sum(axis=-1)
    fastest = float(leaving.max(initial=0.0)) * hours
    wanted = np.arange(rates.shape[-1]) if rows is None else np.array(rows)
    if not fastest > 0.0:
        shape = (*rates.shape[:-2], len(wanted), rates.shape[-1])
        return np.broadcast_to(np.eye(rates.shape[-1])[wanted], shape).copy()
    halvings = max(0, ceil(log2(fastest / LEFT)))
    step = hours / 2.0**halvings
    if halvings == 0:
        return _series(rates * step, leaving * step, wanted)
    found = _series(rates * step, leaving * step, np.arange(rates.shape[-1]))
    for _ in range(halvings):
        found = _distributions(found @ found)
    return found[..., wanted, :]


def _series(jumps: Floats, leaving: Floats, rows: NDArray[np.int64]) -> Floats:
    """Return the transitions (..., k, n) from ``rows`` in a step in which a state is left LEFT times or less.

    exp(Q h) = exp(-L) exp(Q h + L I), with L the largest of ``leaving`` (..., n): the first factor is the same for all
    of a row, whose sum is one.
    """
    identity = np.eye(jumps.shape[-1])
    staying = leaving.max(axis=-1, keepdims=True) - leaving
    positive = jumps + staying[..., None] * identity
    factor = _sparse(positive) if positive.ndim == 2 and len(positive) >= SPARSE else positive
    found = term = np.broadcast_to(identity[rows], (*jumps.shape[:-2], len(rows), jumps.shape[-1]))
    for k in range(1, TERMS + 1):
        term = term @ factor / k
        found = found + term
        if (term <= np.finfo(float).eps / 16.0 * found).all():
            break
    return _distributions(found)


def _sparse(matrix: Floats) -> Any:
    from scipy.sparse import csr_array  # a third of a second, for large chains alone

    return csr_array(matrix)


def _distributions(matrix: Floats) -> Floats:
    """Divide rows by their sums."""
    return matrix / matrix.sum(axis=-1, keepdims=True)
