"""How long a design of a million rows of sixteen signals takes; not a test, run it by hand:

python tests/tools/thresholds_speed.py [rows] [signals]
"""

from __future__ import annotations

import sys
from time import perf_counter, process_time

import numpy as np

from rig.recordings.settings import RecordedSignal
from rig.thresholds.data import Data
from rig.thresholds.design import Flight, Grid
from rig.thresholds.run import design

RATE_HZ = 100.0


def recorded(rows: int, signals: int) -> Data:
    """White noise on a common motion, in ten flights."""
    flights: dict[str, list[Flight]] = {}
    for s in range(signals):
        rng = np.random.default_rng(s)
        motion = 5.0 * np.sin(np.arange(rows) / 300.0 + s)
        parts = np.array_split(motion + rng.normal(size=(4, rows)), 10, axis=1)
        flights[f"signal_{s}"] = [Flight(f"flight {k}", np.ascontiguousarray(p), RATE_HZ) for k, p in enumerate(parts)]
    names = [f"flight {k}" for k in range(10)]
    settings = dict.fromkeys(flights, RecordedSignal(threshold=1.0))
    return Data(names, RATE_HZ, rows / RATE_HZ / 3600.0, flights, settings)


def main() -> None:
    """Design all filters, persistences and levels of the defaults; the first design compiles."""
    rows, signals = int(sys.argv[1] if len(sys.argv) > 1 else 1_000_000), int(sys.argv[2] if len(sys.argv) > 2 else 16)
    design(recorded(20_000, 1), Grid(10.0))
    data = recorded(rows, signals)
    clock, used = perf_counter(), process_time()
    found = design(data, Grid(10.0))
    taken, used = perf_counter() - clock, process_time() - used
    made = sum(len(one.designs) for one in found.values())
    print(f"{rows} rows of {signals} signals: {made} designs in {taken:.1f} s, {used:.1f} s of processor time")


if __name__ == "__main__":
    main()
