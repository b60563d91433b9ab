"""Comparisons of a requirement that always or never hold on a flight, whatever happens in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi

from rig.core.frame import CHANNELS, FLIGHT_INDEX, INDEX, SIGNALS
from rig.scenario.scenario import Scenario
from rig.verdict.requirements.formula import CHANNEL, LONGEST, SIGNAL, YES_NO, Name, may_hold, split
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.subject import Subject, signals_of
from rig.verdict.requirements.subject import of_flight as subject_of
from rig.world.faults.grammar import Grammar, Op, Step, parse
from rig.world.faults.reach import EVERY_NUMBER, Decided, Operand, Span, decided, of_flight, of_truth, of_vote
from rig.world.faults.reach import YES_NO as ZERO_OR_ONE


def notes(requirements: Sequence[Requirement], scenario: Scenario) -> list[str]:
    """Return a line for each comparison of the requirements that is decided before the flight."""
    subject = subject_of(scenario)
    found = (
        f"requirement {each.id}: {one}; numbers are in SI units"
        for each in requirements
        for text in _texts(each, subject)
        for one in decided_in(text)
    )
    return list(dict.fromkeys(found))


def _texts(requirement: Requirement, subject: Subject) -> Iterator[str]:
    """Yield the formula on each of its signals, and on each of their channels."""
    fitted = {watched.name: watched.channels for watched in subject.signals}
    for name in signals_of(requirement, subject) if SIGNAL in requirement.formula else [""]:
        text = requirement.formula.replace(SIGNAL, name)
        for c in range(1, fitted.get(name, 0) + 1) if CHANNEL in text else (1,):
            yield text.replace(CHANNEL, str(c))


def decided_in(formula: str) -> Iterator[Decided]:
    """Yield the comparisons of a formula that always or never hold."""
    names: list[str] = []

    def push(op: Op, name: str) -> Step:
        names.append(name)
        return op, len(names) - 1, 0.0

    grammar = Grammar(
        lambda name: push(Op.QUANTITY, name),
        lambda name: push(Op.HOLDS, name) if may_hold(name) else None,
        str,
        windows=True,
        longest=LONGEST,
        called="a formula",
    )
    steps = parse(formula, grammar).steps
    yield from decided(steps, lambda step: _operand(names[step[1]]))


def _operand(name: str) -> Operand:
    parts = split(name)
    if parts is None:
        return Operand(name, EVERY_NUMBER)
    unit = SIGNALS[INDEX[parts.of]].unit if parts.of in INDEX and parts.family in ("truth", "voted", "error") else ""
    return Operand(name, _span(parts), unit)


def _span(parts: Name) -> Span:
    if parts.family in YES_NO:
        return ZERO_OR_ONE
    if parts.family == "flight" and parts.of in FLIGHT_INDEX:
        return of_flight(parts.of)
    if parts.family == "surface":
        return ZERO_OR_ONE if parts.of == "throttle" else (-pi, pi)
    fixed = {"level": (0.0, float(CHANNELS)), "count": ZERO_OR_ONE, "departure": (-1.0, 1.0)}
    if parts.family in fixed:
        return fixed[parts.family]
    if parts.of not in INDEX:
        return ZERO_OR_ONE if parts.family in ("truth", "voted") else EVERY_NUMBER
    vote, truth = of_vote(parts.of), of_truth(parts.of)
    error = (-pi, pi) if SIGNALS[INDEX[parts.of]].wraps else (vote[0] - truth[1], vote[1] - truth[0])
    return {"voted": vote, "truth": truth, "reference": truth, "error": error}.get(parts.family, EVERY_NUMBER)
