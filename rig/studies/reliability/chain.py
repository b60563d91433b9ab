"""A continuous-time Markov chain with constant rates: the probability of each state after some hours.

The method never subtracts numbers of similar size, so the smallest probability keeps its digits for any spread of the
rates.  P(h) = exp(Q h), for a step h in which a state is hardly left, is a Taylor series of non-negative terms.  It is
squared until h is the whole time.  Each row is a distribution and is divided by its sum after each squaring; otherwise
its rounding error would double each time.
Source: docs/explanation/reliability.md, 'The chain'; scaling and squaring as in Moler and Van Loan (2003), method 3.

A TOML file may give the rates of a chain, for example of a published case:

hours = 10.0
start = "4"
transitions = [
  { from = "4", to = "3", per_hour = 4e-3 },
]
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, log2
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from rig.core.progress import tell
from rig.core.settings import Settings, build, read_toml
from rig.core.text import choices, quoted

Floats = NDArray[np.float64]
LEFT: Final = 1.0 / 16.0  # of a state in one step, at most
TERMS: Final = 60  # of the series at most: (1 / 16)^60 / 60! is below the smallest double
SPARSE: Final = 64  # states from which the transitions are taken to be few beside the number of states squared
LARGE: Final = 1000  # states from which a doubling takes long enough to be reported
MOST_STATES: Final = 4000  # of a file: a matrix of them takes 128 MB


def probabilities(rates: Floats, start: int, hours: float) -> Floats:
    """Return the probability (..., n) of every state ``hours`` after the chain was in state ``start``.

    rates : (..., n, n) per hour from the row's to the column's state, none negative, diagonal zero
    The relative error of each is about 1e-14, down to the smallest number of a double.
    """
    return transitions(rates, hours, [start])[..., 0, :]


def transitions(rates: Floats, hours: float, rows: Sequence[int] | None = None) -> Floats:
    """Return the probability (..., k, n) of every state ``hours`` after each of ``rows``, or after every state.

    rates : as in ``probabilities``
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
    after_step = _series(rates * step, leaving * step, np.arange(rates.shape[-1]))
    for done in range(halvings):
        if rates.shape[-1] >= LARGE:
            tell("doubling the time of the chain", done, halvings)
        after_step = _distributions(after_step @ after_step)
    return after_step[..., wanted, :]


def _series(jumps: Floats, leaving: Floats, rows: NDArray[np.int64]) -> Floats:
    """Return the transitions (..., k, n) from ``rows`` in a step in which a state is left LEFT times or less.

    exp(Q h) = exp(-L) exp(Q h + L I), with L the largest of ``leaving`` (..., n).  The first factor is the same for a
    whole row, whose sum is one.
    """
    identity = np.eye(jumps.shape[-1])
    staying = leaving.max(axis=-1, keepdims=True) - leaving
    positive = jumps + staying[..., None] * identity
    factor = _sparse(positive) if positive.ndim == 2 and len(positive) >= SPARSE else positive
    total = term = np.broadcast_to(identity[rows], (*jumps.shape[:-2], len(rows), jumps.shape[-1]))
    for k in range(1, TERMS + 1):
        term = term @ factor / k
        total = total + term
        if (term <= np.finfo(float).eps / 16.0 * total).all():
            break
    return _distributions(total)


def _sparse(matrix: Floats) -> Any:
    from scipy.sparse import csr_array  # a third of a second, for large chains alone

    return csr_array(matrix)


def _distributions(matrix: Floats) -> Floats:
    """Divide the rows by their sums."""
    return matrix / matrix.sum(axis=-1, keepdims=True)


class Transition(Settings):
    """A transition out of a state; several between the same two states add up."""

    from_: str = Field(alias="from", min_length=1)
    to: str = Field(min_length=1)
    per_hour: float = Field(ge=0, le=1e30)  # sums of rates stay finite

    @model_validator(mode="after")
    def _elsewhere(self) -> Transition:
        if self.from_ == self.to:
            raise ValueError(f"a transition must lead to another state; {quoted(self.to)} is given twice")
        return self


class ChainFile(Settings):
    """A chain whose states are named by its transitions; a state without a way out is a death state."""

    hours: float = Field(ge=0, le=1e12)
    start: str
    transitions: list[Transition] = Field(min_length=1)

    @field_validator("transitions")
    @classmethod
    def _not_too_many(cls, transitions: list[Transition]) -> list[Transition]:
        if len(_names(transitions)) > MOST_STATES:
            raise ValueError(f"{len(_names(transitions))} states, at most {MOST_STATES} are allowed")
        return transitions

    @model_validator(mode="after")
    def _begins_somewhere(self) -> ChainFile:
        names = _names(self.transitions)
        if self.start not in names:
            raise ValueError(f"start: no state {quoted(self.start)}, {choices(self.start, names)}")
        return self


class ChainResult(NamedTuple):
    """The probability of every state after the hours of the file, in the order of the file."""

    hours: float
    start: str
    probability: dict[str, float]
    death: list[str]  # states without a way out

    @property
    def of_death(self) -> float:
        """Return the total probability of the death states."""
        return float(sum(sorted(self.probability[name] for name in self.death)))


def _names(transitions: list[Transition]) -> list[str]:
    return list(dict.fromkeys(name for way in transitions for name in (way.from_, way.to)))


def solve_file(path: Path) -> ChainResult:
    """Return the probabilities of the chain in ``path``.  BadInput names the file and the wrong key."""
    given = build(ChainFile, read_toml(path), str(path))
    names = _names(given.transitions)
    values = probabilities(_rates(given, names), names.index(given.start), given.hours)
    left = {way.from_ for way in given.transitions if way.per_hour > 0.0}
    probability = dict(zip(names, values.tolist(), strict=True))
    return ChainResult(given.hours, given.start, probability, [name for name in names if name not in left])


def _rates(given: ChainFile, names: list[str]) -> Floats:
    """Return the transitions as a matrix (n, n), per hour."""
    place = {name: i for i, name in enumerate(names)}
    rates = np.zeros((len(names), len(names)))
    for way in given.transitions:
        rates[place[way.from_], place[way.to]] += way.per_hour
    return rates
