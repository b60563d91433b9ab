"""Whether a unit decides as our own manager, to the bit: all bundled scenarios in open loop, some of them flown.

    python tests/tools/unit_identity.py UNIT.toml ... [--flown 10] [--only NAME ...]

Open loop: the channels of a flight of our own manager go through the unit; all that the redundancy stage writes is
compared.  Flown: the loop closed by the unit, twice; all fields but ``unit`` are compared, and the digests of both.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from rig.flight.unit_loop import fly_rows as fly_unit
from rig.frame import Block
from rig.loop import fly_rows
from rig.replay.vote_again import OUTPUTS, vote_again
from rig.scenario import load, names
from rig.unit.unit import UnitUnderTest, running


def differing(a: Block, b: Block, fields: Any) -> int:
    """How many numbers do not have the same bits."""
    if len(a) != len(b):
        return max(len(a), len(b))
    count = 0
    for name in fields:
        one, other = (np.ascontiguousarray(rows[name]) for rows in (a, b))
        bits = f"u{one.dtype.base.itemsize}"
        count += int((one.view(bits) != other.view(bits)).sum())
    return count


def digest(rows: Block) -> str:
    """Of all rows, as the verdict has it."""
    return hashlib.sha256(np.ascontiguousarray(rows).view(np.uint8).data).hexdigest()


def flown(tested: UnitUnderTest, name: str, ours: Block) -> tuple[int, bool]:
    """Numbers that differ in closed loop, and whether two flights have the same digest."""
    scenario = load(name)
    first, second = fly_unit(scenario, unit=tested), fly_unit(scenario, unit=tested)
    fields = [field for field in ours.dtype.names or () if field != "unit"]
    return differing(ours, first, fields), digest(first) == digest(second)


def main() -> None:
    """Print a line a unit, and one for each scenario that differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("units", type=Path, nargs="+")
    parser.add_argument("--flown", type=int, default=10)
    parser.add_argument("--only", nargs="*")
    given = parser.parse_args()
    chosen = given.only or names()
    totals = {unit: [0, 0, 0, 0, 0, 0] for unit in given.units}  # scenarios, frames, numbers, differ, flown, same
    every = max(1, len(chosen) // max(1, given.flown))
    for i, name in enumerate(chosen):
        scenario = load(name)
        ours = fly_rows(scenario)
        for unit, total in totals.items():
            with running(unit) as tested:
                wrong = differing(ours, vote_again(ours, scenario, tested), OUTPUTS)
                total[0] += 1
                total[1] += len(ours)
                total[2] += sum(ours[field].size for field in OUTPUTS)
                total[3] += wrong
                if wrong:
                    print(f"{unit.stem}: {name}: {wrong} numbers differ")
                if given.flown and i % every == 0 and total[4] < given.flown:
                    off, same = flown(tested, name, ours)
                    total[4] += 1
                    total[5] += off == 0 and same
                    if off or not same:
                        print(f"{unit.stem}: {name}: flown, {off} numbers differ, two digests equal: {same}")
    for unit, (count, frames, numbers, wrong, loops, same) in totals.items():
        print(
            f"{unit.stem}: {count} scenarios, {frames} frames, {numbers} numbers, {wrong} differ; "
            f"flown {loops}, {same} with all fields equal and the same digest twice"
        )


if __name__ == "__main__":
    main()
