"""The picture of a search: robustness over flights, the random ones first, and the least so far."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import plotly.graph_objects as go

from rig.core.frame import INDEX, SIGNALS
from rig.core.palette import BLUE, INK, ORANGE, RED, SOFT, faint
from rig.core.units.quantities import unit_of_name
from rig.show.pages.page import lay_out, write_page
from rig.studies.search.objective import Measured
from rig.studies.search.search_plan import SearchPlan
from rig.verdict.requirements.robustness import robustness_text
from rig.world.faults import KINDS

MOST: Final = 30.0  # drawn of a robustness
_FAULT: Final = re.compile(r"faults\.(\d+)\.(\w+)")


def figure(plan: SearchPlan, found: Sequence[Measured]) -> go.Figure:
    """Draw the robustness of each draw over flights."""
    robustness = np.array([each.robustness for each in found])
    shown = np.clip(robustness, -MOST, MOST)
    flights = (np.arange(len(robustness)) + 1) * plan.of_one_draw
    names = [plan.arms[draw.arm].name for draw in plan.draws]
    made = go.Figure()
    for label, part, colour in (
        ("random", slice(0, plan.random), SOFT),
        ("CMA-ES", slice(plan.random, len(robustness)), BLUE),
    ):
        hover = "flight %{x}: robustness %{customdata}<extra>" + label + "</extra>"
        marks: dict[str, Any] = {"mode": "markers", "marker": {"color": faint(colour, 0.55), "size": 6}}
        texts = [
            f"{robustness_text(robustness) or 'none'}<br>{name}"
            for robustness, name in zip(robustness[part], names[part], strict=True)
        ]
        made.add_scatter(x=flights[part], y=shown[part], name=label, customdata=texts, hovertemplate=hover, **marks)
    line: dict[str, Any] = {"mode": "lines", "line": {"color": INK, "width": 2, "shape": "hv"}}
    made.add_scatter(x=flights, y=np.minimum.accumulate(shown), name="least so far", hoverinfo="skip", **line)
    _level(made, float(shown[: plan.random].min()), "least at random", {"color": ORANGE, "width": 1.5, "dash": "dash"})
    _level(made, 0.0, "violated below", {"color": RED, "width": 1})
    lay_out(made, "Robustness over flights", 420, margin={"l": 10, "r": 120, "t": 40, "b": 10})
    made.update_xaxes(title="flight")
    made.update_yaxes(title="robustness, in the scale of the requirement")
    return made


def _level(figure: go.Figure, robustness: float, text: str, line: dict[str, Any]) -> None:
    """Draw a level, its text to the right of the picture."""
    figure.add_hline(y=robustness, line=line)
    figure.add_annotation(x=1.01, xref="paper", y=robustness, text=text, showarrow=False, xanchor="left")


def write(out: Path, plan: SearchPlan, found: Sequence[Measured], figures: dict[str, Any]) -> None:
    """Write the page of a search."""
    title, varied = plan.campaign.title or plan.source, figures["worst"]["varied"]
    table = plan.data(figures["worst"]["run"])
    write_page(
        out, "search.html", {"robustness": figure(plan, found)}, {}, title=title, asked=plan.asked, results=figures,
        requirements=[each for each in plan.requirements if each.id in plan.asked.requirements],
        varied={key: shown(key, value, table) for key, value in varied.items()},
    )  # fmt: skip


def shown(key: str, value: object, table: Mapping[str, Any]) -> str:
    """Return the value of a varied key with the unit in which it is set: of a fault's own key, as its kind declares.

    table : the scenario that has it
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value)
    unit, of_fault = unit_of_name(key) or ("s" if key.endswith("_s") else ""), _FAULT.fullmatch(key)
    if of_fault is not None:
        fault = table["faults"][int(of_fault[1])]
        field = KINDS[fault["kind"]].model_fields.get(of_fault[2])
        declared = field.json_schema_extra if field is not None else None
        unit = str(declared.get("unit", unit)) if isinstance(declared, dict) else unit
        if unit.startswith("signal") and fault.get("signal") in INDEX:
            unit = unit.replace("signal", SIGNALS[INDEX[fault["signal"]]].unit, 1)
    return f"{value:.3g} {unit}".rstrip()
