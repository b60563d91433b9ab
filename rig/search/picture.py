"""The picture of a search: margin over flights, the random ones first, and the least so far."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from rig.report.page import lay_out, write_page
from rig.search.objective import Measured
from rig.search.plan import SearchPlan
from rig.util.palette import BLUE, INK, ORANGE, RED, SOFT, faint

MOST_ARMS: Final = 12  # whose points have a colour of their own


def figure(plan: SearchPlan, found: Sequence[Measured]) -> go.Figure:
    """Draw the margin of each draw over flights."""
    margins = np.array([each.margin for each in found])
    flights = (np.arange(len(margins)) + 1) * plan.of_one_draw
    names = [plan.arms[draw.arm].name for draw in plan.draws]
    made = go.Figure()
    for label, part, colour in (
        ("random", slice(0, plan.random), SOFT),
        ("CMA-ES", slice(plan.random, len(margins)), BLUE),
    ):
        hover = "flight %{x}: margin %{y:.3g}<br>%{customdata}<extra>" + label + "</extra>"
        marks: dict[str, Any] = {"mode": "markers", "marker": {"color": faint(colour, 0.55), "size": 6}}
        made.add_scatter(
            x=flights[part], y=margins[part], name=label, customdata=names[part], hovertemplate=hover, **marks
        )
    best = np.minimum.accumulate(margins)
    line: dict[str, Any] = {"mode": "lines", "line": {"color": INK, "width": 2, "shape": "hv"}}
    made.add_scatter(x=flights, y=best, name="least so far", hoverinfo="skip", **line)
    at_random = float(margins[: plan.random].min())
    made.add_hline(y=at_random, line={"color": ORANGE, "width": 1.5, "dash": "dash"})
    made.add_annotation(x=1, xref="paper", y=at_random, text="least at random", showarrow=False, xanchor="right",
                        yanchor="bottom")  # fmt: skip
    made.add_hline(y=0.0, line={"color": RED, "width": 1})
    made.add_annotation(x=0, xref="paper", y=0.0, text="violated below", showarrow=False, xanchor="left", yanchor="top")
    lay_out(made, "Margin over flights", 420, showlegend=True)
    made.update_xaxes(title="flight")
    made.update_yaxes(title="margin")
    return made


def write(out: Path, plan: SearchPlan, found: Sequence[Measured], figures: dict[str, Any]) -> None:
    """Write the page of a search."""
    title = plan.campaign.title or plan.source
    write_page(
        out, "search.html", {"margins": figure(plan, found)}, {}, title=title, asked=plan.asked, results=figures,
        requirements=[each for each in plan.requirements if each.id in plan.asked.requirements],
    )  # fmt: skip
