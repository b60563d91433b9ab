"""The monitors of the servo actuators once more over the recorded rows of these."""

from __future__ import annotations

from typing import Final

from rig.actuators.monitors import watch_rows
from rig.frame import ACTUATOR, LaneBlock, has_part, lane_rows
from rig.lanes.health import shut_off
from rig.log.columns import LANE_COLUMNS, LaneColumn
from rig.scenario import Scenario
from rig.stages import actuator_monitors

OUTPUTS: Final = ("valve", "valve_differs", "failed_by")  # what the monitors write of a row


class WatchAgain:
    """The monitors of ``scenario`` over the recorded rows of its servos, which are given in their order.

    Open loop: a channel that was shut off in flight has no current afterwards, whatever the monitors say now.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._designed, self._monitors = actuator_monitors(scenario)

    def add(self, lanes: LaneBlock | None) -> LaneBlock | None:
        """Copy the servos of the next ``lanes`` (n,), with OUTPUTS as the monitors write them; None without servos."""
        if not has_part(lanes, "actuator"):
            return None
        again = lane_rows(len(lanes))
        again["frame"] = lanes["frame"]
        for name in set(ACTUATOR.names or ()) - set(OUTPUTS):  # padding, which is part of the digest, stays zero
            again["actuator"][name] = lanes["actuator"][name]
        watch_rows(again["actuator"], self._designed, shut_off(lanes), self._monitors)
        return again


def written() -> list[LaneColumn]:
    """Return the columns of OUTPUTS."""
    return [column for column in LANE_COLUMNS if column.part == "actuator" and column.field in OUTPUTS]
