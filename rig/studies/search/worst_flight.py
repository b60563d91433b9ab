"""The pictures of the worst flight of a search, which is flown again: the table has no rows of a flight."""

from __future__ import annotations

from rig.core.confined import scratch_folder
from rig.show.pages.flight_page import Decision, decision_of
from rig.studies.campaign.flying import fly, write_log
from rig.studies.search.search_plan import SearchPlan


def decision(plan: SearchPlan, number: int) -> Decision:
    """Fly run ``number`` of a search again, in closed loop, and draw its decision and its voted values."""
    with scratch_folder() as folder:
        path = folder / "worst.mcap"
        write_log(fly(plan[number].scenario()), path)
        return decision_of(path)
