"""Random formulas of requirements, measured by rig.verdict.requirements and, frame by frame, by their definition.

    python tests/tools/requirement_formulas.py [--count 2000]

Prints how many agree in verdict and in robustness, met from 0 on and violated below 0; exit code 1 when one does not.
The
definition is written here once more, on trees that no parser has seen: every window is gone through, nothing is kept
from one block to the next.
"""

import argparse
import math
import sys
from random import Random
from typing import Any
from unittest.mock import patch

import numpy as np

from rig.core.frame import DISCRETES, INDEX, SIGNALS, End, State, Table, new_block
from rig.verdict.requirements import requirement_recorder as recorder_module
from rig.verdict.requirements.requirement import Requirement
from rig.verdict.requirements.requirement_recorder import RequirementsRecorder
from rig.verdict.requirements.subject import EVERYTHING, Subject, Watched

RATE_HZ, MOST, LEAST = 100.0, 1000.0, 1e-9
Q, P = INDEX["pitch_rate"], INDEX["roll_rate"]
NUMBERS = {
    "truth.pitch_rate": lambda rows: rows["truth"][:, Q],
    "voted.pitch_rate": lambda rows: rows["voted"][:, Q],
    "error.roll_rate": lambda rows: rows["voted"][:, P] - rows["truth"][:, P],
    "channel.pitch_rate.3": lambda rows: rows["channels"][:, Q, 2],
    "level.pitch_rate": lambda rows: rows["level"][:, Q].astype(float),
    "mach": lambda rows: rows["flight"][:, 7],
}
FLAGS = {
    "failed.pitch_rate.2": lambda rows: rows["state"][:, Q, 1] == State.FAILED,
    "truth.gear_down": lambda rows: rows["discrete_truth"][:, 1] != 0,
    "lost": lambda rows: rows["end"] != End.FLYING,
}
COMPARE = ("<", "<=", ">", ">=", "==", "!=")
SUBJECT = Subject(
    rate_hz=RATE_HZ,
    frames=200,
    signals=tuple(Watched(s.name, s.unit, s.wraps, 4, 0.5, 5) for s in SIGNALS),
    discretes=tuple(Watched(d.name, "", False, 4, 1.0, 5) for d in DISCRETES),
    offers=EVERYTHING,
    called="the flight",
    faulted=("pitch_rate",),
)


def random_rows(random: Random) -> Any:
    """Return the rows of a short flight: numbers, some of them NaN, channels that fail, onsets, perhaps a loss."""
    n = random.randrange(1, 120)
    numbers = np.random.default_rng(random.randrange(2**32))
    rows = new_block(n)
    for field in ("truth", "voted", "channels", "flight"):
        rows[field] = numbers.normal(size=rows[field].shape).round(1)
    if random.random() < 0.2:
        rows["truth"][numbers.random(n) < 0.05, Q] = np.nan
    rows["level"] = numbers.integers(0, 5, rows["level"].shape)
    rows["state"] = numbers.integers(0, 3, rows["state"].shape)
    rows["discrete_truth"] = numbers.integers(0, 2, rows["discrete_truth"].shape)
    for fault in range(random.randrange(1, 4)):
        rows["acting"][random.randrange(n) :, 0] |= 1 << fault
    if random.random() < 0.4:
        rows["end"][-1] = End.GROUND_CONTACT
    return rows


def random_number(random: Random, deep: int) -> Any:
    """Return a number as a tree."""
    kind = random.choice(
        ("name", "name", "constant", "+", "-", "*", "/", "abs", "min", "max", "negate")[: 3 + 8 * deep]
    )
    if kind == "name":
        return ("name", random.choice(list(NUMBERS)))
    if kind == "constant":
        return ("constant", round(random.uniform(-2, 2), 1))
    return (kind, *(random_number(random, 0) for _ in range(1 if kind in ("abs", "negate") else 2)))


