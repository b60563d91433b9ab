"""Check that the present code repeats the decisions of a recorded flight."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from rig.bench.replay.again import Again
from rig.bench.replay.before_after import of_replay
from rig.bench.replay.compare_flights import Comparison, Field, compare, joined
from rig.bench.replay.decisions import Decisions, Moves
from rig.core.errors import BadInput
from rig.core.frame import Table
from rig.core.versions import versions
from rig.flight.unit_loop import fly_blocks
from rig.log.columns import COLUMNS, chosen_of_parts
from rig.log.recordings.flown_log import Recorded
from rig.unit.running_unit import UnitUnderTest
from rig.unit.unit_facts import differences


@dataclass(frozen=True, slots=True)
class Verified:
    """A recording against the present code: every field, and the changed decisions."""

    comparison: Comparison
    decisions: Decisions

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {**self.comparison.as_dict(), "decisions": self.decisions.as_dict()}


def verify(recording: Recorded, fly: bool = False, unit: UnitUnderTest | None = None) -> Verified:
    """Replay the computers and the actuator monitors over the recorded inputs, or ``fly`` the scenario again.

    A replay compares their output; a flight compares the whole frame.  BadInput: a what-if log cannot be flown,
    or a unit under test flew the log and none is given.
    unit : votes instead of the recorded manager
    """
    scenario, log = recording.scenario, recording.log
    if fly and recording.what_if is not None:
        raise BadInput(f"{recording.path}: is the log of a what-if run ({recording.what_if}), which was never flown")
    if recording.unit and unit is None:
        name = recording.unit.get("name")
        raise BadInput(f"{recording.path}: flown by the unit under test {name!r}; replay it with --unit FILE")
    if unit is not None and recording.unit:
        unit.fly_as(recording.unit)
    if not fly and unit is not None and unit.lane is not None:
        raise BadInput(f"{recording.path}: {unit.unit.name} is one lane of several; use --fly to fly it again")
    computer = None if fly else Again(scenario, unit)
    again = fly_blocks(scenario, log.frames, unit) if computer is None else map(computer.over, log.blocks())
    fields, moves, frames = list[Field](), Moves(), 0
    for old, new in zip_longest(log.blocks(), again):
        new = old[:0] if new is None else new
        compared = _compared(old, new, computer)
        fields = [joined(*pair) for pair in zip(fields, compared, strict=True)] if fields else compared
        moves.add(old, new)
        frames += len(new)
    lengths = [f"recorded {log.frames} frames, flown again {frames} frames"] if log.frames != frames else []
    notes = [*of_replay(log.metadata, versions()), *_of_unit(recording, unit)]
    return Verified(Comparison(min(log.frames, frames), fields, lengths, notes), moves.decisions())


def _compared(old: Table, new: Table, again: Again | None) -> list[Field]:
    """Compare the output of ``again``; all fields of a flight."""
    columns = [column for column in COLUMNS if again is None or column.field in (*again.outputs, "acting")]
    chosen = [column for column in chosen_of_parts(new) if again is None or column in again.part_columns]
    return compare(old, new, [*columns, *(chosen if old.parts else ())])


def _of_unit(recording: Recorded, unit: UnitUnderTest | None) -> list[str]:
    """Return notes on the unit then and now."""
    if unit is None:
        return []
    then, now = recording.unit, unit.unit.about()
    if not then:
        return [f"unit: flown by the built-in manager, replayed by {now['name']}"]
    return [f"unit: {now['name']} is not as in the flight: {differs}" for differs in differences(then, now)]
