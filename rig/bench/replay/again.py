"""The recorded frames of a flight in open loop: its computers and the monitors of its servo actuators again."""

from __future__ import annotations

from typing import Final

from rig.bench import lanes_again
from rig.bench.lanes_again import LanesAgain
from rig.bench.replay import vote_again
from rig.bench.replay.vote_again import VoteAgain
from rig.computer.lanes.health import shut_off
from rig.computer.servo_monitors import watch_rows
from rig.core.frame import Table
from rig.flight.stages import actuator_monitors
from rig.log.columns import PART_COLUMNS, PartColumn
from rig.scenario.scenario import Scenario
from rig.unit.running_unit import UnitUnderTest

WATCHED: Final = ("valve", "valve_differs", "failed_by")  # what the monitors of servos write of a row


class Again:
    """The computers of ``scenario`` and its monitors over recorded frames, given in order.

    One computer votes again; several lanes run completely.  BadInput: several, and another manager or ``unit``.
    """

    def __init__(self, scenario: Scenario, unit: UnitUnderTest | None = None) -> None:
        several = scenario.computers.count > 1
        self._vote = None if several else VoteAgain(scenario, unit)
        self._lanes = LanesAgain(scenario, None if unit is None else "a unit under test") if several else None
        self._watch = WatchAgain(scenario)
        self.outputs = lanes_again.OUTPUTS if several else vote_again.outputs(unit)  # fields of the rows
        self.part_columns = [column for column in PART_COLUMNS if _written(column)]

    def over(self, frames: Table) -> Table:
        """Copy the next ``frames`` with the new output."""
        if self._vote is not None:
            frames = Table(self._vote.over(frames.rows), frames.beside, frames.timing)
        if self._lanes is not None and frames.lane is not None:
            frames = self._lanes.over(frames)
        return self._watch.over(frames)


def _written(column: PartColumn) -> bool:
    return column.part == "computer" or column.field in WATCHED


class WatchAgain:
    """The monitors of ``scenario`` over the recorded rows of its servos, given in order.

    Open loop: a channel that was shut off in flight has no current afterwards, also if the monitors now accept it.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._designed, self._monitors = actuator_monitors(scenario)

    def over(self, table: Table) -> Table:
        """Copy the next frames of servos, with the new WATCHED fields of the monitors."""
        if table.servo is None:
            return table
        again = table.copied_beside(table.parts)
        for name in WATCHED:
            again.servo[name] = 0
        watch_rows(again.servo, self._designed, shut_off(table), self._monitors)
        return again
