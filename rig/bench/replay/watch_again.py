"""The monitors of the servo actuators once more over the recorded rows of these."""

from __future__ import annotations

from typing import Final

from rig.computer.lanes.health import shut_off
from rig.computer.servo_monitors import watch_rows
from rig.core.frame import LaneBlock, has_part, lane_rows, parts_of
from rig.flight.stages import actuator_monitors
from rig.scenario.scenario import Scenario

OUTPUTS: Final = ("valve", "valve_differs", "failed_by")  # what the monitors write of a row


class WatchAgain:
    """The monitors of ``scenario`` over the recorded rows of its servos, which are given in their order.

    Open loop: a channel that was shut off in flight has no current afterwards, whatever the monitors say now.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._designed, self._monitors = actuator_monitors(scenario)

    def add(self, lanes: LaneBlock | None) -> LaneBlock | None:
        """Copy the next ``lanes`` (n,), of servos with OUTPUTS as the monitors write them."""
        if not has_part(lanes, "actuator"):
            return lanes
        again = lane_rows(len(lanes), parts_of(lanes))
        again["frame"] = lanes["frame"]
        for part in parts_of(lanes):
            for name in lanes[part].dtype.names or ():  # padding, which is part of the digest, stays zero
                again[part][name] = lanes[part][name]
        for name in OUTPUTS:
            again["actuator"][name] = 0
        watch_rows(again["actuator"], self._designed, shut_off(lanes), self._monitors)
        return again
