"""Make the pictures of the docs in docs/pictures/.

python tests/tools/pictures.py [NAME ...]    # names without an ending; all pictures by default, a few minutes

The SVG files are readable at their width and follow the light or dark setting of the reader.  They are drawn from
flights and are the same on every machine; ``autopilot`` needs Betaflight's firmware.  The PNG files are photographs:
those of the viewer need a Vulkan driver, those of reports need Chromium.  A picture that cannot be made here is named
in a line, and the old file stays.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import outside
from figures import photographs
from figures.autopilot import autopilot
from figures.decision import decision
from figures.fault import architecture, fault, flown
from figures.gallery import CASES, gallery
from figures.patterns import PICTURES, patterns
from figures.servos_and_lanes import lanes, servo

FOLDER: Final = Path(__file__).parents[2] / "docs/pictures"


def pictures() -> dict[str, str]:
    """Return the text of each SVG file by its name."""
    flights = flown()
    drawn = {"architecture": architecture(flights), "fault": fault(flights), "decision": decision()}
    drawn |= {"servo": servo(), "lanes": lanes()}
    return {f"{name}.svg": written for name, written in drawn.items()} | patterns() | gallery()


def _autopilot() -> int:
    """Draw the flights of a stock autopilot; return 1 where its firmware is not installed."""
    if outside.betaflight() is None:
        print("autopilot.svg: not made: needs Betaflight's firmware: make test-all builds it", flush=True)
        return 1
    written = autopilot()
    (FOLDER / "autopilot.svg").write_text(written, encoding="utf-8")
    print(f"autopilot.svg: {len(written)} B", flush=True)
    return 0


def main(names: Sequence[str]) -> int:
    """Write the pictures ``names``; return 1 if one could not be made."""
    known = {
        "architecture",
        "fault",
        "decision",
        "servo",
        "lanes",
        *(case.name for case in CASES),
        *(f"pattern_{name}" for name in PICTURES),
    }
    others = {"autopilot", *photographs.PICTURES}
    if unknown := sorted({*names} - known - others):
        raise SystemExit(f"no picture {', '.join(unknown)}; there are: {', '.join(sorted(known | others))}")
    (FOLDER / "gallery").mkdir(parents=True, exist_ok=True)
    if not names or known & set(names):
        for name, written in pictures().items():
            if not names or Path(name).stem in names:
                (FOLDER / name).write_text(written, encoding="utf-8")
                print(f"{name}: {len(written)} B", flush=True)
    missing = 0 if names and "autopilot" not in names else _autopilot()
    for name in names or photographs.PICTURES:
        if name in photographs.PICTURES:
            done = photographs.make(name, FOLDER)
            missing += not done.endswith(" B")
            print(done, flush=True)
    return int(missing > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
