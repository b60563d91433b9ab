"""The pictures of the worst flights of a search, which are flown again: the table has no rows of a flight."""

from __future__ import annotations

from collections.abc import Sequence

from rig.core.confined import scratch_folder
from rig.flight.fly import fly
from rig.show.pages.flight_page import Decision, decision_of
from rig.studies.campaign.plan import Run
from rig.studies.search.objective import Measured
from rig.studies.search.search_plan import SearchPlan
from rig.studies.search.worst_cases import Case
from rig.unit.unit_file import Unit
from rig.verdict.of_log import FlightConclusion


def worst_flights(
    plan: SearchPlan, found: Sequence[Measured], cases: Sequence[Case], unit: Unit | None = None
) -> list[Decision]:
    """Fly the scenario that is kept of each case, in closed loop, and draw its decision and its voted values.

    Without a case it is the flight with the least robustness.
    """
    tables = [{**each.kept.table, "seed": each.kept.seed} for each in cases]
    if not tables:
        least = min(range(len(found)), key=lambda i: (found[i].value, i))
        tables = [plan[least * plan.of_one_draw].data]
    return [_drawn(Run(0, {}, table, plan.trust), unit) for table in tables]


def _drawn(run: Run, unit: Unit | None) -> Decision:
    with scratch_folder() as folder:
        return decision_of(fly(run.scenario(), out=folder, unit=unit, outcome=FlightConclusion()).log)
