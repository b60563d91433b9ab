"""A block of given values through the faults alone, for the tests of faults; which faults did something."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.random import SeedSequence
from pydantic import TypeAdapter

from rig.core.frame import SIGNALS, Block, Ilm, nested, new_block
from rig.core.kernels import bind, kernel
from rig.world.faults import Execution, Fault, Faults, actuate, corrupt, corrupt_reference
from rig.world.faults.places import number, site
from rig.world.sensors import inertial

RATE = 100.0
RANGES = np.array([(signal.low, signal.high) for signal in SIGNALS])
STOPS = np.array([(-0.4, 0.4), (-0.3, 0.3), (-0.5, 0.5), (0.0, 1.0)])
PLACES = np.vstack([RANGES, inertial.ranges(), RANGES, STOPS])
THRESHOLDS = np.arange(1.0, len(SIGNALS) + 1.0) / 64  # exact, so that a multiple is one value in both forms
PARSE: TypeAdapter[Any] = TypeAdapter(Fault)
Prepare = Callable[[Block], None]


def x(frames: int = 60) -> np.ndarray:
    """A lively value: no two neighbouring frames are alike, no sample is zero."""
    return 0.3 * np.sin(0.13 * np.arange(frames)) + 0.31 + 0.001 * np.arange(frames)


def healthy(frames: int = 60) -> Block:
    """Every value of every place is ``x``, pressures around their own; the surfaces truly stand half as far."""
    block = new_block(frames)
    values = x(frames)
    block["channels"] = values[:, None, None]
    block["valid"], block["ilm"], block["level"] = 1, Ilm.GOOD, 4
    block["discrete_valid"], block["discrete_ilm"], block["discrete_level"] = 1, Ilm.GOOD, 4
    block["inertial"] = values[:, None]
    block["reference"] = values[:, None]
    block["surface"] = block["surface_command"] = values[:, None] * 0.4
    block["flight"] = values[:, None] * 0.2
    return block


def faulted(
    *faults: dict[str, Any], block: Block | None = None, seed: int = 7, size: int = 60, coils: Any = None
) -> Block:
    """``healthy``, or a given block, after the faults; ``size`` frames are prepared at a time.

    coils : the in-line monitors that measure, by signal
    """
    rows = healthy() if block is None else block
    parsed = [PARSE.validate_python(fault) for fault in faults]
    stage = Faults(parsed, PLACES, RATE, SeedSequence(seed), thresholds=THRESHOLDS, coils=coils)
    for start in range(0, len(rows), size):
        part = rows[start : start + size]
        stage.prepare(part)
        data = stage.data
        run = bind(corrupt_all, nested(part), data)
        run(nested(part), data)
    return rows


@kernel
def corrupt_all(rows, data):
    """All rows through the faults of every place; rows : FRAME records."""
    for k in range(len(rows)):
        corrupt(rows[k], k, data)
        corrupt_reference(rows[k], rows[k]["fcc"]["reference"], k, data)
        actuate(rows[k], data)


def acts(rows: Block, i: int = 0) -> list[int]:
    """The frames in which fault i acted."""
    return np.flatnonzero(rows["acting"][:, i >> 3] >> np.uint8(i & 7) & 1).tolist()


def column(rows: Block, place: str) -> np.ndarray:
    """The values of a place, of channel 2 where there are channels."""
    field = {"channel": "channels", "inertial": "inertial", "reference": "reference", "surface": "surface_command"}[
        site(place)
    ]
    values = rows[field][:, number(place)]
    return values[:, 1] if site(place) == "channel" else values


def executed(faults: Sequence[Fault], rows: Block) -> list[bool]:
    """For each fault, whether it did something."""
    found = Execution(faults)
    found.add(rows)
    return found.executed
