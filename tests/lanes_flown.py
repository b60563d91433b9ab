"""A flight of four computers with all that its lanes have in every frame."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rig.flight.loop import Rig, frames
from rig.scenario import scenario

ONSET = 10
FOUR = "computers.count=4"


class Flown(NamedTuple):
    """All frames of a flight."""

    rows: Any
    lanes: Any  # COMPUTER
    bus: Any  # (frames, 4) BUS of the lanes
    fcc: Any  # (frames, 4) FCC
    rig: Rig


def flown(*faults: str, seconds: float = 0.3, sets: tuple[str, ...] = ()) -> Flown:
    """An F-16 in light turbulence with four computers and ``faults`` from frame ONSET on."""
    tables = ", ".join(f"{{{fault}, start_s={ONSET / 100}}}" for fault in faults)
    given = scenario.load(None, [f"duration_s={seconds}", f"faults=[{tables}]", FOUR, 'turbulence="light"', *sets])
    rig, rows, lanes, bus, fcc = Rig(given), [], [], [], []
    step, computers = rig.computer_step, rig.computers
    assert computers is not None

    def watched(block: Any, k: int, data: Any) -> None:
        step(block, k, data)
        bus.append(computers.data.bus.copy())
        fcc.append(computers.data.fcc.copy())

    rig.computer_step = watched
    for block, _ in frames(rig, given):
        rows.append(block.copy())
        lanes += rig.beside(len(block))
    return Flown(np.concatenate(rows), np.concatenate(lanes)["computer"], np.array(bus), np.array(fcc), rig)
