"""Conditions over voted and true quantities: one grammar, parsed once into steps, which a kernel runs in each frame.

    "dynamic_pressure > 8000 and abs(roll_rate) > 0.2"      "not autopilot_engaged or true.mach >= 0.8"

    condition   condition and condition | condition or condition | not condition | discrete
                | number < number (<=, >, >=, ==, !=; chained too)
    number      constant | name | -number | number + number (-, *, /) | abs(number)

Brackets and precedence are Python's, whose parser reads the text; nothing is ever evaluated as Python.  A plain name
is the vote of the last frame, ``true.<name>`` the truth of this one, SI units as in rig/frame/signals.py.
"""

from __future__ import annotations

import ast
import math
import warnings
from enum import IntEnum
from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import DISCRETE_INDEX, FLIGHT_INDEX, INDEX
from rig.kernels import kernel
from rig.text import choices, quoted

LONGEST: Final = 400  # characters
DEEPEST: Final = 32  # values on the stack


class Op(IntEnum):
    """Steps of a program: push a number or a quantity (to TRUE_DISCRETE), replace one value (to NOT), or two."""

    NUMBER = 0
    VOTED = 1
    VOTED_DISCRETE = 2
    TRUTH = 3
    FLIGHT = 4
    TRUE_DISCRETE = 5
    NEGATE = 6
    ABS = 7
    NOT = 8
    ADD = 9
    SUBTRACT = 10
    MULTIPLY = 11
    DIVIDE = 12
    LESS = 13
    LESS_EQUAL = 14
    GREATER = 15
    GREATER_EQUAL = 16
    EQUAL = 17
    NOT_EQUAL = 18
    AND = 19
    OR = 20


STEP: Final = np.dtype([("op", "i8"), ("place", "i8"), ("value", "f8")], align=True)
Steps = list[tuple[Op, int, float]]

# Every name of the grammar: its step and its place there.
QUANTITIES: Final[dict[str, tuple[Op, int]]] = {
    **{name: (Op.VOTED, i) for name, i in INDEX.items()},
    **{name: (Op.VOTED_DISCRETE, i) for name, i in DISCRETE_INDEX.items()},
    **{f"true.{name}": (Op.FLIGHT, i) for name, i in FLIGHT_INDEX.items()},
    **{f"true.{name}": (Op.TRUTH, i) for name, i in INDEX.items()},
    **{f"true.{name}": (Op.TRUE_DISCRETE, i) for name, i in DISCRETE_INDEX.items()},
}
# Every operator: its step.
_ARITHMETIC: Final = {ast.Add: Op.ADD, ast.Sub: Op.SUBTRACT, ast.Mult: Op.MULTIPLY, ast.Div: Op.DIVIDE}
_COMPARE: Final = {
    **{ast.Lt: Op.LESS, ast.LtE: Op.LESS_EQUAL, ast.Gt: Op.GREATER},
    **{ast.GtE: Op.GREATER_EQUAL, ast.Eq: Op.EQUAL, ast.NotEq: Op.NOT_EQUAL},
}
_JOIN: Final = {ast.And: Op.AND, ast.Or: Op.OR}


