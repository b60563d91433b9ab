"""The recorded frames once more: through the redundancy stage alone, or flown from the first frame."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from rig import loop
from rig.computer.control.source import source_of
from rig.computer.redundancy import Redundancy, decide_row, refer_row, vote_row
from rig.errors import BadInput, BadLog
from rig.faults import Fault, Faults, actuate, corrupt, corrupt_reference
from rig.faults.places import site
from rig.frame import FRAME, Block, S
from rig.kernels import kernel
from rig.log import Log, read_log
from rig.scenario import Scenario, from_resolved
from rig.trust import Trust

# What the redundancy stage writes of a row, and the source that the control law takes on its word.
OUTPUTS: Final = (
    *("voted", "reference", "second_reference", "trend_high", "trend_low", "state", "level", "pattern", "resolver"),
    *("reference_usable", "common_mode"),
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


def recorded(path: Path | str, allow_code: bool = False) -> Recorded:
    """Read the log at ``path`` from its first frame on; BadInput or BadLog in one line when it cannot be replayed.

    allow_code : a manager class that the log names may be run
    """
    path = Path(path)
    log = read_log(path)
    if not log.metadata.get("scenario"):
        raise BadLog(f"{path}: no scenario in its metadata")
    try:
        data = json.loads(log.metadata["scenario"])
    except (ValueError, RecursionError):
        raise BadLog(f"{path}: the scenario in its metadata is damaged") from None
    scenario = from_resolved(data, f"{path}: its scenario", Trust(str(path), allow_code))
    if len(log.rows) == 0:
        raise BadInput(f"{path}: no frames")
    if (log.rows["frame"] != np.arange(len(log.rows))).any():
        raise BadInput(f"{path}: frames are missing; a replay needs all of them from the first on")
    return Recorded(path, log, scenario)


def vote_again(rows: Block, scenario: Scenario) -> Block:
    """A copy of ``rows`` with OUTPUTS as the redundancy stage of ``scenario`` writes them over the same channels.

    Faults on references act again, in the frames in which they did.  Open loop: truth, channels, commands and all
    else stay those of ``rows``.  BadInput: the user's manager.
    """
    again = _copy(rows)
    for name in OUTPUTS:
        again[name] = np.nan if name.endswith("reference") else 0
    on_references = [i for i, fault in enumerate(scenario.faults) if _sites(fault) & {"reference"}]
    for i in on_references:
        again["acting"][:, i // 8] &= 255 ^ (1 << i % 8)
    stage = loop.redundancy(scenario)
    if on_references:
        _run_faulted(stage, loop.faults(scenario), again, _copy(rows))
    elif stage.own is None:
        run(again, stage.data)
    else:
        for k in range(len(again)):
            stage.step(again, k)
    sources(again)
    return again


def _copy(rows: Block) -> Block:
    """Field by field: the padding between them is part of the digest, and zero."""
    made = np.zeros(len(rows), FRAME)
    for name in FRAME.names or ():
        made[name] = rows[name]
    return made


def _sites(fault: Fault) -> set[str]:
    return {site(point.place) for point in fault.points}


def _run_faulted(stage: Redundancy, faults: Faults, rows: Block, recorded_rows: Block) -> None:
    """The stage over all rows, with faults between the references and their use.

    ``recorded_rows`` are those of the log, which tell the faults' triggers what they told in flight.
    """
    faults.prepare(rows)
    if stage.own is None:
        run_faulted(rows, recorded_rows, stage.data, faults.data)
        return
    for k in range(len(rows)):
        faults.step(recorded_rows, k)
        stage.refer(rows, k)
        faults.refer(rows, k)
        stage.decide(rows, k)
        faults.actuate(recorded_rows, k)


@kernel
def run(rows, data):
    """All rows through the redundancy stage; data : RedundancyData."""
    for k in range(len(rows)):
        vote_row(rows, k, data)


@kernel
def run_faulted(rows, recorded_rows, of_redundancy, of_faults):
    """The same with faults on references, as loop.compute has them; ``recorded_rows`` are corrupted on the way."""
    for k in range(len(rows)):
        corrupt(recorded_rows, k, of_faults)
        refer_row(rows, k, of_redundancy)
        corrupt_reference(rows, k, of_faults)
        decide_row(rows, k, of_redundancy)
        actuate(recorded_rows, k, of_faults)


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
