"""The recorded frames once more: through the redundancy stage alone, or flown from the first frame."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from rig import loop
from rig.computer.control.source import source_of
from rig.computer.redundancy import RedundancyData, conclude, refer
from rig.computer.redundancy.config import command
from rig.computer.redundancy.own import OwnManager
from rig.errors import BadInput, BadLog
from rig.faults import Fault, FaultData, actuate, corrupt, corrupt_reference
from rig.faults.places import site
from rig.flight.operator_keys import pressed
from rig.flight.unit_loop import UnitVoter, conclude_unit
from rig.frame import FLAT, Block, S, nested
from rig.kernels import kernel
from rig.log import Log, read_log
from rig.loop import decide
from rig.scenario import Scenario, from_resolved
from rig.unit.layout import Form
from rig.unit.unit import UnitUnderTest
from rig.util.trust import Trust

# What the redundancy stage writes of a row, and the source that the control law takes on its word.
OUTPUTS: Final = (
    *("voted", "reference", "second_reference", "trend_high", "trend_low", "state", "level", "pattern", "resolver"),
    *("reference_usable", "common_mode"),
    *("source", "discrete_voted", "discrete_state", "discrete_level"),
)
COMMANDED: Final = ("surface", "law")  # by a unit in the form of a flight computer


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

    @property
    def unit(self) -> dict[str, Any]:
        """The unit under test that flew it, as ``settings.Unit.about`` said; empty when our own manager did."""
        return json.loads(self.log.metadata.get("unit", "{}"))


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
    scenario = pressed(scenario, log.result, str(path))
    if len(log.rows) == 0:
        raise BadInput(f"{path}: no frames")
    if (log.rows["frame"] != np.arange(len(log.rows))).any():
        raise BadInput(f"{path}: frames are missing; a replay needs all of them from the first on")
    return Recorded(path, log, scenario)


def vote_again(rows: Block, scenario: Scenario, unit: UnitUnderTest | None = None) -> Block:
    """A copy of ``rows`` with OUTPUTS as the redundancy stage of ``scenario`` writes them over the same channels.

    Faults on references act again, in the frames in which they did.  Open loop: truth, channels, commands and all
    else stay those of ``rows``.  BadInput: the user's manager.

    unit : that votes in the place of the manager; one in the form of a flight computer writes SURFACES too
    """
    again = _copy(rows)
    for name in outputs(unit):
        again[name] = np.nan if name.endswith("reference") else 0
    again["reset"], again["discrete_reset"] = 0, 0
    command(again, scenario.redundancy.resets, scenario.rate_hz)  # a log of an older schema has none
    on_references = [i for i, fault in enumerate(scenario.faults) if _sites(fault) & {"reference"}]
    for i in on_references:
        again["acting"][:, i // 8] &= 255 ^ (1 << i % 8)
    stage = loop.redundancy(scenario)
    faults = loop.faults(scenario if on_references else scenario.model_copy(update={"faults": []}))
    faults.prepare(again)
    flown, data = _copy(rows) if on_references else again, ReplayData(faults.data, stage.data)
    if unit is None:
        replay(again, flown, data, stage.own)
    else:
        replay_unit(again, flown, data, UnitVoter(unit, scenario, stage, again))
    sources(again)
    return again


class ReplayData(NamedTuple):
    """What a replay needs besides the rows."""

    faults: FaultData
    redundancy: RedundancyData


def replay(rows: Block, recorded: Block, data: ReplayData, own: OwnManager | None) -> None:
    """Vote the recorded channels of ``rows`` (n,) again, in place: references, their faults, the manager, discretes.

    recorded : (n,) rows as they were flown, which tell the faults' triggers what they told in flight; in place
    """
    block, flown = nested(rows), nested(recorded)
    if own is None:
        replay_all(block, flown, data)
        return
    bus, fcc = block["bus"], block["fcc"]
    for k in range(len(block)):
        replay_before(block, flown, k, data)
        own.step(rows, bus, fcc, k)
        replay_after(block, flown, k, data)


def replay_unit(rows: Block, recorded: Block, data: ReplayData, voter: UnitVoter) -> None:
    """As ``replay``, with a unit under test that votes."""
    block, flown = nested(rows), nested(recorded)
    for k in range(len(block)):
        replay_before(block, flown, k, data)
        replay_after_unit(block, flown, k, voter.step(rows, k), data)


def outputs(unit: UnitUnderTest | None) -> tuple[str, ...]:
    """What a replay writes."""
    return OUTPUTS if unit is None or unit.form is Form.REDUNDANCY else (*OUTPUTS, *COMMANDED)


@kernel
def replay_all(rows, recorded, data):
    """All rows, with a manager of the house."""
    for k in range(len(rows)):
        replay_before(rows, recorded, k, data)
        decide(rows, k, data)
        replay_after(rows, recorded, k, data)


@kernel
def replay_before(rows, recorded, k, data):
    """The references of row k and their faults; ``before`` without what is recorded."""
    row = rows[k]
    corrupt(recorded[k], k, data.faults)
    refer(row["bus"], row["fcc"], data.redundancy.references)
    corrupt_reference(row, k, data.faults)


@kernel
def replay_after(rows, recorded, k, data):
    """What is kept of the votes of row k, and its discretes; ``after`` without the control law."""
    row = rows[k]
    conclude(row["bus"], row["fcc"], data.redundancy)
    actuate(recorded[k], data.faults)


@kernel
def replay_after_unit(rows, recorded, k, said, data):
    """The same after a unit that has said the groups ``said``."""
    row = rows[k]
    conclude_unit(row["bus"], row["fcc"], said, data.redundancy)
    actuate(recorded[k], data.faults)


def _copy(rows: Block) -> Block:
    """Field by field: the padding between them is part of the digest, and zero."""
    made = np.zeros(len(rows), FLAT)
    for name in FLAT.names or ():
        made[name] = rows[name]
    return made


def _sites(fault: Fault) -> set[str]:
    return {site(point.place) for point in fault.points}


@kernel
def sources(rows):
    """Write ``source``: what the control law takes on the word of the manager."""
    for k in range(len(rows)):
        row = rows[k]
        level, usable, reference, source = row["level"], row["reference_usable"], row["reference"], row["source"]
        for s in range(S):
            source[s] = source_of(level[s], usable[s], reference[s])
