"""Four computers fly what one flies: every bundled scenario of one computer is flown with both.

    python tests/tools/equal_lanes.py                     # clocks that are exact
    python tests/tools/equal_lanes.py 0 0.05 0.2 0.1      # frames by which they are ahead of the plant, for good

The one computer's sensors sample as early as the lanes' clocks say.  One line a scenario: frames, and what is not the
same to the bit: rows of the two flights, or FCC and COMPUTER records of the four lanes.  1 when anything is not.
"""

import sys
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from rig.core.frame import COMPUTERS, Block, Table, nested
from rig.flight import loop
from rig.flight.loop import Rig
from rig.scenario import scenario

EXACT: Final = (0.0,) * len(COMPUTERS)
_NOTED = ("voted", "state", "level", "pattern", "decided_by", "surface")  # fields of COMPUTER that are the FCC's


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

    def record(self, table: Table) -> None:
        """Compare the next rows."""
        rows, lanes = table.rows, table.lane
        alone = self._alone[self.frames :][: len(rows)]
        self.frames += len(rows)
        if nested(alone).tobytes() != nested(rows).tobytes():
            self.differing.add("rows")
        each, fitted = lanes, self._rig.scenario.computers.count
        for name in _NOTED:
            if any(each[name][:, i].tobytes() != rows[name].tobytes() for i in range(fitted)):
                self.differing.add(name)
        if any((each["integral"][:, 0] != each["integral"][:, i]).any() for i in range(fitted)):
            self.differing.add("integral")


def compared(name: str | None, *sets: str, ahead: Sequence[float] = EXACT) -> Compared:
    """Fly a scenario with one computer and with one a channel; return what differs.

    ahead : (4,) frames by which the clocks are ahead of the plant, which do not drift
    """
    given = scenario.load(name, sets)
    alone = rows_of_one(given, ahead)
    rig = Rig(scenario.load(name, [*sets, f"computers.count={len(COMPUTERS)}", *clocks(ahead, given.rate_hz)]))
    found = Compared(rig, alone)
    loop.fly(rig, [found], before_row=found.before_row)
    if found.frames != len(alone):
        found.differing.add("length")
    return found


def rows_of_one(given: scenario.Scenario, ahead: Sequence[float]) -> Block:
    """Return all rows of one computer, each channel of whose sensors samples so many frames early."""

    def early(rig: Rig) -> loop.ComputerStep:
        rig.sensors.data.params["skew"] += ahead
        return loop.bind_computer(rig.data, rig.redundancy.own)

    return loop.fly_rows(given, computer=early)


def clocks(ahead: Sequence[float], rate_hz: float) -> list[str]:
    """Return the overrides of clocks that are ahead for good: free ones, unless they are exact."""
    exact = ["computers.clock_drift_ppm=0"]
    if not any(ahead):
        return exact
    offsets_s = [frames / rate_hz for frames in ahead]
    free = ["computers.synchronised=false", "computers.exchange_rounds=1"]
    return [*exact, *free, f"computers.clock_offsets_s={offsets_s}"]


def main() -> int:
    """Print a line a scenario, and the sum."""
    of_one = [name for name in scenario.names() if scenario.load(name).computers.count == 1]
    ahead = [float(text) for text in sys.argv[1:]] or EXACT
    everything = [(name, compared(name, ahead=ahead)) for name in of_one]
    for name, found in everything:
        print(f"{name:40} {found.frames:6} frames  {', '.join(sorted(found.differing)) or 'equal'}")
    equal = sum(not found.differing for _, found in everything)
    frames = np.sum([found.frames for _, found in everything])
    print(f"{equal} of {len(everything)} scenarios equal to the bit, {frames} frames")
    return int(equal < len(everything))


if __name__ == "__main__":
    sys.exit(main())
