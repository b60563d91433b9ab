"""The measured errors of every reference of the bundled aircraft, as a table: python tests/tools/references_table.py

Units of the signals; ``monitor`` is the monitor's threshold.  A split between pairs is settled rightly for certain
when it exceeds threshold and worst error together (``settled above``).  Settles a 2:2: ``always`` when that is below
the monitor's threshold, ``never wrong`` when the worst error is, else ``large ones``.
"""

from __future__ import annotations

import sys
from typing import Final

from rig import aircraft
from rig.computer.analytic.designed import Designed, Error
from rig.settings import build, read_toml

COLUMNS: Final = ("aircraft", "signal", "source", "RMS", "99.9 %", "worst", "threshold", "monitor", "settled above")


def settles(error: Error, monitor: float) -> str:
    """Which splits between two pairs a reference of this error settles rightly."""
    if error.threshold + error.worst < monitor:
        return "always"
    return "never wrong" if error.worst < monitor else "large ones"


def rows(name: str) -> list[str]:
    """The lines of one aircraft."""
    designed = build(Designed, read_toml(aircraft.folder(name) / "references.toml"), name)
    monitors = aircraft.tables(name)["redundancy"]["signals"]
    lines = []
    for signal, sources in designed.errors.items():
        monitor = monitors[signal]["threshold"]
        for source, e in sources.items():
            numbers = (e.rms, e.quantile_999, e.worst, e.threshold, monitor, e.threshold + e.worst)
            cells = (name, signal, source, *(f"{float(f'{number:.3g}'):g}" for number in numbers), settles(e, monitor))
            lines.append(f"| {' | '.join(cells)} |")
    return lines


def main() -> int:
    """Print the table of all aircraft."""
    print(f"| {' | '.join(COLUMNS)} | settles a 2:2 |")
    print("|---" * (len(COLUMNS) + 1) + "|")
    for name in aircraft.names():
        print("\n".join(rows(name)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