def random_condition(random: Random, depth: int) -> Any:
    """Return a condition as a tree, windows in frames."""
    kinds = ("compare", "flag", "not", "state", "and", "or", "implies")
    kinds += ("always", "eventually", "once", "until", "until")
    kind = random.choice(kinds if depth else kinds[:2])
    if kind == "compare":
        return (random.choice(COMPARE), random_number(random, 1), random_number(random, 1))
    if kind == "flag":
        return ("flag", random.choice(list(FLAGS)))
    parts = [random_condition(random, depth - 1) for _ in range(2 if kind in ("and", "or", "implies", "until") else 1)]
    if kind in ("not", "state", "and", "or", "implies"):
        return (kind, *parts)
    first = random.choice((0, 0, random.randrange(15)))
    return (kind, first, first + random.choice((0, random.randrange(40))), *parts)


def text(tree: Any) -> str:
    """Return a tree as its author would write it."""
    kind, *parts = tree
    if kind in ("name", "flag"):
        return parts[0]
    if kind == "constant":
        return f"{parts[0]}" if parts[0] >= 0 else f"({parts[0]})"
    if kind in ("abs", "min", "max"):
        return f"{kind}({', '.join(map(text, parts))})"
    if kind == "negate":
        return f"(-{text(parts[0])})"
    if kind in ("+", "-", "*", "/", *COMPARE):
        return f"({text(parts[0])} {kind} {text(parts[1])})"
    if kind == "not":
        return f"(not {text(parts[0])})"
    if kind == "state":
        return f"state({text(parts[0])})"
    if kind in ("and", "or", "implies"):
        return f"({text(parts[0])} {kind} {text(parts[1])})"
    window = f"{kind}[{parts[0] / RATE_HZ:g}, {parts[1] / RATE_HZ:g}]"
    if kind == "until":
        return f"({text(parts[2])} {window} {text(parts[3])})"
    return f"({window} {text(parts[2])})"


class Definition:
    """Verdict and robustness by definition, frame by frame."""

    def __init__(self, rows: Any, scale: float) -> None:
        self.n, self.scale = len(rows), scale
        self.lost = bool(rows["end"][-1] != End.FLYING)
        self.columns = {name: of(rows).astype(float) for name, of in {**NUMBERS, **FLAGS}.items()}
        self.known: dict[tuple[int, int, int], Any] = {}

    def number(self, tree: Any, k: int) -> float:
        """Return a number in frame k."""
        kind, *parts = tree
        if kind == "name":
            return float(self.columns[parts[0]][k])
        if kind == "constant":
            return parts[0]
        a, b = (self.number(part, k) for part in (parts[0], parts[-1]))
        if math.isnan(a) or math.isnan(b):
            return math.nan
        match kind:
            case "abs":
                return abs(a)
            case "negate":
                return -a
            case "min" | "max":
                return min(a, b) if kind == "min" else max(a, b)
            case "/":
                return a / b if b else math.nan
        return {"+": a + b, "-": a - b, "*": a * b}[kind]

    def of(self, tree: Any, k: int, sign: int = 1) -> tuple[bool, float] | None:
        """Return verdict and robustness in frame k; None where nothing was flown to decide on."""
        if not 0 <= k < self.n:
            return None
        key = id(tree), k, sign
        if key not in self.known:
            self.known[key] = self._of(tree, k, sign)
        return self.known[key]

    def _of(self, tree: Any, k: int, sign: int) -> tuple[bool, float] | None:
        kind, *parts = tree
        if kind == "flag":
            value = self.columns[parts[0]][k]
            return (value != 0, 1.0 if value else -1.0)
        if kind in COMPARE:
            return self._compared(kind, self.number(parts[0], k), self.number(parts[1], k), sign)
        if kind == "not":
            found = self.of(parts[0], k, -sign)
            return None if found is None else (not found[0], -found[1] or -LEAST)
        if kind == "state":
            found = self.of(parts[0], k, sign)
            return None if found is None else (found[0], MOST if found[0] else -MOST)
        if kind in ("and", "or"):
            return combine([self.of(part, k, sign) for part in parts], kind == "and")
        if kind == "implies":
            given, then = self.of(parts[0], k, -sign), self.of(parts[1], k, sign)
            return combine([None if given is None else (not given[0], -given[1] or -LEAST), then], False)
        first, last, *parts = parts
        if kind == "always":
            found = combine([self.of(parts[0], j, sign) for j in range(k + first, k + last + 1)], True)
            missing = sum(j >= self.n for j in range(k + first, k + last + 1))
            if self.lost and missing:
                share = -1.0 - missing / (last - first + 1)
                return (False, share if found is None else min(found[1], share))
            return found
        if kind == "eventually":
            return combine([self.of(parts[0], j, sign) for j in range(k + first, k + last + 1)], False)
        if kind == "once":
            return combine([self.of(parts[0], j, sign) for j in range(k - last, k - first + 1)], False)
        ways = []
        for j in range(k + first, k + last + 1):
            reached = self.of(parts[1], j, sign)
            before = [self.of(parts[0], i, sign) for i in range(k, j)]
            ways.append(None if reached is None else combine([*before, reached], True))
        return combine(ways, False)

    def _compared(self, kind: str, a: float, b: float, sign: int) -> tuple[bool, float]:
        if math.isnan(b - a):
            return (sign < 0, -sign * MOST)
        apart = {"<": b - a, "<=": b - a, ">": a - b, ">=": a - b, "==": -abs(a - b), "!=": abs(a - b)}[kind]
        met = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}[kind]
        robustness = max(-MOST, min(MOST, apart / self.scale))
        return (met, max(robustness, 0.0) if met else min(robustness, -LEAST))


