"""Whether the same code still says the same of a recorded flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.errors import BadInput
from rig.flight.unit_loop import fly_rows
from rig.frame import LaneBlock
from rig.log.columns import COLUMNS, chosen_lanes
from rig.recordings.flown import Recorded
from rig.replay.before_after import of_replay
from rig.replay.compare import Comparison, compare
from rig.replay.decisions import Decisions, decisions
from rig.replay.vote_again import outputs, vote_again
from rig.replay.watch_again import watch_again, written
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
    """Replay redundancy stage and monitors of actuators over what was recorded, or ``fly`` the scenario again.

    A replay compares what these write; a flight compares the whole frame.  BadInput: a what if was never flown,
    a unit under test flew it and none is given.
    unit : that votes in the place of the recorded manager
    """
    rows, scenario = recording.log.rows, recording.scenario
    if fly and recording.what_if is not None:
        raise BadInput(f"{recording.path}: is a what if ({recording.what_if}); it was never flown")
    if recording.unit and unit is None:
        name = recording.unit.get("name")
        raise BadInput(f"{recording.path}: the unit under test {name!r} flew it: replay it with --unit FILE")
    lanes, flown = recording.log.lanes, list[LaneBlock]()
    again = fly_rows(scenario, len(rows), unit, flown) if fly else vote_again(rows, scenario, unit)
    lanes_again = (np.concatenate(flown) if flown else None) if fly else watch_again(lanes, scenario)
    columns = [column for column in COLUMNS if fly or column.field in (*outputs(unit), "acting")]
    fields = compare(rows, again, columns)
    if lanes is not None and lanes_again is not None:
        fields += compare(lanes, lanes_again, chosen_lanes(lanes) if fly else written())
    lengths = [f"recorded {len(rows)} frames, flown again {len(again)}"] if len(rows) != len(again) else []
    notes = [*of_replay(recording.log.metadata, versions()), *_of_unit(recording, unit)]
    found = Comparison(min(len(rows), len(again)), fields, lengths, notes)
    return Verified(found, decisions(rows, again, lanes, lanes_again))


def _of_unit(recording: Recorded, unit: UnitUnderTest | None) -> list[str]:
    """Return notes on the unit then and now."""
    if unit is None:
        return []
    then, now = recording.unit, unit.unit.about()
    if not then:
        return [f"unit: flown by our own manager, replayed by {now['name']}"]
    same = then.get("sha256") == now["sha256"]
    return [] if same else [f"unit: {now['name']} is another build than the one that flew"]
