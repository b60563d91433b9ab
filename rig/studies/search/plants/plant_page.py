"""The page of a search over a plant: robustness over simulations, and each cluster with its signals over time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from rig.core.palette import BLUE, RED, SOFT
from rig.show.pages.lines import line
from rig.show.pages.page import lay_out, write_page
from rig.studies.search.plants.plant_call import Columns
from rig.studies.search.plants.plant_rounds import Simulated, Simulating
from rig.studies.search.plants.plant_words import narrow, values_told
from rig.studies.search.robustness_picture import Drawn, robustness_figure
from rig.studies.search.rounds import Draw
from rig.verdict.requirements.robustness import robustness_text

MOST: Final = 8  # signals and columns of a picture
_ROW_PX: Final = 115
_FIRST: Final = {"regions": "evenly spread"}
Traces = tuple[Columns, Columns]  # of the worst case, and of the smallest input


def write(
    out: Path,
    simulating: Simulating,
    draws: Sequence[Draw],
    results: Sequence[Simulated],
    figures: dict[str, Any],
    traces: Sequence[Traces],
) -> None:
    """Write the page; traces : of each cluster.  BadInput or RigError: it cannot be written."""
    plan = simulating.space.plan
    drawn = {"robustness": _robustness(simulating, draws, results, figures)}
    drawn |= {f"cluster-{i}": cluster_figure(simulating, *both) for i, both in enumerate(traces, 1) if both[0]}
    words = [
        (list(narrow(each["ranges"], plan)), list(values_told(each["smallest"]["inputs"], plan)))
        for each in figures["clusters"]
    ]
    asked = [each.requirement for each in simulating.subject.asked]
    shown = {"robustness": lambda value: "none" if value is None else robustness_text(value)}
    write_page(out, "plant_search.html", drawn, shown, title=plan.title or simulating.called, results=figures,
               words=words, requirements=asked, drawn=list(drawn))  # fmt: skip


def _robustness(
    simulating: Simulating, draws: Sequence[Draw], results: Sequence[Simulated], figures: dict[str, Any]
) -> go.Figure:
    of = Drawn(
        robustness=[each.robustness for each in results],
        names=[simulating.space.arms[draw.arm].name for draw in draws],
        first=figures["first"]["simulations"],
        first_called="first",
        one="simulation",
    )
    return robustness_figure(of, [each["number"] - 1 for each in figures["clusters"]])


def cluster_figure(simulating: Simulating, worst: Columns, smallest: Columns) -> go.Figure:
    """Draw the signals that are given and the columns (n,) over time, those of the requirements first."""
    plan, subject = simulating.space.plan, simulating.subject
    first = [*plan.signals, *(name for name in subject.names if name not in plan.parameters)]
    names = [name for name in dict.fromkeys([*first, *worst]) if name in worst and name not in plan.parameters][:MOST]
    count = max(len(names), 1)
    figure = make_subplots(rows=count, shared_xaxes=True, vertical_spacing=0.12 / count)
    both = [(worst, "worst case", {"color": BLUE, "width": 2.0})]
    if smallest:
        both += [(smallest, "smallest input", {"color": SOFT, "width": 1.5, "dash": "dash"})]
    for row, name in enumerate(names, 1):
        steps = worst[name].dtype.kind == "b" or (name in plan.signals and plan.signals[name].shape == "constant")
        for columns, called, look in both:
            if name not in columns:
                continue
            values = columns[name].astype(float)
            of = line(np.arange(len(values)) / plan.rate_hz, values)
            look = {**look, "shape": "hv" if steps else "linear"}
            about: dict[str, Any] = {"legendgroup": called, "showlegend": row == 1, "mode": "lines", "line": look}
            hover = f"%{{x:.3g}} s: %{{y:.4g}}<extra>{name}, {called}</extra>"
            figure.add_scatter(x=of.time_s, y=of.values, name=called, hovertemplate=hover, **about, row=row, col=1)
        figure.update_yaxes(title=name, row=row, col=1)
    violated = [each for each in subject.verdicts(worst) if each.status == "violated"]
    for each in violated:
        figure.add_vline(x=each.instant_s, line={"color": RED, "width": 1, "dash": "dot"})
    texts = [f"{each.requirement} is violated, most at {each.instant_s:.3g} s" for each in violated]
    lay_out(figure, "; ".join(texts), 80 + _ROW_PX * count)
    figure.update_xaxes(title="time, s", row=count, col=1)
    return figure
