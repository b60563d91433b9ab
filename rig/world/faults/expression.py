"""Conditions over voted and true quantities that trigger faults: parsed once to steps, which a kernel runs each frame.

    "dynamic_pressure > 8000 and abs(roll_rate) > 0.2"      "not autopilot_engaged or true.mach >= 0.8"

The grammar is that of requirements (grammar.py), without windows.  A plain name, also ``voted.<name>``, is the vote of
the last frame, ``true.<name>``, also ``truth.<name>``, the truth of this one, SI units as in rig/core/frame/signals.py.
"""

from __future__ import annotations

import math
from itertools import accumulate
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.core.frame import DISCRETE_INDEX, FLIGHT_INDEX, INDEX
from rig.core.kernels import kernel
from rig.core.text import choices, quoted
from rig.world.faults.grammar import Grammar, Op, Step, Steps
from rig.world.faults.grammar import parse as read

LONGEST: Final = 400  # characters
DEEPEST: Final = 32  # values on the stack


STEP: Final = np.dtype([("op", "i8"), ("place", "i8"), ("value", "f8")], align=True)
# Every name of a trigger: its step and its place there.
_SIGNALS: Final = {
    **{name: (Op.VOTED, i) for name, i in INDEX.items()},
    **{name: (Op.VOTED_DISCRETE, i) for name, i in DISCRETE_INDEX.items()},
}
_TRUE: Final = {
    **{name: (Op.FLIGHT, i) for name, i in FLIGHT_INDEX.items()},
    **{name: (Op.TRUTH, i) for name, i in INDEX.items()},
    **{name: (Op.TRUE_DISCRETE, i) for name, i in DISCRETE_INDEX.items()},
}
QUANTITIES: Final[dict[str, tuple[Op, int]]] = {
    **_SIGNALS,
    **{f"true.{name}": step for name, step in _TRUE.items()},
}
_ALSO: Final = {  # as requirements write them
    **{f"voted.{name}": step for name, step in _SIGNALS.items()},
    **{f"truth.{name}": step for name, step in _TRUE.items()},
}


def _number(name: str) -> Step | None:
    known = QUANTITIES.get(name) or _ALSO.get(name)
    return None if known is None else (*known, 0.0)


def _condition(name: str) -> Step | None:
    step = _number(name)
    return step if step is not None and step[0] in (Op.VOTED_DISCRETE, Op.TRUE_DISCRETE) else None


def _unknown(name: str) -> str:
    true = name.startswith("true.")
    names = [known for known in QUANTITIES if known.startswith("true.") == true] + ["true.<name>"] * (not true)
    return f"unknown name {quoted(name)}, {choices(name, names, 'docs/reference/faults-and-signals.md')}"


_TRIGGER: Final = Grammar(
    _number, _condition, _unknown, False, LONGEST, "'dynamic_pressure > 8000 and roll_rate > 0.2'"
)


def parse(text: str) -> NDArray[np.void]:
    """Return the (n,) STEP records of a condition; raise ValueError with one line if it is not allowed."""
    steps = read(text, _TRIGGER).steps
    if _depth(steps) > DEEPEST:
        raise ValueError(f"is nested too deeply: more than {DEEPEST} values on the stack")
    return np.array([(int(op), place, value) for op, place, value in steps], STEP)


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
    if op == Op.MIN or op == Op.MAX:
        return math.nan if a != a or b != b else min(a, b) if op == Op.MIN else max(a, b)
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
