"""Requirements over the blocks of a flight or recording: columns that reach as far as the longest window are kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import BadInput
from rig.core.frame import Block, End, State, Table
from rig.core.text import choices, quoted
from rig.verdict.requirements.formula import CHANNEL, COMPARISONS, SIGNAL, Formula, body, read_formula
from rig.verdict.requirements.quantity_columns import BaselineColumns, Columns, Onsets
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.robustness import Held, decisive, frames_reach, refuse_empty_windows, values
from rig.verdict.requirements.subject import Quantity, Subject, holds, lookup, signals_of, unknown_of
from rig.world.faults.grammar import Op, Refused

Status = Literal["met", "violated", "not applicable"]
AT_ONCE: Final = 8192  # frames that are measured together: with the longest windows the bound of the memory
_EACH: Final = "9"  # for {channel} in a formula: no channel that there is


class Verdict(NamedTuple):
    """Verdict on a requirement for one signal; ``signal`` is empty where the formula is of none."""

    requirement: str
    signal: str
    status: Status
    robustness: float  # NaN where it is not applicable
    instant_s: float  # whose numbers give the robustness
    values: dict[str, tuple[float, str]]  # quantities of the formula at that instant, with their SI units


def not_applicable(requirement: str, signal: str = "") -> Verdict:
    """Return the verdict where nothing was there to decide on."""
    return Verdict(requirement, signal, "not applicable", np.nan, np.nan, {})


class Bound(NamedTuple):
    """A formula over the signals of a subject, on C channels at once if it is of each."""

    formula: Formula
    quantities: list[list[Quantity]]  # C, of the formula's names
    scales: tuple[float, ...]  # of its comparisons, where none are given
    back: int  # frames that its windows reach
    ahead: int


@lru_cache(maxsize=1024)
def bound(text: str, channels: int, about: Subject) -> Bound:
    """Return a formula over signals and discretes: many flights have the same.  Refused, BadInput."""
    every = lambda name: [_on(name, c) for c in range(1, channels + 1)]  # noqa: E731
    flag = lambda name: holds(name, about) and lookup(name, about).discrete < 0  # noqa: E731 # pyright: ignore
    missing = lambda name: next(each for each in every(name) if holds(each, about) or not lookup(each, about))  # noqa: E731
    formula = read_formula(
        text,
        lambda name: all(lookup(each, about) is not None and not flag(each) for each in every(name)),
        lambda name: all(holds(each, about) for each in every(name)),
        lambda name: _unknown(missing(name), about),
    )
    refuse_empty_windows(formula.root, about.rate_hz)
    on = [[_on(name, c) for name in formula.names] for c in range(1, channels + 1)]
    quantities = [[quantity for name in names if (quantity := lookup(name, about)) is not None] for names in on]
    scales = [1.0] * formula.comparisons
    for node in formula.root.walk():
        if node.op in COMPARISONS:  # the threshold of its signal, else 1
            of = [quantities[0][each.place] for each in node.walk() if each.op == Op.QUANTITY]
            scales[node.place] = next((about.signals[q.signal].threshold for q in of if q.measured), 1.0)
    return Bound(formula, quantities, tuple(scales), *frames_reach(formula.root, about.rate_hz))


def _on(name: str, channel: int) -> str:
    return f"{name[:-1]}{channel}" if name.endswith(f".{_EACH}") else name


def _unknown(name: str, about: Subject) -> str:
    return f"{quoted(name)} is a yes or no, not a number" if holds(name, about) else unknown_of(name, about)


@dataclass(slots=True)
class Measured:
    """A requirement on one signal while it is measured."""

    requirement: Requirement
    signal: str
    bound: Bound
    held: Held  # without columns
    pending: list[int] = field(default_factory=list)  # instants
    least: tuple[float, float] = (np.inf, 1.0)  # robustness and verdict so far
    instant: int = -1
    numbers: dict[str, tuple[float, str]] = field(default_factory=dict)  # there, of the channel that has it
    drawn: int = 0  # frames whose robustness are in ``line``
    line: list[NDArray[np.float64]] = field(default_factory=list)

    def measure(self, instants: Sequence[int], held: Held) -> None:
        """Measure it at ``instants``, in order; the least counts, not where it is NaN."""
        self.pending = [k for k in self.pending if k > instants[-1]]
        found = values(self.bound.formula.root, instants[0], instants[-1], held)
        found = np.where(np.isnan(found), np.inf, found)[..., np.array(instants) - instants[0]]
        verdicts, robustness = found.reshape(2, -1)  # channel after channel
        i = int(np.lexsort((verdicts, robustness))[0])
        least, (channel, instant) = (float(robustness[i]), float(verdicts[i])), divmod(i, len(instants))
        if least < self.least and least[0] < np.inf:
            alone = held.on(channel)
            self.least, self.instant = least, decisive(self.bound.formula.root, instants[instant], alone)
            row = held.columns[:, self.instant - held.first]
            self.numbers = {
                quantity.name: (float(row[place[0]]), quantity.unit)
                for quantity, place in zip(self.bound.quantities[channel], alone.rows, strict=True)
            }

    def draw(self, held: Held) -> None:
        """Add the robustness of the frames that can be measured."""
        node = body(self.bound.formula.root)
        end = held.end - (frames_reach(node, held.rate_hz)[1] if held.frames is None else 0)
        if end > self.drawn:
            self.line.append(np.fmin.reduce(values(node, self.drawn, end - 1, held)[1]))
            self.drawn = end

    def verdict(self) -> Verdict:
        """Return its verdict."""
        if self.instant < 0:
            return not_applicable(self.requirement.id, self.signal)
        robustness, verdict = self.least
        status: Status = "met" if verdict > 0.0 else "violated"
        at_s = self.instant / self.held.rate_hz
        return Verdict(
            self.requirement.id, self.signal, status, robustness + 0.0, at_s, self.numbers
        )  # 0.0, never -0.0


class RequirementsRecorder:
    """Measures requirements on rows that are given block after block: a recorder of ``rig.flight.loop.fly``."""

    def __init__(
        self,
        requirements: Sequence[Requirement],
        subject: Subject,
        baseline: Iterator[Block] | None = None,
        lines: bool = False,
    ) -> None:
        """BadInput: a requirement asks for what the subject does not have.

        baseline : the rows of the same flight without faults; required where a formula names ``baseline.``
        lines : keep the robustness of each frame too, 8 bytes for each formula
        """
        self.subject, self.requirements, self._lines = subject, tuple(requirements), lines
        on = [(each, *of) for each in requirements for of in _bind(each, subject)]
        named = {q.name: q for *_, made in on for of in made.quantities for q in of}
        self.quantities = sorted(named.values(), key=lambda quantity: quantity.parts.baseline)
        place = {quantity.name: i for i, quantity in enumerate(self.quantities)}
        self.measured = [_measured(*each, place, subject.rate_hz) for each in on]
        own = sum(not quantity.parts.baseline for quantity in self.quantities)
        if self.needs_baseline and baseline is None:
            raise BadInput(f"{self.quantities[own].name}: {subject.called} has no baseline here")
        self._own, self._columns = own, Columns(self.quantities[:own], subject)
        self._baseline = (
            BaselineColumns(baseline, Columns(self.quantities[own:], subject))
            if baseline and self.needs_baseline
            else None
        )
        self._parts, self._first, self._end, self._next = list[NDArray[np.float64]](), 0, 0, AT_ONCE
        self._lost, self._onsets, self._down = False, Onsets(), np.zeros(len(subject.signals), bool)

    @property
    def needs_baseline(self) -> bool:
        """Return whether a formula names ``baseline.``"""
        return any(q.parts.baseline for q in self.quantities)

    def record(self, table: Table) -> None:
        """Take the next frames (n,), of a flight or of a bench."""
        rows = table.rows
        if not len(rows) or not self.measured:
            return
        columns = np.empty((len(self.quantities), len(rows)))
        self._columns.fill(rows, columns[: self._own])
        if self._baseline is not None:
            self._baseline.fill(len(rows), columns[self._own :])
        self._parts.append(columns)
        self._find(rows, self._end)
        self._lost, self._end = bool(rows["end"][-1] != End.FLYING), self._end + len(rows)
        if self._end >= self._next:
            memory = self._measure()
            kept = [*(each.pending[0] - each.bound.back for each in self.measured if each.pending), self._end]
            kept += [self._end - each.bound.back for each in self.measured]
            kept += [each.drawn - each.bound.back for each in self.measured if self._lines]
            drop = max(min(kept) - self._first, 0)
            self._parts, self._first, self._next = [memory[:, drop:].copy()], self._first + drop, self._end + AT_ONCE

    def _find(self, rows: Block, first: int) -> None:
        """Add the instants in ``rows`` (n,), from frame ``first`` on, to what is pending."""
        onsets, lost = self._onsets.find(rows), self._losses(rows)
        for each in self.measured:
            match each.requirement.at:
                case "start":
                    frames = [0][first:]
                case "each onset":
                    frames = onsets
                case "each loss":
                    names = [each.signal] if each.signal else signals_of(each.requirement, self.subject)
                    frames = sorted({k for name in names for k in lost.get(name, ())})
            each.pending += [first + k for k in frames]

    def _losses(self, rows: Block) -> dict[str, list[int]]:
        """Return, by signal, the rows in which its level becomes 0; where no state is said, no level is."""
        signals = len(self._down)
        down = rows["level"][:, :signals] == 0
        if not down.any():
            self._down[:] = False
            return {}
        down &= (rows["state"][:, :signals] != State.ABSENT).any(axis=2)
        began = down & ~np.vstack([self._down, down[:-1]])
        self._down = down[-1].copy()
        return {
            self.subject.signals[i].name: np.flatnonzero(began[:, i]).tolist()
            for i in np.flatnonzero(began.any(axis=0))
        }

    def _measure(self, over: bool = False) -> NDArray[np.float64]:
        """Measure at the instants whose windows are held, where the flight is ``over`` at all; return what is held."""
        memory = np.concatenate([np.empty((len(self.quantities), 0)), *self._parts], axis=1)
        frames, lost = (self._end, self._lost) if over else (None, False)
        for each in self.measured:
            held = each.held._replace(seen={}, columns=memory, first=self._first, frames=frames, lost=lost)
            instants = [k for k in each.pending if over or k + each.bound.ahead < self._end]
            with np.errstate(all="ignore"):
                if instants:
                    each.measure(instants, held)
                if self._lines:
                    each.draw(held)
        return memory

    def finish(self) -> tuple[Verdict, ...]:
        """Return the verdicts: the flight is over, whatever windows reach beyond its end."""
        self._measure(over=True)
        verdicts = {each.id: list[Verdict]() for each in self.requirements}
        for each in self.measured:
            verdicts[each.requirement.id].append(each.verdict())
        return tuple(verdict for id_, all_of in verdicts.items() for verdict in all_of or [not_applicable(id_)])

    def lines(self) -> dict[tuple[str, str], NDArray[np.float64]]:
        """Return the robustness (n,) of each frame by requirement and signal, once finished; of channels the least.

        They are of the formula in each frame, without the windows around it; NaN where nothing was flown.
        """
        return {(each.requirement.id, each.signal): np.concatenate([[], *each.line]) for each in self.measured}


def _bind(requirement: Requirement, subject: Subject) -> Iterator[tuple[str, Bound]]:
    """Yield the formula of a requirement on each of its signals, or on none where it names none.  BadInput."""
    where, fitted = requirement.where, {watched.name: watched.channels for watched in subject.signals}
    for name in requirement.signals if isinstance(requirement.signals, list) else ():
        if name not in fitted:
            raise BadInput(f"{where}: signals: {subject.called} has no {quoted(name)}, {choices(name, list(fitted))}")
    about = replace(subject, frames=0, faults=(), limits=None, faulted=())  # what many flights have in common
    text = requirement.formula
    for signal in signals_of(requirement, subject) if SIGNAL in text else [""]:
        channels = fitted[signal] if CHANNEL in text else 1
        try:
            of_signal = text.replace(SIGNAL, signal)
            bound(of_signal.replace(CHANNEL, "1"), 1, about)  # refuses a literal _EACH
            made = bound(of_signal.replace(CHANNEL, _EACH), channels, about)
        except Refused as refused:
            raise BadInput(f"{where}: formula: column {refused.column}: {refused}") from None
        except BadInput as error:
            raise BadInput(f"{where}: formula: {error}") from None
        given, count = requirement.scale, made.formula.comparisons
        if isinstance(given, list) and len(given) != count:
            raise BadInput(f"{where}: scale: {len(given)} values for {count} comparisons, one each is needed")
        scales = made.scales if given is None else tuple(given) if isinstance(given, list) else (given,) * count
        yield signal, made._replace(scales=scales)


def _measured(requirement: Requirement, signal: str, made: Bound, place: dict[str, int], rate_hz: float) -> Measured:
    rows = [np.array([place[quantity.name] for quantity in of]) for of in zip(*made.quantities, strict=True)]
    rows = tuple(row[:1] if (row == row[0]).all() else row for row in rows)
    held = Held(np.empty((0, 0)), 0, rows, made.scales, rate_hz)
    return Measured(requirement, signal, made, held)
