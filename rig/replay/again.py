"""The recorded frames once more: through the redundancy stage alone, or flown from the first frame."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from rig import loop
from rig.control.select import source_of
from rig.errors import BadInput, BadLog
from rig.frame import FRAME, Block, S
from rig.kernels import kernel
from rig.log import Log, read_log
from rig.redundancy import Redundancy, vote_row
from rig.scenario import Scenario, from_resolved

# What the redundancy stage writes of a row, and the source that the control law takes on its word.
OUTPUTS: Final = (
    *("voted", "reference", "trend_high", "trend_low", "state", "level", "pattern", "resolver", "reference_usable"),
    *("source", "discrete_voted", "discrete_state", "discrete_level"),
)


@dataclass(frozen=True, slots=True)
class Recorded:
    """A log and the scenario in it."""

    path: Path
    log: Log
    scenario: Scenario

    @property
    def what_if(self) -> str | None:
        """What was changed, when these frames were never flown but are the answer to a what if."""
        return self.log.metadata.get("what if")


def recorded(path: Path | str) -> Recorded:
    """The log at ``path`` from its first frame on; BadInput or BadLog in one line when it cannot be replayed."""
    path = Path(path)
    log = read_log(path)
    if not log.metadata.get("scenario"):
        raise BadLog(f"{path}: no scenario in its metadata")
    try:
        data = json.loads(log.metadata["scenario"])
    except ValueError:
        raise BadLog(f"{path}: the scenario in its metadata is damaged") from None
    scenario = from_resolved(data, f"{path}: its scenario")
    if len(log.rows) == 0:
        raise BadInput(f"{path}: no frames")
    if (log.rows["frame"] != np.arange(len(log.rows))).any():
        raise BadInput(f"{path}: frames are missing; a replay needs all of them from the first on")
    return Recorded(path, log, scenario)


def vote_again(rows: Block, scenario: Scenario) -> Block:
    """A copy of ``rows`` with OUTPUTS as the redundancy stage of ``scenario`` writes them over the same channels.

    Open loop: truth, channels, commands and all else stay those of ``rows``.  BadInput: the user's manager.
    """
    again = np.zeros(len(rows), FRAME)
    for name in FRAME.names or ():  # field by field: the padding between them is part of the digest, and zero
        if name not in OUTPUTS:
            again[name] = rows[name]
    again["reference"] = np.nan
    stage = loop.redundancy(scenario)
    _run(stage, again)
    sources(again)
    return again


def _run(stage: Redundancy, rows: Block) -> None:
    """The stage over all rows, in one compiled call unless its manager is the user's own."""
    if stage.own is None:
        run(rows, stage.arguments)
        return
    for k in range(len(rows)):
        stage.step(rows, k)


@kernel
def run(rows, of_redundancy):
    """All rows through the redundancy stage; ``of_redundancy`` is what its ``arguments`` gives."""
    for k in range(len(rows)):
        vote_row(rows, k, *of_redundancy)


@kernel
def sources(rows):
    """Write ``source``: what the control law takes on the word of the manager."""
    for k in range(len(rows)):
        row = rows[k]
        level, usable, reference, source = row["level"], row["reference_usable"], row["reference"], row["source"]
        for s in range(S):
            source[s] = source_of(level[s], usable[s], reference[s])


def fly_again(scenario: Scenario, frames: int) -> Block:
    """The first ``frames`` of ``scenario``, flown; fewer when the flight ends before."""
    flown, at = np.zeros(frames, FRAME), 0
    for rows, _ in loop.frames(loop.Rig(scenario), scenario):
        taken = min(len(rows), frames - at)
        flown[at : at + taken] = rows[:taken]
        at += taken
        if at == frames:
            break
    return flown[:at]
