"""The monitors of the servo actuators once more over the recorded rows of these."""

from __future__ import annotations

from typing import Final

from rig.computer.lanes.health import shut_off
from rig.computer.servo_monitors import watch_rows
from rig.core.frame import Table
from rig.flight.stages import actuator_monitors
from rig.scenario.scenario import Scenario

OUTPUTS: Final = ("valve", "valve_differs", "failed_by")  # what the monitors write of a row


class WatchAgain:
    """The monitors of ``scenario`` over the recorded rows of its servos, which are given in their order.

    Open loop: a channel that was shut off in flight has no current afterwards, whatever the monitors say now.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._designed, self._monitors = actuator_monitors(scenario)

    def over(self, table: Table) -> Table:
        """Copy the next frames, of servos with OUTPUTS as the monitors write them."""
        if table.servo is None:
            return table
        again = table.copied_beside(table.parts)
        for name in OUTPUTS:
            again.servo[name] = 0
        watch_rows(again.servo, self._designed, shut_off(table), self._monitors)
        return again
