"""Conditions of triggers: a small expression over voted and true quantities, read once, run by a kernel.

    "dynamic_pressure > 8000 and abs(roll_rate) > 0.2"      "not autopilot_engaged or true.mach >= 0.8"

Numbers, ``+ - * /``, ``abs()``, comparisons (chained too), ``and``, ``or``, ``not``, brackets; nothing else, and
nothing is ever evaluated as Python.  A plain name is the vote of the last frame, ``true.<name>`` the truth of this
one, SI units as in rig/frame/signals.py.  It becomes a list of steps for a machine with a stack.
"""

from __future__ import annotations

import ast
import math
import warnings
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.frame import DISCRETE_INDEX, FLIGHT_INDEX, INDEX
from rig.kernels import kernel
from rig.text import choices, quoted

LONGEST: Final = 400  # characters
DEEPEST: Final = 32  # values on the stack


class Op(IntEnum):
    """Steps of a program: push a number or a quantity, or replace the uppermost by what comes of them."""

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

VOTED: Final = {
    **{name: (Op.VOTED, i) for name, i in INDEX.items()},
    **{name: (Op.VOTED_DISCRETE, i) for name, i in DISCRETE_INDEX.items()},
}
TRUE: Final = {
    **{name: (Op.FLIGHT, i) for name, i in FLIGHT_INDEX.items()},
    **{name: (Op.TRUTH, i) for name, i in INDEX.items()},
    **{name: (Op.TRUE_DISCRETE, i) for name, i in DISCRETE_INDEX.items()},
}
_ARITHMETIC: Final[dict[type[ast.operator], Op]] = {
    ast.Add: Op.ADD,
    ast.Sub: Op.SUBTRACT,
    ast.Mult: Op.MULTIPLY,
    ast.Div: Op.DIVIDE,
}
_COMPARE: Final[dict[type[ast.cmpop], Op]] = {
    ast.Lt: Op.LESS,
    ast.LtE: Op.LESS_EQUAL,
    ast.Gt: Op.GREATER,
    ast.GtE: Op.GREATER_EQUAL,
    ast.Eq: Op.EQUAL,
    ast.NotEq: Op.NOT_EQUAL,
}


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
    if isinstance(node, ast.BoolOp):
        join = Op.AND if isinstance(node.op, ast.And) else Op.OR
        first, *others = (_condition(value) for value in node.values)
        return [*first, *(step for other in others for step in (*other, (join, 0, 0.0)))]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        return [*_condition(node.operand), (Op.NOT, 0, 0.0)]
    if isinstance(node, ast.Compare):
        return _comparison(node)
    name = _name(node)
    if name is not None and (name in DISCRETE_INDEX or name.removeprefix("true.") in DISCRETE_INDEX):
        return _quantity(name)
    raise ValueError(f"{ast.unparse(node)!r} is no condition; compare it: <, <=, >, >=, ==, !=")


def _comparison(node: ast.Compare) -> Steps:
    """Return steps for a comparison: ``a < b < c`` is ``a < b and b < c``, as nothing has side effects."""
    sides = [_number(side) for side in (node.left, *node.comparators)]
    steps: Steps = []
    for i, compare in enumerate(node.ops):
        if type(compare) not in _COMPARE:
            raise ValueError(f"{ast.unparse(node)!r}: compare with <, <=, >, >=, == or !=")
        steps += [*sides[i], *sides[i + 1], (_COMPARE[type(compare)], 0, 0.0)]
        steps += [(Op.AND, 0, 0.0)] if i > 0 else []
    return steps


def _number(node: ast.expr) -> Steps:
    """Return steps that leave a number."""
    if isinstance(node, ast.Constant):
        return [(Op.NUMBER, 0, _finite(node))]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        return [*_number(node.operand), (Op.NEGATE, 0, 0.0)]
    if isinstance(node, ast.BinOp) and type(node.op) in _ARITHMETIC:
        return [*_number(node.left), *_number(node.right), (_ARITHMETIC[type(node.op)], 0, 0.0)]
    if isinstance(node, ast.Call):
        called = ast.unparse(node.func)
        if called != "abs" or len(node.args) != 1 or node.keywords:
            raise ValueError(f"{called}() cannot be called, allowed: abs() of one number")
        return [*_number(node.args[0]), (Op.ABS, 0, 0.0)]
    name = _name(node)
    if name is not None:
        return _quantity(name)
    raise ValueError(f"{ast.unparse(node)!r} is no number")


def _finite(node: ast.Constant) -> float:
    value = node.value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300:
        return float(value)
    raise ValueError(f"{ast.unparse(node)!r} is no finite number")


def _name(node: ast.expr) -> str | None:
    """Return ``roll_rate`` or ``true.roll_rate``; None when it is neither of that form."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return None


def _quantity(name: str) -> Steps:
    known = {**VOTED, **{f"true.{true}": place for true, place in TRUE.items()}}
    if name not in known:
        of = TRUE if name.startswith("true.") else VOTED
        names = [f"true.{true}" for true in TRUE] if of is TRUE else [*of, "true.<name>"]
        raise ValueError(f"unknown name {quoted(name)}, {choices(name, names, 'docs/faults.md')}")
    op, place = known[name]
    return [(op, place, 0.0)]


def _depth(steps: Steps) -> int:
    """Return the most values that are on the stack at once."""
    height = most = 0
    for op, *_ in steps:
        height += 1 if op < Op.NEGATE else 0 if op <= Op.NOT else -1
        most = max(most, height)
    return most


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
    """Return what a step makes of the uppermost value."""
    if op == Op.NEGATE:
        return -a
    if op == Op.ABS:
        return abs(a)
    return 1.0 if a == 0.0 else 0.0


@kernel
def of_two(op, a, b):
    """Return what a step makes of the two uppermost values."""
    if op <= Op.DIVIDE:
        return arithmetic(op, a, b)
    if a != a or b != b:
        return 0.0
    true = False
    if op == Op.LESS:
        true = a < b
    elif op == Op.LESS_EQUAL:
        true = a <= b
    elif op == Op.GREATER:
        true = a > b
    elif op == Op.GREATER_EQUAL:
        true = a >= b
    elif op == Op.EQUAL:
        true = a == b
    elif op == Op.NOT_EQUAL:
        true = a != b
    elif op == Op.AND:
        true = a != 0.0 and b != 0.0
    else:
        true = a != 0.0 or b != 0.0
    return 1.0 if true else 0.0


@kernel
def arithmetic(op, a, b):
    """Return sum, difference, product or quotient."""
    if op == Op.ADD:
        return a + b
    if op == Op.SUBTRACT:
        return a - b
    if op == Op.MULTIPLY:
        return a * b
    return a / b if b != 0.0 else math.nan
