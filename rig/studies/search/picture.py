"""The page of a search: robustness over flights, the clusters with their faults in words, and how to fly them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from rig.core.palette import BLUE, INK, ORANGE, RED, SOFT, faint
from rig.show.pages.flight_page import Decision
from rig.show.pages.page import lay_out, write_page
from rig.studies.search.objective import Measured
from rig.studies.search.search_plan import SearchPlan
from rig.verdict.requirements.robustness import robustness_text

MOST: Final = 30.0  # drawn of a robustness


def figure(plan: SearchPlan, found: Sequence[Measured], worst: Sequence[int]) -> go.Figure:
    """Draw the robustness of each draw over flights; ``worst``: run of the worst case of each cluster."""
    robustness = np.array([each.robustness for each in found])
    shown = np.clip(robustness, -MOST, MOST)
    flights = (np.arange(len(robustness)) + 1) * plan.of_one_draw
    names = [plan.arms[draw.arm].name for draw in plan.draws]
    made = go.Figure()
    for label, part, colour, symbol in (
        ("random", slice(0, plan.random), SOFT, "circle"),
        ("chosen", slice(plan.random, len(robustness)), BLUE, "diamond"),
    ):
        hover = "flight %{x}: robustness %{customdata}<extra>" + label + "</extra>"
        marks: dict[str, Any] = {
            "mode": "markers",
            "marker": {"color": faint(colour, 0.8), "size": 6, "symbol": symbol},
        }
        texts = [
            f"{robustness_text(robustness) or 'none'}<br>{name}"
            for robustness, name in zip(robustness[part], names[part], strict=True)
        ]
        made.add_scatter(x=flights[part], y=shown[part], name=label, customdata=texts, hovertemplate=hover, **marks)
    line: dict[str, Any] = {"mode": "lines", "line": {"color": INK, "width": 2, "shape": "hv"}}
    made.add_scatter(x=flights, y=np.minimum.accumulate(shown), name="least so far", hoverinfo="skip", **line)
    for i, run in enumerate(worst, 1):
        place: dict[str, Any] = {"x": flights[run // plan.of_one_draw], "y": shown[run // plan.of_one_draw]}
        made.add_annotation(**place, text=f"{i}", ax=14, ay=-24, xanchor="left", arrowhead=2, arrowcolor=INK)
    least = float(shown[: plan.random].min())
    below = least < 0.0
    line = {"color": ORANGE, "width": 1.5, "dash": "dash"}
    _level(made, least, "least of the random flights", line, above=not below)
    difference = plan.asked.against is not None
    zero = "no difference" if difference else "violated below 0"
    _level(made, 0.0, zero, {"color": RED, "width": 1}, above=below)
    lay_out(made, "Robustness of the flights of the search", 420)
    made.update_xaxes(title="flight")
    made.update_yaxes(title="difference of robustness" if difference else "robustness")
    return made


def _level(figure: go.Figure, robustness: float, text: str, line: dict[str, Any], above: bool) -> None:
    """Draw a level with its text above or below its right end."""
    figure.add_hline(y=robustness, line=line)
    place: dict[str, Any] = {"x": 1.0, "xref": "paper", "xanchor": "right", "yanchor": "bottom" if above else "top"}
    figure.add_annotation(y=robustness, text=text, showarrow=False, **place)


def write(
    out: Path, plan: SearchPlan, found: Sequence[Measured], figures: dict[str, Any], flights: Sequence[Decision]
) -> None:
    """Write the page of a search; ``flights``: of each cluster, or the one with the least robustness."""
    drawn = {"robustness": figure(plan, found, [each["run"] for each in figures["clusters"]])}
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
