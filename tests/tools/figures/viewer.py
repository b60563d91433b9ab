"""Fly and photograph the viewer for the pages: docs/viewer_actuators.png, viewer_computers.png, viewer_two_flights.png.

python tests/tools/figures/viewer.py [NAME ...]    # half a minute; a Vulkan driver is needed

In full colour: the pages name the colours.  Without the viewer's own head, which shows notices about the machine.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from PIL import Image

import rig
from rig.show.viewer.opened import read
from rig.show.viewer.screenshot import screenshot

FOLDER: Final = Path(__file__).parents[3] / "docs"
HEAD: Final = 37  # px of the viewer's own head
WIDTH: Final = 1440


class Picture(NamedTuple):
    """Scenario, what is set in each flight, the tab."""

    scenario: str
    flights: Sequence[Sequence[str]] = ((),)
    tab: str = "overview"


PICTURES: Final = {
    "viewer_actuators": Picture("f16_elevator_coil_hardover", tab="actuators"),
    "viewer_computers": Picture("f16_four_lanes_lost", tab="computers"),
    "viewer_two_flights": Picture(
        "f16_pitch_rate_hardover", [["redundancy.manager=cross-channel"], ["redundancy.manager=mean"]]
    ),
}


def main(names: Sequence[str]) -> None:
    """Make the pictures ``names``."""
    for name in names:
        picture = PICTURES[name]
        with tempfile.TemporaryDirectory() as folder:
            logs = [
                rig.fly(picture.scenario, overrides=list(sets), out=Path(folder) / f"{i}").log
                for i, sets in enumerate(picture.flights)
            ]
            screenshot(read(logs, tab=picture.tab), Path(folder) / "shot.png")
            seen = Image.open(Path(folder) / "shot.png").convert("RGB")
        seen = seen.crop((0, HEAD, seen.width, seen.height))
        seen = seen.resize((WIDTH, round(WIDTH * seen.height / seen.width)), Image.Resampling.LANCZOS)
        seen.save(FOLDER / f"{name}.png", optimize=True)
        print(f"{name}.png: {(FOLDER / f'{name}.png').stat().st_size} B", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or list(PICTURES))
