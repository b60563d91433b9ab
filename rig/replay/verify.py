"""Whether the same code still says the same of a recorded flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rig.errors import BadInput
from rig.flight.unit_loop import fly_rows
from rig.log.columns import COLUMNS
from rig.recordings.flown import Recorded
from rig.replay.before_after import of_replay
from rig.replay.compare import Comparison, compare
from rig.replay.decisions import Decisions, decisions
from rig.replay.vote_again import outputs, vote_again
from rig.unit.unit import UnitUnderTest
from rig.util.versions import versions


@dataclass(frozen=True, slots=True)
class Verified:
    """A recording against the present code: every field, and the decisions that moved."""

    comparison: Comparison
    decisions: Decisions

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {**self.comparison.as_dict(), "decisions": self.decisions.as_dict()}


def verify(recording: Recorded, fly: bool = False, unit: UnitUnderTest | None = None) -> Verified:
    """Replay the redundancy stage over the recorded channels, or ``fly`` the recorded scenario again.

    A replay compares what the stage writes; a flight compares the whole frame.  BadInput: a what if was never flown,
    a unit under test flew it and none is given.
    unit : that votes in the place of the recorded manager
    """
    rows, scenario = recording.log.rows, recording.scenario
    if fly and recording.what_if is not None:
        raise BadInput(f"{recording.path}: is a what if ({recording.what_if}); it was never flown")
    if recording.unit and unit is None:
        name = recording.unit.get("name")
        raise BadInput(f"{recording.path}: the unit under test {name!r} flew it: replay it with --unit FILE")
    again = fly_rows(scenario, len(rows), unit) if fly else vote_again(rows, scenario, unit)
    columns = [column for column in COLUMNS if fly or column.field in (*outputs(unit), "acting")]
    fields = compare(rows, again, columns)
    lengths = [f"recorded {len(rows)} frames, flown again {len(again)}"] if len(rows) != len(again) else []
    notes = [*of_replay(recording.log.metadata, versions()), *_of_unit(recording, unit)]
    found = Comparison(min(len(rows), len(again)), fields, lengths, notes)
    return Verified(found, decisions(rows, again))


def _of_unit(recording: Recorded, unit: UnitUnderTest | None) -> list[str]:
    """Return notes on the unit then and now."""
    if unit is None:
        return []
    then, now = recording.unit, unit.unit.about()
    if not then:
        return [f"unit: flown by our own manager, replayed by {now['name']}"]
    same = then.get("sha256") == now["sha256"]
    return [] if same else [f"unit: {now['name']} is another build than the one that flew"]