def combine(found: list[Any], least: bool) -> Any:
    """Return all, or any, of what was flown."""
    flown = [one for one in found if one is not None]
    if not flown:
        return None
    pick, whole = (min, all) if least else (max, any)
    return (whole(one[0] for one in flown), pick(one[1] for one in flown))


def case(number: int) -> tuple[Any, Any, float, Random]:
    """Return formula, rows, scale and what else is random of a case by its number."""
    random = Random(number)
    return random_condition(random, random.randrange(4)), random_rows(random), random.choice((1.0, 0.25)), random


def measured(tree: Any, rows: Any, scale: float, random: Random) -> tuple[str, float]:
    """Return status and robustness as the rig has them, the rows in blocks of any size, measured soon or late."""
    requirement = Requirement(id="random", formula=text(tree), at="each onset", scale=scale)
    with patch.object(recorder_module, "AT_ONCE", random.choice((1, 10, 1000))):
        recorder, first = RequirementsRecorder([requirement], SUBJECT), 0
        while first < len(rows):
            size = random.choice((1, 3, 20, 64))
            recorder.record(Table(rows[first : first + size]))
            first += size
        found = recorder.finish()[0]
    return found.status, found.robustness


def defined(tree: Any, rows: Any, scale: float) -> tuple[str, float]:
    """Return status and robustness by definition: the least of all onsets."""
    definition = Definition(rows, scale)
    bits = np.unpackbits(rows["acting"], axis=1, bitorder="little")
    onsets = sorted({int(np.argmax(bits[:, i])) for i in range(bits.shape[1]) if bits[:, i].any()})
    found = [one for one in (definition.of(tree, k) for k in onsets) if one is not None]
    if not found:
        return "not applicable", math.nan
    robustness, verdict = min((robustness, verdict) for verdict, robustness in found)
    return "met" if verdict else "violated", robustness


def agree(number: int) -> bool:
    """Return True if both have the same status, and the same robustness to 1e-12, 0 or more where it is met."""
    tree, rows, scale, random = case(number)
    status, robustness = measured(tree, rows, scale, random)
    expected, by_definition = defined(tree, rows, scale)
    if status != expected or status == "not applicable":
        return status == expected
    return abs(robustness - by_definition) <= 1e-12 and (status == "met") == (robustness >= 0.0)


def main() -> int:
    """Compare all; print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    count = parser.parse_args().count
    seen: dict[str, int] = {}
    wrong = [number for number in range(count) if not agree(number)]
    for number in range(0, count, max(1, count // 200)):
        tree, rows, scale, _ = case(number)
        status = defined(tree, rows, scale)[0]
        seen[status] = seen.get(status, 0) + 1
    print(f"{count - len(wrong)} of {count} formulas agree; of a sample {seen}")
    for number in wrong[:5]:
        tree, rows, scale, random = case(number)
        print(number, text(tree), measured(tree, rows, scale, random), defined(tree, rows, scale))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
