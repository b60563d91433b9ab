"""The page of a search: robustness over flights, the clusters with their faults in words, and how to fly them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rig.show.pages.flight_page import Decision
from rig.show.pages.page import write_page
from rig.studies.search.objective import Measured
from rig.studies.search.robustness_picture import Drawn, robustness_figure
from rig.studies.search.search_plan import SearchPlan
from rig.verdict.requirements.robustness import robustness_text


def write(
    out: Path, plan: SearchPlan, found: Sequence[Measured], figures: dict[str, Any], flights: Sequence[Decision]
) -> None:
    """Write the page of a search; ``flights``: of each cluster, or the one with the least robustness."""
    robustness = Drawn(
        robustness=[each.robustness for each in found],
        names=[plan.arms[draw.arm].name for draw in plan.draws],
        first=plan.random,
        first_called="first" if plan.asked.method == "regions" else "random",
        of_one_draw=plan.of_one_draw,
        difference=plan.asked.against is not None,
    )
    worst = [each["run"] // plan.of_one_draw for each in figures["clusters"]]
    drawn = {"robustness": robustness_figure(robustness, worst)}
    pictures = [{f"{i}-{name}": made for name, made in each.figures.items()} for i, each in enumerate(flights, 1)]
    for each in pictures:
        drawn |= each
    filters = {"robustness": lambda value: "none" if value is None else robustness_text(value)}
    write_page(
        out, "search.html", drawn, filters,
        folder=out.parent, title=plan.campaign.title or plan.source, asked=plan.asked, results=figures,
        requirements=[each for each in plan.requirements if each.id in plan.asked.requirements],
        flights=list(zip(flights, pictures, strict=True)),
    )  # fmt: skip
