"""One flight of a campaign in memory: the rows, events and verdict of ``rig fly``, and its log if it is kept."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.core.errors import UnitDead
from rig.core.files import replaced
from rig.core.frame import TIMING, Block, Table, new_block
from rig.core.interrupt import Stop
from rig.flight import loop
from rig.flight.events import Event
from rig.flight.recorder import Findings, end_reason
from rig.flight.summary import Verdict
from rig.flight.unit_loop import UnitComputer
from rig.log.of_flight import metadata
from rig.log.writer import LogWriter
from rig.scenario.scenario import Scenario
from rig.unit.running_unit import UnitUnderTest


@dataclass(frozen=True, slots=True)
class CampaignFlight:
    """A flight in memory."""

    scenario: Scenario
    table: Table
    events: list[Event]
    verdict: Verdict
    ended: list[Event]  # known only at the end: faults without effect
    coils_failed: dict[str, dict[int, tuple[float, str]]] = field(default_factory=dict)  # as Flight.coils_failed
    unit: dict[str, str] = field(default_factory=dict)  # metadata of its log on the unit under test

    @property
    def rows(self) -> Block:
        """Return the rows of the flight."""
        return self.table.rows

    @property
    def end_reason(self) -> str:
        """Return the reason why the flight ended."""
        return end_reason(self.verdict, Stop(), self.scenario)


def fly(scenario: Scenario, tested: UnitUnderTest | None = None) -> CampaignFlight:
    """Fly a scenario with the digest and events of ``rig fly``; its rows are kept in memory.

    UnitDead, UnitRefused: of the unit under test.
    """
    rig = loop.Rig(scenario, None if tested is None else UnitComputer(tested), keep_clean=scenario.frames)
    findings, beside, (rows, timing) = Findings(scenario), _SecondRows(), loop.new_memory(scenario)
    loop.fly(rig, [findings, beside], memory=(rows, timing))
    if findings.verdict.survived:
        rig.plant.give_back()
    flown = slice(findings.verdict.frames)
    second = np.concatenate(beside.blocks) if beside.blocks else None
    table = Table(rows[flown], second, timing[flown], rig.faults.clean[flown])
    coils = findings.actuators.failed_at(scenario.rate_hz)
    end = findings.verdict, findings.end(), coils, ended_unit(tested)
    return CampaignFlight(scenario, table, findings.events, *end)


class _SecondRows:
    """Keep the second rows, which are given once."""

    def __init__(self) -> None:
        self.blocks: list[NDArray[Any]] = []

    def record(self, table: Table) -> None:
        """Keep the next rows, if there are any."""
        if table.beside is not None:
            self.blocks.append(table.beside)


def ended_unit(tested: UnitUnderTest | None) -> dict[str, str]:
    """End the session of a unit; return the metadata of the log.  UnitDead: another manager took over in flight."""
    if tested is None:
        return {}
    tested.end()
    if tested.dead:
        raise UnitDead(f"{tested.unit.source}: dead from frame {tested.replies.counts.dead_frame} on")
    return tested.metadata()


def write_log(flight: CampaignFlight, path: Path) -> None:
    """Log the flight as ``rig fly`` does, in larger chunks. RigError: the disk is full."""
    verdict, scenario, frames = flight.verdict, flight.scenario, [event.frame for event in flight.events]
    path.parent.mkdir(parents=True, exist_ok=True)
    header = {**metadata(scenario), **flight.unit}, [("scenario.toml", b"")]
    kept: Any = {"chunk_frames": scenario.frames, "draft_of": path, "parts": scenario.row_parts}
    with (
        replaced(path) as draft,
        LogWriter(draft, scenario.rate_hz, *header, **kept) as writer,
    ):
        for first in range(0, verdict.frames, writer.chunk_frames):
            part = slice(first, first + writer.chunk_frames)
            events = flight.events[bisect_left(frames, part.start) : bisect_left(frames, part.stop)]
            writer.write(flight.table[part], events)
        writer.write(Table(new_block(0), timing=np.zeros(0, TIMING)), flight.ended)
        writer.close({"digest": verdict.digest, "end_reason": flight.end_reason, "survived": str(verdict.survived)})
