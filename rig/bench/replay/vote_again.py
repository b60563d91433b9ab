"""The recorded frames again: through the redundancy stage alone, or flown from the first frame."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from rig.bench.drive import Decide, Stages, run, write_sources
from rig.bench.lanes_again import blank, copied, places_of
from rig.bench.vote_rows import by_class
from rig.core.frame import Block, nested
from rig.flight import loop
from rig.flight.unit_loop import UnitVoter
from rig.scenario.scenario import Scenario
from rig.unit.running_unit import UnitUnderTest
from rig.unit.unit_records import Role

# What the redundancy stage writes of a row, and the source that the control law takes on its word.
OUTPUTS: Final = (
    *("voted", "reference", "second_reference", "trend_high", "trend_low", "state", "level", "pattern", "decided_by"),
    *("reference_usable", "common_mode"),
    *("source", "discrete_voted", "discrete_state", "discrete_level"),
)
COMMANDED: Final = ("surface", "law")  # by a unit in the role of a flight computer or of a control law


def vote_again(rows: Block, scenario: Scenario, unit: UnitUnderTest | None = None) -> Block:
    """Copy all ``rows`` of a flight, with OUTPUTS as VoteAgain writes them."""
    return VoteAgain(scenario, unit).over(rows)


class VoteAgain:
    """The redundancy stage of ``scenario`` over the channels of recorded rows, given in order.

    Faults on references act again in their recorded frames.  Open loop: truth, channels, commands and all other fields
    stay as recorded.  BadInput: the user's manager.

    unit : votes instead of the manager; a flight computer writes COMMANDED too; a control law writes them alone, from
           the votes of the manager
    """

    def __init__(self, scenario: Scenario, unit: UnitUnderTest | None = None) -> None:
        self._scenario, self._unit, self._stage = scenario, unit, loop.redundancy(scenario)
        self._voter: UnitVoter | None = None
        self._law: UnitVoter | None = None
        self._is_law = unit is not None and unit.role is Role.CONTROL_LAW
        self._on_references = [i for i, fault in enumerate(scenario.faults) if "reference" in places_of(fault)]
        flown = scenario if self._on_references else scenario.model_copy(update={"faults": []})
        self._faults, data = loop.faults(flown), self._stage.data
        self._stages = Stages(
            faults=self._faults.data, references=data.references, manager=data.manager, discretes=data.discretes
        )

    def over(self, rows: Block) -> Block:
        """Copy the next ``rows`` (n,) with new OUTPUTS."""
        again = blank(rows, self._scenario, outputs(self._unit), self._on_references)
        self._faults.prepare(again)
        flown = nested(copied(rows) if self._on_references else again)
        run(nested(again), replace(self._stages, faults=self._faults.data), flown, self._decide(again))
        write_sources(nested(again))
        if self._unit is not None and self._is_law:
            self._law = self._law or UnitVoter(self._unit, self._scenario, self._stage, again)
            for k in range(len(again)):
                self._law.step(again, k)
        return again

    def _decide(self, again: Block) -> Decide | None:
        """Return the voter in place of the manager: a unit, a user's class, or None."""
        unit = self._unit if self._unit is None or not self._is_law else self._unit.voter
        if unit is None:
            return None if self._stage.own is None else by_class(self._stage.own, again, nested(again))
        voter = self._voter = self._voter or UnitVoter(unit, self._scenario, self._stage, again)
        return lambda _, k: voter.step(again, k)


def outputs(unit: UnitUnderTest | None) -> tuple[str, ...]:
    """Return the fields that a replay writes."""
    return OUTPUTS if unit is None or unit.role is Role.REDUNDANCY else (*OUTPUTS, *COMMANDED)