def parse(text: str) -> NDArray[np.void]:
    """Return the (n,) STEP records of a condition; ValueError, one line, says what in it is not allowed."""
    if len(text) > LONGEST:
        raise ValueError(f"a condition has at most {LONGEST} characters, got {len(text)}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # such as "1and 2"; what matters is the result
            tree = ast.parse(text.strip(), mode="eval")
        steps = _condition(tree.body)
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError("is no condition, such as 'dynamic_pressure > 8000 and roll_rate > 0.2'") from None
    if _depth(steps) > DEEPEST:
        raise ValueError(f"is nested too deeply: more than {DEEPEST} values wait for each other")
    return np.array([(int(op), place, value) for op, place, value in steps], STEP)


def _condition(node: ast.expr) -> Steps:
    """Return steps that leave 1 or 0."""
    match node:
        case ast.BoolOp(op=join, values=values):
            return _joined([_condition(value) for value in values], _JOIN[type(join)])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return [*_condition(operand), _step(Op.NOT)]
        case ast.Compare(left=left, ops=compares, comparators=others):
            sides = [_number(side) for side in (left, *others)]
            if any(type(compare) not in _COMPARE for compare in compares):
                raise ValueError(f"{ast.unparse(node)!r}: compare with <, <=, >, >=, == or !=")
            pairs = zip(sides, sides[1:], compares, strict=False)  # a < b < c is a < b and b < c
            return _joined([[*a, *b, _step(_COMPARE[type(compare)])] for a, b, compare in pairs], Op.AND)
    if QUANTITIES.get(ast.unparse(node), (None,))[0] in (Op.VOTED_DISCRETE, Op.TRUE_DISCRETE):
        return _quantity(node)
    raise ValueError(f"{ast.unparse(node)!r} is no condition; compare it: <, <=, >, >=, ==, !=")


def _number(node: ast.expr) -> Steps:
    """Return steps that leave a number."""
    match node:
        case ast.Constant():
            return [(Op.NUMBER, 0, _finite(node))]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return [*_number(operand), _step(Op.NEGATE)]
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            return [*_number(left), *_number(right), _step(_ARITHMETIC[type(op)])]
        case ast.Call(func=ast.Name(id="abs"), args=[inner], keywords=[]):
            return [*_number(inner), _step(Op.ABS)]
        case ast.Call(func=called):
            raise ValueError(f"{ast.unparse(called)}() cannot be called, allowed: abs() of one number")
        case ast.Name() | ast.Attribute(value=ast.Name()):
            return _quantity(node)
    raise ValueError(f"{ast.unparse(node)!r} is no number")


def _finite(node: ast.Constant) -> float:
    value = node.value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300:
        return float(value)
    raise ValueError(f"{ast.unparse(node)!r} is no finite number")


def _quantity(node: ast.expr) -> Steps:
    """Return the step that pushes what a name stands for, ``roll_rate`` or ``true.roll_rate``."""
    name = ast.unparse(node)
    if name not in QUANTITIES:
        true = name.startswith("true.")
        names = [known for known in QUANTITIES if known.startswith("true.") == true] + ["true.<name>"] * (not true)
        raise ValueError(f"unknown name {quoted(name)}, {choices(name, names, 'docs/faults.md')}")
    return [(*QUANTITIES[name], 0.0)]


def _step(op: Op) -> tuple[Op, int, float]:
    return op, 0, 0.0


def _joined(parts: list[Steps], join: Op) -> Steps:
    """Return the steps of all parts, joined one after the other."""
    first, *others = parts
    return [*first, *(step for other in others for step in (*other, _step(join)))]


def _depth(steps: Steps) -> int:
    """Return the most values that are on the stack at once."""
    heights = accumulate(1 if op < Op.NEGATE else 0 if op <= Op.NOT else -1 for op, *_ in steps)
    return max(heights)


def reads_votes(program: NDArray[np.void]) -> bool:
    """Return True if a program reads what was voted: it cannot hold before the first vote."""
    return bool(np.isin(program["op"], (Op.VOTED, Op.VOTED_DISCRETE)).any())


@kernel
def holds(program, start, stop, truth, seen, stack):
    """Run steps ``start`` to ``stop`` of ``program``: 1 if they leave true, else 0.

    truth : the row's TRUTH record; seen : trigger.SEEN record, the last votes; stack : (DEEPEST,) f8, workspace
    A comparison with what is no number is false (``!=`` too); a division by zero is no number.
    """
    top = -1
    for i in range(start, stop):
        step = program[i]
        op = step["op"]
        if op <= Op.TRUE_DISCRETE:
            top += 1
            stack[top] = load(op, step["place"], step["value"], truth, seen)
        elif op <= Op.NOT:
            stack[top] = of_one(op, float(stack[top]))
        else:
            top -= 1
            stack[top] = of_two(op, float(stack[top]), float(stack[top + 1]))
    return 1 if stack[0] != 0.0 else 0


@kernel
def load(op, place, value, truth, seen):
    """Return the number or quantity that a step pushes."""
    if op == Op.VOTED:
        return seen["voted"][place]
    if op == Op.VOTED_DISCRETE:
        return float(seen["discrete"][place])
    if op == Op.TRUTH:
        return truth["truth"][place]
    if op == Op.FLIGHT:
        return truth["flight"][place]
    if op == Op.TRUE_DISCRETE:
        return float(truth["discrete_truth"][place])
    return value


@kernel
def of_one(op, a):
    """Apply a unary operation to the top of the stack."""
    if op == Op.NEGATE:
        return -a
    if op == Op.ABS:
        return abs(a)
    return 1.0 if a == 0.0 else 0.0


@kernel
def of_two(op, a, b):
    """Apply a binary operation to the two uppermost values of the stack."""
    if op == Op.ADD:
        return a + b
    if op == Op.SUBTRACT:
        return a - b
    if op == Op.MULTIPLY:
        return a * b
    if op == Op.DIVIDE:
        return a / b if b != 0.0 else math.nan
    return 1.0 if a == a and b == b and compare(op, a, b) else 0.0


@kernel
def compare(op, a, b):
    """Return True if a comparison, or the join of two conditions, holds; both are numbers."""
    if op == Op.LESS:
        return a < b
    if op == Op.LESS_EQUAL:
        return a <= b
    if op == Op.GREATER:
        return a > b
    if op == Op.GREATER_EQUAL:
        return a >= b
    if op == Op.EQUAL:
        return a == b
    if op == Op.NOT_EQUAL:
        return a != b
    both = a != 0.0 and b != 0.0
    return both if op == Op.AND else a != 0.0 or b != 0.0
