"""Comparisons that hold always or never, whatever is flown: found by the ranges of the quantities in them.

A limit in degrees where radians are compared is the usual cause: ``angle_of_attack > 10`` is legal and never true.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from math import inf, isnan, pi
from typing import Final, NamedTuple

from rig.core.frame import DISCRETE_INDEX, FLIGHT_INDEX, INDEX, SIGNALS
from rig.world.faults.expression import QUANTITIES, parse
from rig.world.faults.grammar import Op, Step, Steps

Span = tuple[float, float]  # least and largest value
EVERY_NUMBER: Final = (-inf, inf)
YES_NO: Final = (0.0, 1.0)
_WIDER: Final = 3.0  # times the range of the sensor: what a true value that is no angle may be
_SHOWN: Final = {
    **{Op.ADD: "+", Op.SUBTRACT: "-", Op.MULTIPLY: "*", Op.DIVIDE: "/"},
    **{Op.LESS: "<", Op.LESS_EQUAL: "<=", Op.GREATER: ">", Op.GREATER_EQUAL: ">=", Op.EQUAL: "==", Op.NOT_EQUAL: "!="},
    **{Op.MIN: "min", Op.MAX: "max"},
}
_FLIGHT: Final = {"mach": (0.0, 10.0), "throttle": YES_NO, "latitude_rad": (-pi / 2, pi / 2)}
_NAMES: Final = {step: name for name, step in QUANTITIES.items()}


class Operand(NamedTuple):
    """A quantity: as it is written, its values, its SI unit."""

    text: str
    span: Span
    unit: str = ""


class Decided(NamedTuple):
    """A comparison that always or never holds, and the quantities that decide it, with their ranges."""

    text: str
    holds: bool
    of: tuple[Operand, ...]

    def __str__(self) -> str:
        """Return the sentence."""
        ranges = (
            f"the range of {each.text} is {each.span[0]:.4g} to {each.span[1]:.4g} {each.unit}".rstrip()
            for each in self.of
        )
        return f"{self.text} is {'always' if self.holds else 'never'} true: {', '.join(ranges)}"


class _Value(NamedTuple):
    """What is on the stack: a number's span or a yes or no's, its text, what it is of."""

    span: Span
    text: str
    of: tuple[Operand, ...] = ()


def never_holding(condition: str) -> list[Decided]:
    """Return the comparisons of a trigger's condition that never hold."""
    steps = [(Op(int(op)), int(place), float(value)) for op, place, value in parse(condition)]
    return [each for each in decided(steps, _operand) if not each.holds]


def decided(steps: Steps, operand: Callable[[Step], Operand]) -> list[Decided]:
    """Return the comparisons of ``steps`` that always or never hold; ``operand``: of a step that pushes a quantity."""
    stack: list[_Value] = []
    found: list[Decided] = []
    for step in steps:
        op = step[0]
        if op == Op.NUMBER:
            stack.append(_Value((step[2], step[2]), f"{step[2]:g}"))
        elif op <= Op.TRUE_DISCRETE or op in (Op.QUANTITY, Op.HOLDS):
            known = operand(step)
            stack.append(_Value(known.span, known.text, (known,)))
        elif op in (Op.NEGATE, Op.ABS, Op.NOT):
            stack.append(_of_one(op, stack.pop()))
        elif op in (Op.ALWAYS, Op.EVENTUALLY, Op.ONCE, Op.STATE):
            continue  # over time, or without a distance, nothing else holds
        else:
            b, a = stack.pop(), stack.pop()
            made = _of_two(op, a, b)
            if Op.LESS <= op <= Op.NOT_EQUAL and made.of and made.span[0] == made.span[1]:
                found.append(Decided(made.text, bool(made.span[0]), made.of))
            stack.append(made)
    return found


def _of_one(op: Op, a: _Value) -> _Value:
    low, high = a.span
    if op == Op.NEGATE:
        return _Value((-high, -low), f"-{a.text}", a.of)
    if op == Op.ABS:
        least = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
        return _Value((least, max(abs(low), abs(high))), f"abs({a.text})", a.of)
    return _Value((1.0 - high, 1.0 - low), f"not {a.text}", a.of)


def _of_two(op: Op, a: _Value, b: _Value) -> _Value:
    called = op in (Op.MIN, Op.MAX)
    text = f"{_SHOWN[op]}({a.text}, {b.text})" if called else f"{a.text} {_SHOWN.get(op, op.name.lower())} {b.text}"
    of = tuple(dict.fromkeys((*a.of, *b.of)))
    return _Value(_span(op, a.span, b.span), text, of)


def _span(op: Op, a: Span, b: Span) -> Span:
    match op:
        case Op.ADD:
            return _numbers(a[0] + b[0], a[1] + b[1])
        case Op.SUBTRACT:
            return _numbers(a[0] - b[1], a[1] - b[0])
        case Op.MULTIPLY:
            return _numbers(*(x * y for x, y in product(a, b)))
        case Op.DIVIDE:
            return EVERY_NUMBER if b[0] <= 0.0 <= b[1] else _numbers(*(x / y for x, y in product(a, b)))
        case Op.MIN | Op.AND:
            return min(a[0], b[0]), min(a[1], b[1])
        case Op.MAX | Op.OR:
            return max(a[0], b[0]), max(a[1], b[1])
        case Op.LESS | Op.GREATER:
            low, high = (a, b) if op == Op.LESS else (b, a)
            return float(low[1] < high[0]), float(low[0] < high[1])
        case Op.LESS_EQUAL | Op.GREATER_EQUAL:
            low, high = (a, b) if op == Op.LESS_EQUAL else (b, a)
            return float(low[1] <= high[0]), float(low[0] <= high[1])
        case Op.EQUAL | Op.NOT_EQUAL:
            may = a[0] <= b[1] and b[0] <= a[1]
            must = a[0] == a[1] == b[0] == b[1]
            return (float(must), float(may)) if op == Op.EQUAL else (float(not may), float(not must))
    return YES_NO  # until


def _numbers(*values: float) -> Span:
    """Return the span of values, every number where one is none: infinity times zero."""
    return EVERY_NUMBER if any(isnan(value) for value in values) else (min(values), max(values))


def _operand(step: Step) -> Operand:
    op, place, _ = step
    name = _NAMES[op, place]
    inner = name.removeprefix("true.")
    if inner in DISCRETE_INDEX:
        return Operand(name, YES_NO)
    if op == Op.FLIGHT:
        return Operand(name, of_flight(inner))
    signal = SIGNALS[INDEX[inner]]
    return Operand(name, of_vote(inner) if op == Op.VOTED else of_truth(inner), signal.unit)


def of_vote(signal: str) -> Span:
    """Return what a vote may be: the range of its sensors."""
    of = SIGNALS[INDEX[signal]]
    return of.low, of.high


def of_truth(signal: str) -> Span:
    """Return what a true value may be: of an angle a turn, of others more than the range of the sensor."""
    of = SIGNALS[INDEX[signal]]
    if of.unit == "rad":
        return (of.low, of.high) if of.wraps or signal == "pitch_angle" else (-pi, pi)
    return min(0.0, _WIDER * of.low), _WIDER * of.high


def of_flight(name: str) -> Span:
    """Return what a quantity of the flight condition may be."""
    assert name in FLIGHT_INDEX
    if name.startswith("quaternion"):
        return -1.0, 1.0
    return _FLIGHT.get(name, (-pi, pi) if name.endswith("_rad") else EVERY_NUMBER)
