"""Reduce a violating scenario step by step while it continues to violate.

The steps are no fault at all, fewer faults, no manoeuvre, no turbulence, two digits, smaller sizes and later onsets.  A
step is kept if MOST of a few seeds violate with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, TypeVar

from rig.studies.search.confirm_worst import Fly, Table, counting
from rig.world.faults import KINDS

SEEDS: Final = 5
MOST: Final = 4  # of them must violate
UNDO_SEEDS: Final = 10  # other seeds,
BACK: Final = 3  # which may undo so many steps
TRIES: Final = 24  # each flown on MOST of the seeds, on the others where these do not decide
_SMALLER: Final = (0.5, 0.75)  # times all sizes
_ONE_SMALLER: Final = 0.5  # times one size
_LATER_S: Final = (2.0, 1.0, 0.5)
_DIGITS: Final = 2
T = TypeVar("T")
Step = Callable[[T], Iterator[T]]  # yields simpler ones, the simplest first


def shrink(table: Table, seeds: Sequence[int], fly: Fly) -> list[Table]:
    """Return the given table, then each simpler one that violates on MOST of ``seeds``, the simplest last."""
    steps = (_no_fault, _fewer_faults, _calmer, _rounded, _smaller, _later)
    return shrunk(table, steps, lambda tried: on_most(tried, seeds, counting(fly)), once=(_rounded,))


def shrunk(given: T, steps: Sequence[Step[T]], violates: Callable[[T], bool], once: Sequence[Step[T]] = ()) -> list[T]:
    """Return ``given``, then each simpler one that violates, the simplest last, after at most TRIES.

    A step is taken again from what it made, until nothing of it violates; of ``once`` a single time.
    """
    left, kept = TRIES, [given]
    for step in steps:
        held = True
        while held:
            held = False
            for tried in step(kept[-1]):
                if left == 0:
                    return kept
                left -= 1
                if violates(tried):
                    kept.append(tried)
                    held = step not in once
                    break
    return kept


def simplest(kept: Sequence[T], seeds: Sequence[int], violations: Callable[[T, Sequence[int]], int]) -> T:
    """Return the last of ``kept`` that violates on the same share of other seeds; the first if none of BACK does.

    The share on ``seeds`` is that of a choice: no share to tell.
    """
    for each in reversed(kept[1:][-BACK:]):
        if violations(each, seeds) * SEEDS >= MOST * len(seeds):
            return each
    return kept[0]


def on_most(tried: T, seeds: Sequence[int], violations: Callable[[T, Sequence[int]], int]) -> bool:
    """Return whether ``tried`` violates on MOST of the seeds; use no more of them than it takes."""
    first = violations(tried, seeds[:MOST])
    if first == MOST or first + len(seeds) - MOST < MOST:
        return first == MOST
    return first + violations(tried, seeds[MOST:]) >= MOST


def _no_fault(table: Table) -> Iterator[Table]:
    if table.get("faults"):
        yield {**table, "faults": []}


def _fewer_faults(table: Table) -> Iterator[Table]:
    faults = table.get("faults", [])
    for i in range(len(faults) if len(faults) > 1 else 0):
        yield {**table, "faults": [*faults[:i], *faults[i + 1 :]]}


def _calmer(table: Table) -> Iterator[Table]:
    pilot = table.get("pilot", {})
    if pilot.get("manoeuvres"):
        yield {**table, "pilot": {**pilot, "manoeuvres": []}}
    if table.get("turbulence", "none") != "none":
        yield {**table, "turbulence": "none"}


def _smaller(table: Table) -> Iterator[Table]:
    """Make all sizes smaller at once, then one of several."""
    sizes = _sizes(table)
    for factor in _SMALLER if sizes else ():
        yield _changed(table, dict.fromkeys(sizes, factor))
    for place in sizes if len(sizes) > 1 else ():
        yield _changed(table, {place: _ONE_SMALLER})


def _later(table: Table) -> Iterator[Table]:
    """Let all faults begin later, if they do so in the first half of the flight."""
    begin_s = [fault["start_s"] for fault in table.get("faults", []) if isinstance(fault.get("start_s"), float)]
    for later_s in _LATER_S if begin_s else ():
        if max(begin_s) + later_s < table.get("duration_s", 0.0) / 2.0:
            faults = [
                {**each, "start_s": _short(each["start_s"] + later_s)}
                if isinstance(each.get("start_s"), float)
                else each
                for each in table["faults"]
            ]
            yield {**table, "faults": faults}


def _rounded(table: Table) -> Iterator[Table]:
    """Round all sizes and times at once, or to one digit more."""
    for digits in (_DIGITS, _DIGITS + 1):
        rounded = [
            {key: _short(value, digits) if isinstance(value, float) else value for key, value in fault.items()}
            for fault in table.get("faults", [])
        ]
        yield {**table, "faults": rounded}


def _short(value: float, digits: int = _DIGITS) -> float:
    return float(f"{value:.{digits}g}")


def _sizes(table: Table) -> list[tuple[int, str]]:
    """Return the places of the faults' sizes, in any unit."""
    found: list[tuple[int, str]] = []
    for i, fault in enumerate(table.get("faults", [])):
        sizes = KINDS[fault["kind"]].sizes if fault.get("kind") in KINDS else ()
        numbers = [key for key, value in fault.items() if isinstance(value, float)]
        found += [(i, key) for key in numbers if key in sizes or "thresholds" in key]
    return found


def _changed(table: Table, factors: Mapping[tuple[int, str], float]) -> Table:
    """Return a scenario with sizes times factors; of a ``factor``, which is 1 without a fault, the distance from 1."""
    faults = [dict(each) for each in table["faults"]]
    for (i, key), factor in factors.items():
        none = 1.0 if key == "factor" else 0.0
        faults[i][key] = _short(none + factor * (faults[i][key] - none))
    return {**table, "faults": faults}
