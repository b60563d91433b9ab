"""Whether the same code still says the same of a recorded flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rig.errors import BadInput
from rig.log.columns import COLUMNS
from rig.loop import fly_rows
from rig.offline.compare import Comparison, compare
from rig.offline.decisions import Decisions, decisions
from rig.offline.replay import OUTPUTS, Recorded, vote_again
from rig.offline.sides import of_replay
from rig.versions import versions


@dataclass(frozen=True, slots=True)
class Verified:
    """A recording against the present code: every field, and the decisions that moved."""

    comparison: Comparison
    decisions: Decisions

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return {**self.comparison.as_dict(), "decisions": self.decisions.as_dict()}


def verify(recording: Recorded, fly: bool = False) -> Verified:
    """Replay the redundancy stage over the recorded channels, or ``fly`` the recorded scenario again.

    A replay compares what the stage writes; a flight compares the whole frame.  BadInput: a what if was never flown.
    """
    rows, scenario = recording.log.rows, recording.scenario
    if fly and recording.what_if is not None:
        raise BadInput(f"{recording.path}: is a what if ({recording.what_if}); it was never flown")
    again = fly_rows(scenario, len(rows)) if fly else vote_again(rows, scenario)
    columns = [column for column in COLUMNS if fly or column.field in (*OUTPUTS, "acting")]
    fields = compare(rows, again, columns)
    lengths = [f"recorded {len(rows)} frames, flown again {len(again)}"] if len(rows) != len(again) else []
    notes = of_replay(recording.log.metadata, versions())
    found = Comparison(min(len(rows), len(again)), fields, lengths, notes)
    return Verified(found, decisions(rows, again))
