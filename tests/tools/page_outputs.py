"""Compare what a page shows as printed with what is printed, and write it anew: for tests/tools/pages.py."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import SequenceMatcher
from functools import lru_cache
from pathlib import Path
from typing import Final

GAP: Final = "..."
ALIKE: Final = 0.6  # similarity from which a line is taken for a shown one in new words
_NUMBER: Final = r"\d[\d.,]*(?:e[+-]?\d+)?"
# What differs from run to run or from machine to machine, and what stands on the page.
VARIES: Final = (
    (re.compile(rf"{_NUMBER} (us|ms)( per frame| a frame)"), rf"{GAP} \1\2"),
    (re.compile(rf"{_NUMBER}( ?x real time| times real time)"), rf"{GAP}\1"),
    (re.compile(rf"\bnow in {_NUMBER} s, {_NUMBER} flights/s"), f"now in {GAP} s, {GAP} flights/s"),
)
_STAGES: Final = re.compile(rf"[a-z]+ {_NUMBER} s(?:, [a-z]+ {_NUMBER} s)+")  # read 0.11 s, vote 0.20 s
# Progress in a pipe, and the compilation of kernels, once on a machine.
DROPPED: Final = re.compile(
    rf"^compiling|^\d+ of \d+ runs(?:, \d+ [a-z ]+)*, {_NUMBER} per second|^[\w ]+ \(\d+ of \d+\)$", re.I
)


def normal(printed: str, folder: Path) -> list[str]:
    """Return printed lines without what varies: paths of the temporary folder, speeds, notes on compilation."""
    lines = [line.rstrip() for line in printed.replace(f"{folder}/", "").replace(str(folder), ".").splitlines()]
    for pattern, instead in VARIES:
        lines = [pattern.sub(instead, line) for line in lines]
    lines = [re.sub(_NUMBER, GAP, line) if _STAGES.fullmatch(line) else line for line in lines]
    lines = [line for line in lines if not DROPPED.match(line)]
    while lines and not lines[-1]:
        lines.pop()
    return lines


def matches(shown: Sequence[str], printed: Sequence[str]) -> bool:
    """Return True if ``printed`` is what is ``shown``, in which a line ``...`` stands for any lines."""
    runs, at = _runs(shown), 0
    if len(runs) == 1:
        return runs[0] == list(printed)
    for i, run in enumerate(runs):
        if i == len(runs) - 1:
            return len(printed) - len(run) >= at and list(printed[len(printed) - len(run) :]) == run
        starts = [at] if i == 0 else range(at, len(printed) - len(run) + 1)
        found = next((k for k in starts if list(printed[k : k + len(run)]) == run), None)
        if found is None:
            return False
        at = found + len(run)
    return True


def _runs(shown: Sequence[str]) -> list[list[str]]:
    """Return the lines between the gaps; the first and the last may be empty."""
    runs: list[list[str]] = [[]]
    for line in shown:
        if line.strip() == GAP:
            runs.append([])
        else:
            runs[-1].append(line.rstrip())
    return runs


def rewritten(shown: Sequence[str], printed: Sequence[str]) -> list[str]:
    """Return what the page must show: the printed lines that are like the shown ones, and its gaps."""
    if matches(shown, printed):
        return list(shown)
    runs = _runs(shown)
    kept = [(line, number) for number, run in enumerate(runs) for line in run]
    found = _aligned([line for line, _ in kept], printed)
    if not found:
        return list(printed)
    out, at, before = list[str](), 0, 0
    for i, j in found:
        number = kept[i][1]
        out += _between(printed[at:j], gap=number != before)
        out.append(printed[j])
        at, before = j + 1, number
    return out + _between(printed[at:], gap=before != len(runs) - 1)


def _between(lines: Sequence[str], *, gap: bool) -> list[str]:
    return [GAP] if gap and lines else list(lines)


def _aligned(shown: Sequence[str], printed: Sequence[str]) -> list[tuple[int, int]]:
    """Return pairs (of shown, of printed) in order, as alike as possible in all."""
    best: list[list[float]] = [[0.0] * (len(printed) + 1) for _ in range(len(shown) + 1)]
    for i in reversed(range(len(shown))):
        for j in reversed(range(len(printed))):
            score = _alike(shown[i], printed[j])
            with_pair = score + best[i + 1][j + 1] if score >= ALIKE else 0.0
            best[i][j] = max(best[i + 1][j], best[i][j + 1], with_pair)
    found, i, j = list[tuple[int, int]](), 0, 0
    while i < len(shown) and j < len(printed):
        if best[i][j] == best[i + 1][j]:
            i += 1
        elif best[i][j] == best[i][j + 1]:
            j += 1
        else:
            found.append((i, j))
            i, j = i + 1, j + 1
    return found


@lru_cache(maxsize=100_000)
def _alike(one: str, other: str) -> float:
    """Return how alike two lines are, 0 to 1; numbers and spaces count little."""
    if one == other:
        return 1.5  # ahead of any line that is only alike
    if not one.strip() or not other.strip():
        return 0.0
    one, other = (" ".join(re.sub(_NUMBER, "0", line).split()) for line in (one, other))
    compared = SequenceMatcher(None, one, other, autojunk=False)
    return compared.ratio() if compared.quick_ratio() >= ALIKE else 0.0
