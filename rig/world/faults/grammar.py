"""The one grammar of conditions, of triggers (``when``) and of requirements (``formula``): text to steps of a stack.

    condition   condition and condition | condition or condition | not condition | yes or no | state(condition)
                | number < number (<=, >, >=, ==, !=; chained too)
                | always[a, b] condition | eventually[a, b] condition | once[a, b] condition
                | condition until[a, b] condition | condition implies condition
    number      constant | name | -number | number + number (-, *, /) | abs(number) | min(number, ...) | max(...)

Brackets and precedence are Python's, whose parser reads the text; nothing is ever evaluated as Python.  Windows, s,
``state`` and ``implies`` are of requirements alone; windows bind like ``not``, ``implies`` less than ``or``: it has the
value of ``not p or q``.  Names are given by who parses: a ``Grammar``.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import pairwise
from math import isfinite
from typing import Final

from rig.core.units.conversion import conversion

LARGEST: Final = 1e300


class Op(IntEnum):
    """Steps of a program: push a number or a quantity (to TRUE_DISCRETE), replace one value (to NOT), or two.

    From ALWAYS on: of requirements, whose steps name their window by its place; QUANTITY pushes one of theirs.
    """

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
    MIN = 21
    MAX = 22
    QUANTITY = 23
    HOLDS = 24  # a yes or no
    ALWAYS = 25
    EVENTUALLY = 26
    ONCE = 27
    UNTIL = 28
    STATE = 29  # a condition without a distance


Step = tuple[Op, int, float]  # operation, place, value
Steps = list[Step]
Window = tuple[float, float]  # s, both ends included

# Every operator: its step.
_ARITHMETIC: Final = {ast.Add: Op.ADD, ast.Sub: Op.SUBTRACT, ast.Mult: Op.MULTIPLY, ast.Div: Op.DIVIDE}
_COMPARE: Final = {
    **{ast.Lt: Op.LESS, ast.LtE: Op.LESS_EQUAL, ast.Gt: Op.GREATER},
    **{ast.GtE: Op.GREATER_EQUAL, ast.Eq: Op.EQUAL, ast.NotEq: Op.NOT_EQUAL},
}
_LEAST: Final = {"min": Op.MIN, "max": Op.MAX}
_WINDOW: Final = re.compile(r"\b(always|eventually|once|until)\s*\[([^\[\]]*)\]")
_IMPLIES: Final = re.compile(r"(?<![\w.])implies(?![\w.])")
_UNIT: Final = re.compile(  # a number and a word behind it, or a sign
    r"(?<![\w.])((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?!(?:and|or|not|until|implies|e)\b)([^\W\d_]+(?:[/*^][\w^*]+)*|[°%])"
)
_CHANNEL: Final = re.compile(r"(?<![\w.])([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\.([0-9]+)\b")


class Refused(ValueError):
    """A text that is not allowed; ``column``, from 1, is the place of the error."""

    def __init__(self, message: str, column: int = 1) -> None:
        super().__init__(message)
        self.column = column


@dataclass(frozen=True, slots=True)
class Grammar:
    """Names of a grammar and bounds of its texts.

    number, condition : the step of a name as a number, or as a yes or no; None: it is none
    unknown : returns the message for an unknown name
    windows : always, eventually, once and until are allowed, and channels as in ``failed.pitch_rate.2``
    """

    number: Callable[[str], Step | None]
    condition: Callable[[str], Step | None]
    unknown: Callable[[str], str]
    windows: bool
    longest: int  # characters
    called: str  # what a text is, with an example


@dataclass(slots=True)
class Parsed:
    """The steps of a text, and the windows that they name."""

    steps: Steps = field(default_factory=list)
    windows: list[Window] = field(default_factory=list)


def parse(text: str, grammar: Grammar) -> Parsed:
    """Return the steps of ``text``; raise Refused with one line if it is not allowed."""
    if len(text) > grammar.longest:
        raise Refused(f"a condition must have at most {grammar.longest} characters, got {len(text)}")
    parser = _Parser(text, grammar)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # such as "1and 2"; what matters is the result
            tree = ast.parse(parser.python, mode="eval")
        steps = parser.condition(tree.body)
    except SyntaxError as error:
        united = _UNIT.search(text)
        if united is not None:
            raise Refused(_without_unit(united), united.start(1) + 1) from None
        raise Refused(f"not a condition, such as {grammar.called}", error.offset or 1) from None
    except (RecursionError, MemoryError):
        raise Refused(f"not a condition, such as {grammar.called}") from None
    return Parsed(steps, parser.windows)


def _without_unit(found: re.Match[str]) -> str:
    """Return the message for a number with a unit, with its value in SI units if the unit is known."""
    number, unit = found[1], found[2]
    known = {"°": "deg", "degs": "deg", "degree": "deg", "degrees": "deg"}
    try:
        factor, si = conversion(known.get(unit, unit))
        meant = f"; {number} {unit} is {float(number) * factor:.6g} {si}".removesuffix(" 1")
    except ValueError:
        meant = ""
    return f"{found[0].strip()!r}: give the number without a unit, in SI units (rad, rad/s, Pa, m, g){meant}"


class _Parser:
    """Parses one text.  What Python has no words for is written as what it has, as long as it was: columns stay."""

    def __init__(self, text: str, grammar: Grammar) -> None:
        self.grammar, self.text, self.windows = grammar, text.strip(), list[Window]()
        self._words: dict[int, tuple[str, int]] = {}  # by column: the word, and the place of its window
        self.python = self.text
        if grammar.windows:
            if not self.text.isascii():
                raise Refused("only ASCII characters are allowed")
            self.text = " ".join(self.text.splitlines())
            words = _IMPLIES.sub(self._implies, _WINDOW.sub(self._window, self.text))
            self.python = _CHANNEL.sub(r"\1_\2", words)

    def _window(self, found: re.Match[str]) -> str:
        """Keep a window; return the operator of Python in its place."""
        word, column = found[1], found.start() + 1
        try:
            begin, end = (float(number) for number in found[2].split(","))
        except ValueError:
            raise Refused(f"{found[0]!r}: a window must be [begin, end] in s, such as {word}[0, 2.5]", column) from None
        if not (isfinite(begin) and isfinite(end) and begin >= 0.0):
            raise Refused(f"{found[0]!r}: a window must begin at 0 s or later", column)
        if end < begin:
            raise Refused(f"{found[0]!r}: the window ends before it begins", column)
        self._words[found.start()] = word, len(self.windows)
        self.windows.append((begin, end))
        return ("and" if word == "until" else "not").ljust(len(found[0]))

    def _implies(self, found: re.Match[str]) -> str:
        """Keep an ``implies``; return the operator of Python in its place."""
        self._words[found.start()] = found[0], 0
        return "or".ljust(len(found[0]))

    def condition(self, node: ast.expr) -> Steps:
        """Return steps that leave a yes or no."""
        match node:
            case ast.BoolOp(op=ast.And(), values=values):
                return self._joined(values)
            case ast.BoolOp(values=values):
                return self._alternatives(values)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                word, place = self._words.get(node.col_offset, ("not", 0))
                return [*self.condition(operand), (Op[word.upper()], place, 0.0)]
            case ast.Call(func=ast.Name(id="state"), args=[inner], keywords=[]) if self.grammar.windows:
                return [*self.condition(inner), (Op.STATE, 0, 0.0)]
            case ast.Compare(left=left, ops=compares, comparators=others):
                sides = [self.number(side) for side in (left, *others)]
                if any(type(compare) not in _COMPARE for compare in compares):
                    raise self._refused(node, "allowed comparisons: <, <=, >, >=, == and !=")
                pairs = zip(sides, sides[1:], compares, strict=False)  # a < b < c is a < b and b < c
                return _all([[*a, *b, (_COMPARE[type(compare)], 0, 0.0)] for a, b, compare in pairs], Op.AND)
        if _is_name(node):
            step = self.grammar.condition(self._shown(node))
            if step is not None:
                return [step]
            if self.grammar.windows and self.grammar.number(self._shown(node)) is None:
                raise Refused(self.grammar.unknown(self._shown(node)), node.col_offset + 1)
        shown = self._shown(node)
        raise Refused(f"{shown!r} is not a condition; compare it: <, <=, >, >=, ==, !=", node.col_offset + 1)

    def _alternatives(self, values: list[ast.expr]) -> Steps:
        """Return the steps of conditions between which ``or`` stands, or ``implies``, which binds less than it."""
        sides, implies = [[self.condition(values[0])]], 0
        for before, value in pairwise(values):
            column = self._word_between(before, value)
            if column is not None:
                implies += 1
                if implies > 1:
                    raise Refused("two implies in a row: put one of them in brackets", column + 1)
                sides.append([])
            sides[-1].append(self.condition(value))
        first, *others = [_all(side, Op.OR) for side in sides]
        return first if not others else [*first, (Op.NOT, 0, 0.0), *others[0], (Op.OR, 0, 0.0)]

    def _word_between(self, before: ast.expr, value: ast.expr) -> int | None:
        """Return the column of a word of the grammar between two conditions side by side; None: there is none."""
        return next((c for c in self._words if (before.end_col_offset or 0) <= c < value.col_offset), None)

    def _joined(self, values: list[ast.expr]) -> Steps:
        """Return the steps of conditions between which ``and`` stands, or ``until``, which binds tighter."""
        parts, last = [self.condition(values[0])], False
        for before, value in pairwise(values):
            column = self._word_between(before, value)
            until = column is not None and self._words[column][0] == "until"
            if until and last:
                raise Refused("two until in a row: put one of them in brackets", (column or 0) + 1)
            if until and column is not None:
                parts[-1] = [*parts[-1], *self.condition(value), (Op.UNTIL, self._words[column][1], 0.0)]
            else:
                parts.append(self.condition(value))
            last = until
        return _all(parts, Op.AND)

    def number(self, node: ast.expr) -> Steps:
        """Return steps that leave a number."""
        match node:
            case ast.Constant():
                return [(Op.NUMBER, 0, self._finite(node))]
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return [*self.number(operand), (Op.NEGATE, 0, 0.0)]
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
                return [*self.number(left), *self.number(right), (_ARITHMETIC[type(op)], 0, 0.0)]
            case ast.Call(func=ast.Name(id="abs"), args=[inner], keywords=[]):
                return [*self.number(inner), (Op.ABS, 0, 0.0)]
            case ast.Call(func=ast.Name(id="min" | "max" as name), args=[_, _, *_], keywords=[]):
                return _all([self.number(inner) for inner in node.args], _LEAST[name])
            case ast.Call(func=called):
                allowed = "allowed: abs() of one number, min() and max() of several"
                raise self._refused(called, f"cannot be called, {allowed}", "()")
        if _is_name(node):
            name = self._shown(node)
            step = self.grammar.number(name)
            if step is None:
                raise Refused(self.grammar.unknown(name), node.col_offset + 1)
            return [step]
        raise Refused(f"{self._shown(node)!r} is not a number", node.col_offset + 1)

    def _finite(self, node: ast.Constant) -> float:
        value = node.value
        if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < LARGEST:
            return float(value)
        raise Refused(f"{self._shown(node)!r} is not a finite number", node.col_offset + 1)

    def _refused(self, node: ast.expr, message: str, brackets: str = "") -> Refused:
        shown = f"{self._shown(node)}{brackets} " if brackets else f"{self._shown(node)!r}: "
        return Refused(f"{shown}{message}", node.col_offset + 1)

    def _shown(self, node: ast.expr) -> str:
        """Return a part of the text as its author wrote it."""
        if not self.grammar.windows:
            return ast.unparse(node)
        return "".join(self.text[node.col_offset : node.end_col_offset].split(" "))


def _is_name(node: ast.expr) -> bool:
    """Return True for ``a``, ``a.b`` and so on."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return isinstance(node, ast.Name)


def _all(parts: list[Steps], join: Op) -> Steps:
    """Return the steps of all parts, joined one after the other."""
    first, *others = parts
    return [*first, *(step for other in others for step in (*other, (join, 0, 0.0)))]
