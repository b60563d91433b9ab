"""The instants of requirements, found in the rows: the start, onsets of faults, losses of signals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.assess.requirements.columns import Onsets
from rig.assess.requirements.formula import Node
from rig.assess.requirements.margins import Held
from rig.assess.requirements.requirement import Requirement
from rig.assess.requirements.subject import Subject
from rig.frame import Block, State


@dataclass(slots=True)
class Least:
    """The least margin of a requirement on one signal so far, of all its channels."""

    least: tuple[float, float] = (np.inf, 1.0)  # margin and verdict
    instant: int = -1
    names: tuple[str, ...] = ()  # of the formula of the channel that has it
    places: list[int] = field(default_factory=list)  # of the names among all columns
    numbers: list[float] = field(default_factory=list)


class Over(NamedTuple):
    """One formula of a requirement over one signal, and where its numbers are: on C channels at once if of each."""

    requirement: Requirement
    signal: str
    root: Node
    names: list[tuple[str, ...]]  # C, of its quantities
    scales: list[float]  # of its comparisons
    back: int  # frames
    ahead: int
    places: list[list[int]]  # C, of the names among all columns
    rows: list[slice | list[int]]  # of each name: places, or one that all have in common

    @property
    def key(self) -> tuple[str, str]:
        """Requirement and signal, which it has in common with the other channels."""
        return self.requirement.id, self.signal

    def placed(self, order: dict[str, int]) -> Over:
        """Return it with the places of the names among all columns."""
        places = [[order[name] for name in names] for names in self.names]
        return self._replace(places=places, rows=[_rows(list(of)) for of in zip(*places, strict=True)])


def _rows(places: list[int]) -> slice | list[int]:
    """Return the rows of a name on each channel: a slice costs no copy."""
    first, count = places[0], len(places)
    if places == [first] * count:
        return slice(first, first + 1)
    return slice(first, first + count) if places == list(range(first, first + count)) else places


@dataclass(slots=True)
class Measured:
    """A formula while it is measured."""

    over: Over
    pending: list[int] = field(default_factory=list)  # instants
    least: Least = field(default_factory=Least)
    drawn: int = 0  # frames whose margins are in ``line``
    line: list[NDArray[np.float64]] = field(default_factory=list)

    def held(self, columns: NDArray[np.float64], first: int, rate_hz: float, end: tuple[int | None, bool]) -> Held:
        """Return the columns as this formula reads them."""
        return Held(columns, first, self.over.rows, self.over.scales, rate_hz, *end, seen={})


class Instants:
    """Finds the instants of requirements in the rows: the start, onsets of faults, losses of signals."""

    def __init__(self, measured: Sequence[Measured], subject: Subject) -> None:
        self._measured, self._subject = measured, subject
        self._begun = Onsets()
        self._were_lost: NDArray[Any] | None = None  # lost in the last row; None: no signal
        kinds = {formula.over.requirement.at for formula in measured}
        self._onsets, self._losses = "each onset" in kinds, "each loss" in kinds
        names = [watched.name for watched in subject.signals]
        self._places = {name: i for i, name in enumerate(names)}

    def find(self, rows: Block, first: int) -> None:
        """Add the instants in ``rows`` (n,), from frame ``first`` on, to what is pending."""
        onsets = self._begun.find(rows) if self._onsets else []
        losses = self._losses_in(rows) if self._losses else {}
        for formula in self._measured:
            match formula.over.requirement.at:
                case "start":
                    formula.pending += [0] if first == 0 else []
                case "each onset":
                    formula.pending += [first + k for k in onsets]
                case "each loss":
                    signals = [formula.over.signal] if formula.over.signal else _signals_of_loss(formula, self._subject)
                    lost = {k for name in signals for k in losses.get(self._places[name], ())}
                    formula.pending += [first + k for k in sorted(lost)]

    def _losses_in(self, rows: Block) -> dict[int, list[int]]:
        """Return, by signal, the rows in which its level becomes 0; where no state is said, no level is."""
        signals = len(self._places)
        lost = rows["level"][:, :signals] == 0
        if lost.any():
            lost &= (rows["state"][:, :signals] != State.ABSENT).any(axis=2)
        if not lost.any():
            self._were_lost = None
            return {}
        before = np.zeros(lost.shape[1], bool) if self._were_lost is None else self._were_lost
        began = lost & ~np.vstack([before, lost[:-1]])
        self._were_lost = lost[-1].copy()
        return {int(s): np.flatnonzero(began[:, s]).tolist() for s in np.flatnonzero(began.any(axis=0))}


def _signals_of_loss(formula: Measured, subject: Subject) -> list[str]:
    given = formula.over.requirement.signals
    if isinstance(given, list):
        return given
    return [watched.name for watched in subject.signals] if given == "*" else list(subject.faulted)
