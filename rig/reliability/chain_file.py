"""A chain given as rates in a TOML file: how published cases are run.

hours = 10.0
start = "4"
transitions = [
  { from = "4", to = "3", per_hour = 4e-3 },
]
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from pydantic import Field, field_validator, model_validator

from rig.reliability.chain import Floats, probabilities
from rig.settings import Settings, build, read_toml
from rig.text import choices, quoted

MOST_STATES: Final = 4000  # a matrix of them takes 128 MB


class Transition(Settings):
    """A way out of a state; several between the same two states add up."""

    from_: str = Field(alias="from", min_length=1)
    to: str = Field(min_length=1)
    per_hour: float = Field(ge=0)

    @model_validator(mode="after")
    def _elsewhere(self) -> Transition:
        if self.from_ == self.to:
            raise ValueError(f"a transition must lead to another state, got {quoted(self.to)} twice")
        return self


class ChainFile(Settings):
    """States are named by the transitions between them; one that nothing leaves is a death state."""

    hours: float = Field(ge=0, le=1e12)
    start: str
    transitions: list[Transition] = Field(min_length=1)

    @field_validator("transitions")
    @classmethod
    def _not_too_many(cls, transitions: list[Transition]) -> list[Transition]:
        if len(_names(transitions)) > MOST_STATES:
            raise ValueError(f"at most {MOST_STATES} states, got {len(_names(transitions))}")
        return transitions

    @model_validator(mode="after")
    def _begins_somewhere(self) -> ChainFile:
        names = _names(self.transitions)
        if self.start not in names:
            raise ValueError(f"start: no such state {quoted(self.start)}, {choices(self.start, names)}")
        return self


class ChainResult(NamedTuple):
    """Probability of every state after the hours of the file, in the order in which the file names them."""

    hours: float
    start: str
    probability: dict[str, float]
    death: list[str]  # states that nothing leaves

    @property
    def of_death(self) -> float:
        """Return the probability of all death states together."""
        return float(sum(sorted(self.probability[name] for name in self.death)))


def _names(transitions: list[Transition]) -> list[str]:
    return list(dict.fromkeys(name for one in transitions for name in (one.from_, one.to)))


def solve_file(path: Path) -> ChainResult:
    """Return the probabilities of the chain in ``path``; BadInput names the file and the key that is wrong."""
    given = build(ChainFile, read_toml(path), str(path))
    names = _names(given.transitions)
    found = probabilities(_rates(given, names), names.index(given.start), given.hours)
    left = {one.from_ for one in given.transitions if one.per_hour > 0.0}
    probability = dict(zip(names, found.tolist(), strict=True))
    return ChainResult(given.hours, given.start, probability, [name for name in names if name not in left])


def _rates(given: ChainFile, names: list[str]) -> Floats:
    """Return the transitions as a matrix (n, n), per hour."""
    place = {name: i for i, name in enumerate(names)}
    rates = np.zeros((len(names), len(names)))
    for one in given.transitions:
        rates[place[one.from_], place[one.to]] += one.per_hour
    return rates
