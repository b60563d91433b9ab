"""The monitors of the servo actuators once more over the recorded rows of these."""

from __future__ import annotations

from typing import Final

from rig.actuators.monitors import watch_rows
from rig.frame import LaneBlock, has_part, lane_rows
from rig.log.columns import LANE_COLUMNS, LaneColumn
from rig.scenario import Scenario
from rig.stages import actuator_monitors

OUTPUTS: Final = ("valve", "valve_differs", "failed_by")  # what the monitors write of a row


def watch_again(lanes: LaneBlock | None, scenario: Scenario) -> LaneBlock | None:
    """Copy the servos of ``lanes`` (n,), with OUTPUTS as the monitors of ``scenario`` write them; None without servos.

    Open loop: a channel that was shut off in flight has no current afterwards, whatever the monitors say now.
    """
    if not has_part(lanes, "actuator"):
        return None
    again = lane_rows(len(lanes))
    for name in ("frame", "actuator"):
        again[name] = lanes[name]
    for name in OUTPUTS:
        again["actuator"][name] = 0
    watch_rows(again["actuator"], *actuator_monitors(scenario))
    return again


def written() -> list[LaneColumn]:
    """Return the columns of OUTPUTS."""
    return [column for column in LANE_COLUMNS if column.part == "actuator" and column.field in OUTPUTS]
