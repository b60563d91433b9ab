"""Requirements bound to a subject: their formulas with quantities, scales and reach, kept for the next flight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, NamedTuple

from rig.assess.requirements.formula import CHANNEL, COMPARISONS, SIGNAL, Formula, Node, read_formula
from rig.assess.requirements.instants import Over
from rig.assess.requirements.margins import frames_reach, refuse_empty_windows
from rig.assess.requirements.requirement import Requirement
from rig.assess.requirements.subject import Quantity, Subject, Watched, holds, lookup, unknown_of
from rig.errors import BadInput
from rig.faults.grammar import Op, Refused
from rig.text import choices, quoted


class Bound(NamedTuple):
    """A formula over the signals of a subject; scales : of its comparisons, where none are given; reach in frames."""

    formula: Formula
    quantities: tuple[Quantity, ...]
    scales: tuple[float, ...]
    back: int
    ahead: int


@dataclass(frozen=True, slots=True, eq=False)
class _About:
    """What formulas are over, one object for all flights that have it in common: its hash costs nothing."""

    subject: Subject


class Formulas(NamedTuple):
    """The formulas of requirements over a subject, and the quantities of their columns: those of the twin last."""

    over: tuple[Over, ...]
    quantities: tuple[Quantity, ...]
    own: int  # of the subject


_KEPT: Final = 16  # cases of a campaign that differ in the signals with faults
_LATEST: list[tuple[Sequence[Requirement], _About, tuple[str, ...], Formulas]] = []


def formulas_of(requirements: Sequence[Requirement], subject: Subject) -> Formulas:
    """Return the formulas of requirements, read once for the flights of a campaign, which ask for the same.  BadInput.

    Quantities of a family are neighbours, and so are the channels of a signal.
    """
    about = _about(subject.signals, subject.discretes, subject.offers, subject.called, subject.rate_hz)
    for asked, over, faulted, formulas in _LATEST:
        if asked is requirements and over is about and faulted == subject.faulted:
            return formulas
    named = dict[str, Quantity]()
    over = [each for requirement in requirements for each in _bind(requirement, subject, about, named)]
    quantities = sorted(named.values(), key=_neighbours)
    order = {quantity.name: i for i, quantity in enumerate(quantities)}
    own = sum(not quantity.parts.twin for quantity in quantities)
    formulas = Formulas(tuple(each.placed(order) for each in over), tuple(quantities), own)
    if isinstance(requirements, tuple):  # what nobody changes
        _LATEST[:] = [(requirements, about, subject.faulted, formulas), *_LATEST[: _KEPT - 1]]
    return formulas


def _neighbours(quantity: Quantity) -> tuple[bool, str, bool, int, int]:
    parts, discrete = quantity.parts, quantity.discrete >= 0
    return parts.twin, parts.family, discrete, max(quantity.signal, quantity.discrete), parts.channel


def _bind(requirement: Requirement, subject: Subject, about: _About, quantities: dict[str, Quantity]) -> list[Over]:
    """Return the formulas of a requirement on the subject's signals; their ``quantities`` are added."""
    bound_to: list[Over] = []
    for signal, text in texts_of(requirement, subject):
        try:
            bound = _bound(text, about)
        except Refused as refused:
            raise BadInput(f"{requirement.where}: formula: column {refused.column}: {refused}") from None
        except BadInput as error:
            raise BadInput(f"{requirement.where}: formula: {error}") from None
        quantities |= {each.name: each for each in bound.quantities}
        root, names, scales = bound.formula.root, bound.formula.names, _scales(requirement, bound)
        last = bound_to[-1] if bound_to else None
        if last is not None and last.signal == signal and last.root is root and last.scales == scales:
            last.names.append(names)  # of the next channel
        else:
            bound_to.append(Over(requirement, signal, root, [names], scales, bound.back, bound.ahead, [], []))
    return bound_to


def _signals(requirement: Requirement, subject: Subject) -> list[str]:
    """Return the signals that a requirement is measured on, or one that is empty."""
    names = [watched.name for watched in subject.signals]
    given = requirement.signals
    for name in given if isinstance(given, list) else ():
        if name not in names:
            accepted = choices(name, names)
            raise BadInput(f"{requirement.where}: signals: {subject.called} has no {quoted(name)}, {accepted}")
    named = names if given == "*" else list(subject.faulted) if given is None else list(given)
    return named if SIGNAL in requirement.formula else [""]


def texts_of(requirement: Requirement, subject: Subject) -> Iterator[tuple[str, str]]:
    """Yield signal and text of the formulas of a requirement: of each signal, and of each of its channels."""
    fitted = {watched.name: watched.channels for watched in subject.signals}
    for signal in _signals(requirement, subject):
        text = requirement.formula.replace(SIGNAL, signal)
        for channel in range(1, fitted[signal] + 1) if CHANNEL in text else (0,):
            yield signal, text.replace(CHANNEL, str(channel))


@lru_cache(maxsize=64)
def _about(
    signals: tuple[Watched, ...], discretes: tuple[Watched, ...], offers: frozenset[str], called: str, rate_hz: float
) -> _About:
    return _About(Subject(rate_hz, 0, signals, discretes, offers=offers, called=called))


@lru_cache(maxsize=4096)
def _bound(text: str, about: _About) -> Bound:
    """Return a formula over signals and discretes: many flights have the same.  Refused, BadInput."""
    subject, rate_hz = about.subject, about.subject.rate_hz
    formula = read_formula(
        text,
        lambda name: lookup(name, subject) is not None and not _is_flag(name, subject),
        lambda name: holds(name, subject),
        lambda name: _unknown(name, subject),
    )
    refuse_empty_windows(formula.root, rate_hz)
    formula = replace(formula, root=_one_of(formula.root))
    quantities = tuple(quantity for name in formula.names if (quantity := lookup(name, subject)) is not None)
    return Bound(formula, quantities, _own_scales(formula, quantities, subject), *frames_reach(formula.root, rate_hz))


@lru_cache(maxsize=4096)
def _one_of(root: Node) -> Node:
    """Return the one object for all trees that are equal: of channels, which are measured together."""
    return root


def _is_flag(name: str, subject: Subject) -> bool:
    """Return True for a yes or no that is no number either."""
    quantity = lookup(name, subject)
    return quantity is not None and holds(name, subject) and quantity.discrete < 0


def _unknown(name: str, subject: Subject) -> str:
    return f"{quoted(name)} is a yes or no, not a number" if holds(name, subject) else unknown_of(name, subject)


def _own_scales(formula: Formula, quantities: tuple[Quantity, ...], subject: Subject) -> tuple[float, ...]:
    """Return the scale of each comparison where none is given: the threshold of its signal, else 1."""
    scales = [1.0] * formula.comparisons
    for node in formula.root.walk():
        if node.op in COMPARISONS:
            of = [quantities[each.place] for each in node.walk() if each.op == Op.QUANTITY]
            signals = [quantity.signal for quantity in of if quantity.measured]
            scales[node.place] = subject.signals[signals[0]].threshold if signals else 1.0
    return tuple(scales)


def _scales(requirement: Requirement, bound: Bound) -> list[float]:
    """Return the scale of each comparison.  BadInput: given for another number of them."""
    given, comparisons = requirement.scale, bound.formula.comparisons
    if isinstance(given, list) and len(given) != comparisons:
        raise BadInput(f"{requirement.where}: scale: {len(given)} for {comparisons} comparisons")
    if given is None:
        return list(bound.scales)
    return list(given) if isinstance(given, list) else [given] * comparisons
