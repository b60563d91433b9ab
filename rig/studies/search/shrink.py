"""Reduce a violating scenario step by step while it continues to violate.

The steps are fewer faults, no manoeuvre, no turbulence, two digits, smaller sizes and later onsets.  A step is kept if
MOST of a few seeds violate with it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from rig.studies.search.confirm_worst import Confirmed, Fly, Table, confirm
from rig.world.faults import KINDS

SEEDS: Final = 5
MOST: Final = 3  # of them must violate
BACK: Final = 6  # steps at the edge that other seeds may undo
TRIES: Final = 40  # each flown on all of the seeds
_SMALLER: Final = (0.5, 0.75, 0.9)  # times a size
_LATER_S: Final = (2.0, 1.0, 0.5)
_DIGITS: Final = 2


def shrink(table: Table, seeds: Sequence[int], fly: Fly) -> list[Table]:
    """Return the given table, then each simpler one that violates on MOST of ``seeds``, the simplest last."""
    left, kept = TRIES, [table]
    for step in (_fewer_faults, _calmer, _rounded, _smaller, _later):
        held = True
        while held:  # again from the kept scenario, until no step succeeds
            held = False
            for tried in step(kept[-1]):
                if left == 0:
                    return kept
                left -= 1
                if confirm([tried], seeds, fly)[0].violations >= MOST:
                    kept.append(tried)
                    held = step is not _rounded
                    break
    return kept


def simplest(kept: Sequence[Table], seeds: Sequence[int], fly: Fly) -> Confirmed:
    """Return the last of ``kept`` that violates on the same share of many seeds, flown on them.

    If none of the last BACK does, return the one of them that violates on most.
    """
    flown: list[Confirmed] = []
    for table in reversed(kept[-BACK:]):
        flown.append(confirm([table], seeds, fly)[0])
        if flown[-1].violations * SEEDS >= MOST * len(seeds):
            return flown[-1]
    return max(flown, key=lambda each: each.violations)


def _fewer_faults(table: Table) -> Iterator[Table]:
    faults = table.get("faults", [])
    for i in range(len(faults)):  # also the last one: without a fault nothing should be violated
        yield {**table, "faults": [*faults[:i], *faults[i + 1 :]]}


def _calmer(table: Table) -> Iterator[Table]:
    pilot = table.get("pilot", {})
    if pilot.get("manoeuvres"):
        yield {**table, "pilot": {**pilot, "manoeuvres": []}}
    if table.get("turbulence", "none") != "none":
        yield {**table, "turbulence": "none"}


def _smaller(table: Table) -> Iterator[Table]:
    for factor in _SMALLER:
        for i, key in _sizes(table):
            value = table["faults"][i][key]
            smaller = 1.0 + factor * (value - 1.0) if key == "factor" else factor * value
            yield _changed(table, i, key, _short(smaller, _DIGITS))


def _later(table: Table) -> Iterator[Table]:
    for later_s in _LATER_S:
        for i, fault in enumerate(table.get("faults", [])):
            begins_s = fault.get("start_s")
            if isinstance(begins_s, float) and begins_s + later_s < table.get("duration_s", 0.0) / 2.0:
                yield _changed(table, i, "start_s", _short(begins_s + later_s, _DIGITS))


def _rounded(table: Table) -> Iterator[Table]:
    """Round all sizes and times at once, or to one digit more."""
    for digits in (_DIGITS, _DIGITS + 1):
        rounded = [
            {key: _short(value, digits) if isinstance(value, float) else value for key, value in fault.items()}
            for fault in table.get("faults", [])
        ]
        yield {**table, "faults": rounded}


def _short(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def _sizes(table: Table) -> list[tuple[int, str]]:
    """Return the places of the faults' sizes, in any unit."""
    found = []
    for i, fault in enumerate(table.get("faults", [])):
        sizes = KINDS[fault["kind"]].sizes if fault.get("kind") in KINDS else ()
        numbers = [key for key, value in fault.items() if isinstance(value, float)]
        found += [(i, key) for key in numbers if key in sizes or "thresholds" in key]
    return found


def _changed(table: Table, fault: int, key: str, value: Any) -> Table:
    faults = [{**each, key: value} if i == fault else each for i, each in enumerate(table["faults"])]
    return {**table, "faults": faults}
