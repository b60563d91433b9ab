"""What-if run: another threshold, rule order or manager over the recorded channels, or other limits of
the monitors of servo actuators.

Open loop: the flight, its truth and commands stay as recorded.  Only a new flight can show the effect of the new votes
on the aircraft.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.bench.replay.again import Again
from rig.bench.replay.before_after import rules_gone
from rig.bench.replay.decisions import Decisions, Moves
from rig.core.blocks import in_blocks
from rig.core.errors import BadInput
from rig.core.files import draft, numbered, publish, replaced
from rig.core.frame import TIMING, Table, new_block
from rig.core.settings import read_toml
from rig.core.text import quoted
from rig.core.versions import versions
from rig.flight.recorder import Findings
from rig.log.recordings.flown_log import Recorded
from rig.log.writer import LogWriter
from rig.scenario.aircraft import merge, without_designed
from rig.scenario.overrides import named_manager, override, parse_set
from rig.scenario.scenario import Scenario, from_resolved

KEY: Final = "redundancy"
MONITORS: Final = ("monitors", "current", "continuity", "spool", "position", "ram", "valve")  # keys of [actuators]


@dataclass(frozen=True, slots=True)
class WhatIf:
    """The result: its log, and the changed decisions."""

    path: Path
    scenario: Scenario
    moved: Decisions
    events: int
    notes: list[str]  # what else than the change can move a decision


def changed(recording: Recorded, file: Path | None, sets: Sequence[str]) -> Scenario:
    """Return the recorded scenario with another [redundancy]: from a TOML file, then from ``redundancy.key=value``.

    The file has a [redundancy] table, or the keys of one at its top.  BadInput: any other key.
    """
    data, trust, given = recording.scenario.resolved(), recording.scenario.trust, dict[str, Any]()
    if file is not None:
        read_tables = read_toml(file)
        if KEY in read_tables and len(read_tables) > 1:
            other = next(key for key in read_tables if key != KEY)
            raise BadInput(f"{file}: {other}: only [redundancy] can be changed without a flight")
        table = read_tables.get(KEY, read_tables)
        if not isinstance(table, dict):
            raise BadInput(f"{file}: {KEY}: must be a table, got {quoted(table)}")
        given = {KEY: table}
        trust = replace(trust, source=str(file)) if "manager" in table else trust
    above = given
    for text in sets:
        if _of_monitors(text):
            if not recording.scenario.has_servos:
                raise BadInput(f"--set {text}: the flight has no servo actuators")
            continue
        if not text.startswith(f"{KEY}."):
            raise BadInput(
                f"--set {text}: only redundancy.* and the monitors in actuators.* can be changed without a flight"
            )
        above = override(above, text)
    data = merge(without_designed(data, above), given)
    for text in sets:
        data = override(data, text)
    source = " with ".join(["redundancy", *([str(file)] if file else []), *(f"--set {text}" for text in sets)])
    return from_resolved(data, source, replace(trust, named=named_manager(map(parse_set, sets))))


def _of_monitors(text: str) -> bool:
    """Return True if ``key=value`` sets a monitor of an actuator, and not the actuator."""
    keys = parse_set(text)[0].split(".")
    return keys[0] == "actuators" and keys[1:2] != [] and keys[1] in MONITORS and keys[1:] != ["continuity", "coverage"]


def what_if(recording: Recorded, scenario: Scenario, out: Path | None = None, changes: Sequence[str] = ()) -> WhatIf:
    """Vote the recorded channels by ``scenario``; write the result to ``out``, or beside the recording, numbered.

    The new log records ``changes``.  BadInput: ``out`` cannot be made.
    """
    stem = f"{recording.path.stem}.what-if"
    path = out or recording.path.with_name(f"{stem}.mcap")
    moves, log = Moves(), recording.log
    with draft(path) if out is None else replaced(path) as part:
        metadata, attached = _metadata(recording, scenario, changes), log.attachments.items()
        with LogWriter(part, log.rate_hz, metadata, attached, draft_of=path, parts=log.parts) as writer:
            events = _write(writer, recording, scenario, _voted(recording, scenario, moves))
        if out is None:
            path = publish(part, numbered(path.parent, stem, ".mcap"))
    return WhatIf(path, scenario, moves.decisions(), events, rules_gone(log.metadata))


def _voted(recording: Recorded, scenario: Scenario, moves: Moves) -> Iterator[Table]:
    """Yield the recorded frames with the output of the computers and monitors of ``scenario``."""
    again = Again(scenario)
    for block in recording.log.blocks():
        voted = again.over(block)
        moves.add(block, voted)
        yield voted


def _write(writer: LogWriter, recording: Recorded, scenario: Scenario, frames: Iterator[Table]) -> int:
    """Write the whole log, a second at a time as in flight; return its number of events."""
    log, findings = recording.log, Findings(scenario)
    for arrays in in_blocks((table.arrays() for table in frames), max(1, int(log.rate_hz))):
        table = Table(*arrays)
        told = len(findings.events)
        findings.record(table)
        writer.write(table, findings.events[told:])
    last = findings.end()
    writer.write(Table(new_block(0), timing=np.zeros(0, TIMING)), last)
    writer.close({**(log.result or {}), "digest": findings.verdict.digest})
    return len(findings.events) + len(last)


def _metadata(recording: Recorded, scenario: Scenario, changes: Sequence[str]) -> dict[str, str]:
    own = {
        "scenario": json.dumps(scenario.resolved()),
        "what if": ", ".join(changes),
        "what if of": recording.path.name,
        "what if of digest": (recording.log.result or {}).get("digest", ""),
    }
    return {**recording.log.metadata, **versions(), **own}
