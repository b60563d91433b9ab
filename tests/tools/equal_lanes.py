"""Four computers fly what one flies: `python tests/tools/equal_lanes.py` flies every bundled scenario of one with both.

One line a scenario: frames, and what is not the same to the bit: rows of the two flights, or FCC records and COMPUTER
records of the four lanes.  1 when anything is not.
"""

import sys
from typing import Any

import numpy as np

from rig import loop, scenario
from rig.frame import COMPUTERS, Block, LaneBlock, nested
from rig.loop import Rig

_NOTED = ("voted", "state", "level", "pattern", "resolver", "surface")  # fields of COMPUTER that are the FCC's


class Compared:
    """Compares the rows of one computer's flight with those of several, block by block."""

    def __init__(self, rig: Rig, alone: Block) -> None:
        self.frames, self.differing = 0, set[str]()
        self._rig, self._alone = rig, alone

    def before_row(self, rig: Rig, rows: Any, k: int) -> None:
        """Compare the FCC records of the frame before."""
        lanes = self._rig.computers
        assert lanes is not None
        if len({fcc.tobytes() for fcc in lanes.data.fcc[: lanes.data.fitted]}) > 1:
            self.differing.add("FCC of the lanes")
        if k and lanes.data.fcc[0].tobytes() != rows[k - 1]["fcc"].tobytes():
            self.differing.add("FCC of the row")

    def record(self, rows: Block, timing: Any, lanes: LaneBlock | None = None) -> None:
        """Compare the next rows."""
        assert lanes is not None
        alone = self._alone[self.frames :][: len(rows)]
        self.frames += len(rows)
        if nested(alone).tobytes() != nested(rows).tobytes():
            self.differing.add("rows")
        each, fitted = lanes["computer"], self._rig.scenario.computers.count
        for name in _NOTED:
            if any(each[name][:, i].tobytes() != rows[name].tobytes() for i in range(fitted)):
                self.differing.add(name)
        if any((each["integral"][:, 0] != each["integral"][:, i]).any() for i in range(fitted)):
            self.differing.add("integral")


def compared(name: str | None, *sets: str) -> Compared:
    """Fly a scenario with one computer and with one a channel, whose clocks are exact; return what differs."""
    alone = loop.fly_rows(scenario.load(name, sets))
    rig = Rig(scenario.load(name, [*sets, f"computers.count={len(COMPUTERS)}", "computers.clock_drift_ppm=0"]))
    found = Compared(rig, alone)
    loop.fly(rig, [found], before_row=found.before_row)
    if found.frames != len(alone):
        found.differing.add("length")
    return found


def main() -> int:
    """Print a line a scenario, and the sum."""
    of_one = [name for name in scenario.names() if scenario.load(name).computers.count == 1]
    everything = [(name, compared(name)) for name in of_one]
    for name, found in everything:
        print(f"{name:40} {found.frames:6} frames  {', '.join(sorted(found.differing)) or 'equal'}")
    equal = sum(not found.differing for _, found in everything)
    frames = np.sum([found.frames for _, found in everything])
    print(f"{equal} of {len(everything)} scenarios equal to the bit, {frames} frames")
    return int(equal < len(everything))


if __name__ == "__main__":
    sys.exit(main())
